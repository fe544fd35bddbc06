"""Reading and writing: what is held, what is kept, and that a target is replaced at once or not at all."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import meshio
import numpy as np
import pytest
from meshes import tangle
from places import SAMPLES
from programs import gmsh_session
from scipy.spatial.transform import Rotation

from meshfix_cli import read, summarise, untangle, write
from meshfix_cli.errors import InvalidMeshError, ReadError, WriteError
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.meshfile.document import Document
from meshfix_cli.meshfile.formats import sniff
from meshfix_cli.meshfile.writing import output_format

SAMPLE_FILES = sorted(p.name for p in SAMPLES.iterdir() if p.suffix in (".vtk", ".msh", ".obj"))


def save(path: Path, mesh: Mesh, **extra: object) -> Path:
    points = np.column_stack([mesh.points, np.zeros((len(mesh.points), 3 - mesh.dimension))])
    kind = "triangle" if mesh.dimension == 2 else "tetra"
    meshio.Mesh(points, [(kind, mesh.topology.simplices)], **extra).write(path)
    return path


def roundtrip(path: Path, target: Path) -> tuple[Document, Document]:
    document = read(path)
    outcome = untangle(document.mesh)
    assert outcome.valid
    write(document, outcome.after, target)
    return document, read(target)


@pytest.mark.parametrize("name", SAMPLE_FILES)
def test_samples_come_back_valid_with_their_connectivity_and_fixed_points(name: str, tmp_path: Path) -> None:
    before, after = roundtrip(SAMPLES / name, tmp_path / name)
    assert after.mesh.check()[0] == 0
    assert after.format == before.format
    for one, other in zip(after.mesh.topology.blocks, before.mesh.topology.blocks, strict=True):
        assert one.element is other.element
        np.testing.assert_array_equal(one.vertices, other.vertices)
    fixed = ~before.mesh.movable
    assert after.source.points[fixed].tobytes() == before.source.points[fixed].tobytes()


def test_physical_groups_survive_and_hold_their_interface(tmp_path: Path) -> None:
    before, after = roundtrip(SAMPLES / "two_materials.msh", tmp_path / "out.msh")
    assert before.fixed["between regions of gmsh:physical"] > 0
    for document in (before, after):
        assert set(document.source.arrays.groups) == {"steel", "copper"}
    np.testing.assert_array_equal(
        after.source.arrays.cell["gmsh:physical"][0], before.source.arrays.cell["gmsh:physical"][0]
    )


@pytest.mark.parametrize("dtype", ["f4", "f8"])
@pytest.mark.parametrize("binary", [True, False])
def test_type_and_encoding_of_the_input_are_kept(tmp_path: Path, plate: Mesh, dtype: str, binary: bool) -> None:
    mesh = tangle(plate)
    points = np.column_stack([mesh.points, np.zeros(len(mesh.points))]).astype(dtype)
    path = tmp_path / "in.vtk"
    meshio.Mesh(points, [("triangle", mesh.topology.simplices)]).write(path, binary=binary)
    document, after = roundtrip(path, tmp_path / "out.vtk")
    assert after.source.points.dtype.newbyteorder("=") == np.dtype(dtype)
    assert document.format.binary is binary
    stored = document.as_stored(untangle(document.mesh).after)
    np.testing.assert_array_equal(after.mesh.points, stored.points)


def test_what_float32_stores_is_what_is_judged(tmp_path: Path) -> None:
    """Far from the origin float32 cannot hold the mesh: the report speaks of what is in the file."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]], dtype="f4") * 0.01 + 1e3
    path = tmp_path / "far.vtk"
    meshio.Mesh(points.astype("f4"), [("triangle", [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])]).write(path)
    document = read(path)
    moved = np.array(document.mesh.points)
    moved[4] = [1e3 + 0.005, 1e3 + 0.005]
    inside = document.mesh.with_points(moved)
    assert document.as_stored(inside).points[4].tolist() == [np.float32(1e3 + 0.005)] * 2


def test_rounding_never_makes_a_valid_file_worse(tmp_path: Path) -> None:
    """Integers are all that float32 holds at 2^23: the better shape, rounded, is inverted, so nothing moves."""
    rim = np.array([[3, 2], [3, 4], [-2, 0], [-3, -5], [-1, -2], [-2, -5], [0, 0]]) + 2.0**23
    points = np.column_stack([rim, np.zeros(7)]).astype("f4")
    fan = [[i, (i + 1) % 6, 6] for i in range(6)]
    path = tmp_path / "coarse.vtk"
    meshio.Mesh(points, [("triangle", fan)]).write(path)
    document = read(path)
    outcome = untangle(document.mesh)
    chosen, _ = document.first_valid_as_stored(outcome.after, outcome.untangled, outcome.before)
    assert document.as_stored(chosen).check()[0] <= document.mesh.check()[0]


@pytest.mark.parametrize("angles", [(0, 0, 0), (90, 0, 0), (0, 90, 0), (25, -40, 70)])
def test_a_mesh_in_any_plane_is_solved_in_that_plane(tmp_path: Path, plate: Mesh, angles: tuple[float, ...]) -> None:
    turn = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    tangled = tangle(plate)
    points = np.column_stack([tangled.points, np.zeros(plate.topology.n)]) @ turn.T + [3.0, -2.0, 5.0]
    path = tmp_path / "in.vtk"
    meshio.Mesh(points, [("triangle", plate.topology.simplices)]).write(path)
    document, after = roundtrip(path, tmp_path / "out.vtk")
    flat = (after.source.points - [3.0, -2.0, 5.0]) @ turn
    assert np.abs(flat[:, 2]).max() < 1e-12
    fixed = ~document.mesh.movable
    np.testing.assert_array_equal(after.source.points[fixed], points[fixed])
    assert summarise(after.mesh).min_angle == pytest.approx(summarise(untangle(tangled).after).min_angle, rel=1e-3)


def test_a_plane_that_float32_bends_is_a_plane(tmp_path: Path, plate: Mesh) -> None:
    turn = Rotation.from_euler("xyz", (25, -40, 70), degrees=True).as_matrix()
    points = (np.column_stack([plate.points, np.zeros(plate.topology.n)]) @ turn.T + 100.0).astype("f4")
    meshio.Mesh(points, [("triangle", plate.topology.simplices)]).write(tmp_path / "in.vtk")
    assert read(tmp_path / "in.vtk").mesh.check()[0] == 0


def test_a_curved_surface_is_no_plane_mesh(tmp_path: Path, plate: Mesh) -> None:
    points = np.column_stack([plate.points, 0.1 * np.sin(plate.points[:, 0])])
    path = tmp_path / "curved.vtk"
    meshio.Mesh(points, [("triangle", plate.topology.simplices)]).write(path)
    document = read(path)
    assert document.basis is None and document.mesh.surface is not None
    np.testing.assert_array_equal(document.mesh.points, points)


def test_cells_of_lower_dimension_hold_their_vertices(tmp_path: Path, bracket: Mesh) -> None:
    inner = np.flatnonzero(bracket.movable)
    cells = [
        ("tetra", bracket.topology.simplices),
        ("line", [[inner[0], inner[1]]]),
        ("triangle", [[inner[5], inner[6], inner[7]]]),
    ]
    path = tmp_path / "in.vtk"
    meshio.Mesh(bracket.points, cells).write(path)
    document = read(path)
    held = bracket.movable & ~document.mesh.movable
    assert np.flatnonzero(held).tolist() == sorted(inner[[0, 1, 5, 6, 7]].tolist())
    assert document.fixed["on other cells of the file"] == 5


def test_fix_and_regions_name_arrays(tmp_path: Path, plate: Mesh) -> None:
    flags = np.zeros(plate.topology.n)
    chosen = np.flatnonzero(plate.movable)[:3]
    flags[chosen] = 1
    labels = (plate.points[plate.topology.simplices].mean(axis=1)[:, 0] > 1.5).astype(float)
    path = save(tmp_path / "in.vtk", plate, point_data={"hold": flags}, cell_data={"part": [labels]})
    document = read(path, fix="hold", regions="part")
    assert not document.mesh.movable[chosen].any()
    assert document.fixed["by --fix hold"] == 3
    assert document.fixed["between regions of part"] > 3
    with pytest.raises(ReadError, match=r"no point data, set or group named 'nope' \(found: hold\)"):
        read(path, fix="nope")
    with pytest.raises(ReadError, match=r"no cell data named 'nope' \(found: part\)"):
        read(path, regions="nope")


def test_elements_in_two_groups_keep_the_interface_of_their_materials(tmp_path: Path, bracket: Mesh) -> None:
    """gmsh 2.2 lists an element once for each of its groups: here all are in 9, and in 1 or 2."""
    tets = bracket.topology.simplices
    own = 1 + (bracket.points[tets].mean(axis=1)[:, 1] > 1.0).astype(np.int64)
    cells = [("tetra", tets), ("tetra", tets)]
    data = {"gmsh:physical": [np.full(len(tets), 9), own], "gmsh:geometrical": [own, own]}
    path = tmp_path / "in.msh"
    meshio.Mesh(bracket.points, cells, cell_data=data).write(path, file_format="gmsh22", binary=False)
    held = bracket.movable & ~read(path).mesh.movable
    np.testing.assert_array_equal(held, bracket.movable & bracket.topology.interface(own))
    assert held.any()


def test_regions_are_one_label_for_each_element(tmp_path: Path, plate: Mesh) -> None:
    m = len(plate.topology.simplices)
    path = save(tmp_path / "in.vtk", plate, cell_data={"velocity": [np.ones((m, 3))], "gap": [np.full(m, np.nan)]})
    with pytest.raises(ReadError, match="'velocity' are not labels of regions: they have 3 components"):
        read(path, regions="velocity")
    assert "between regions of gap" not in read(path, regions="gap").fixed


@pytest.mark.parametrize("suffix", [".ply", ".su2"])
def test_truncated_files_of_other_formats(suffix: str, tmp_path: Path, plate: Mesh, bracket: Mesh) -> None:
    whole = save(tmp_path / f"whole{suffix}", bracket if suffix == ".su2" else plate).read_bytes()
    path = tmp_path / f"cut{suffix}"
    for share in (0.03, 0.3, 0.5, 0.8):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises((ReadError, InvalidMeshError)):
            read(path)


def test_ids_count_all_cells_of_the_file(tmp_path: Path, plate: Mesh) -> None:
    cells = [("line", [[0, 1], [1, 2]]), ("triangle", plate.topology.simplices)]
    path = tmp_path / "in.vtk"
    meshio.Mesh(np.column_stack([plate.points, 0 * plate.points[:, 0]]), cells).write(path)
    assert read(path).ids.tolist() == list(range(2, 2 + len(plate.topology.simplices)))


def test_notes_tell_what_a_user_should_know(tmp_path: Path, plate: Mesh) -> None:
    triangles = np.concatenate([plate.topology.simplices, plate.topology.simplices[:2]])[:, ::-1]
    points = np.column_stack([plate.points, 0 * plate.points[:, 0]])
    path = tmp_path / "in.vtk"
    meshio.Mesh(np.concatenate([points, [[9.0, 9, 9]]]), [("triangle", triangles)]).write(path)
    notes = " / ".join(read(path).notes)
    assert "2 triangles are repetitions of another" in notes
    assert "1 point belongs to no triangle" in notes
    assert "the elements are numbered the other way round" in notes


@pytest.mark.parametrize(
    ("text", "name", "binary"),
    [
        (b"# vtk DataFile Version 4.2\nt\nBINARY\n", "vtk42", True),
        (b"# vtk DataFile Version 5.1\nt\nASCII\n", "vtk", False),
        (b"$MeshFormat\n2.2 0 8\n", "gmsh22", False),
        (b"$MeshFormat\n4.1 1 8\n", "gmsh", True),
        (b"$Comments\nx\n$EndComments\n$MeshFormat\n4.1 0 8\n", "gmsh", False),
        (b'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid">', "vtu", True),
        (b"MeshVersionFormatted 2", "medit", None),
        (b"ply\nformat ascii 1.0\n", "ply", False),
        (b"# Blender v3\nmtllib a.mtl\no Plane\nv 1.0 0.0 0.0\n", "obj", None),
        (b"*Heading\n", "abaqus", None),
        (b"*NODE\n", "abaqus", None),
        (b"OFF\n3 1 0\n", "off", None),
    ],
)
def test_first_bytes_tell_the_format(text: bytes, name: str, binary: bool | None) -> None:
    form = sniff(text)
    assert form is not None
    assert (form.name, form.binary) == (name, binary)


def test_a_long_comment_is_read_once() -> None:
    """A pattern that tries all ways to divide blanks among comments would take hours."""
    for comment in (b"# comment\r\n", b"# # # #   \n"):
        form = sniff(comment * 60 + b"v 0 0 0\r\nv 1 0 0\r\nf 1 2 3\r\n")
        assert form is not None
        assert form.name == "obj"
    form = sniff(b"# a\n # b\nMeshVersionFormatted 2\n")
    assert form is not None
    assert form.name == "medit"


def test_files_that_need_another_beside_them(tmp_path: Path, bracket: Mesh) -> None:
    """A .ele file has its points in a .node file."""
    meshio.Mesh(bracket.points, [("tetra", bracket.topology.simplices)]).write(tmp_path / "mesh.ele")
    np.testing.assert_array_equal(read(tmp_path / "mesh.ele").mesh.points, bracket.points)


def test_an_unknown_extension_is_no_format(tmp_path: Path) -> None:
    document = read(SAMPLES / "two_materials.msh")
    assert output_format(document, str(tmp_path / "mesh.orig")) == document.format
    (tmp_path / "wrong.vtk").write_bytes((SAMPLES / "two_materials.msh").read_bytes())
    wrong = read(tmp_path / "wrong.vtk")
    assert output_format(wrong, str(tmp_path / "wrong.vtk")) == document.format
    assert output_format(wrong, str(tmp_path / "other.vtk")).reader == "vtk"


def test_isolated_points_may_be_anything(tmp_path: Path) -> None:
    text = (SAMPLES / "plate_tangled.obj").read_text()
    (tmp_path / "in.obj").write_text(f"{text}v nan inf -inf\nv 1e308 1e308 1e308\n")
    document, after = roundtrip(tmp_path / "in.obj", tmp_path / "out.obj")
    assert after.source.points[-2:].tobytes() == document.source.points[-2:].tobytes()
    assert "2 points belong to no triangle" in document.notes[0]


@pytest.mark.parametrize("noise", [b"", b"\x00\x01\x02\xff" * 99, b"hello", b"<?xml?><svg/>"])
def test_noise_has_no_format(noise: bytes) -> None:
    assert sniff(noise) is None


@pytest.mark.parametrize("suffix", [".vtu", ".msh", ".mesh", ".obj", ".inp", ".ply"])
def test_other_formats_by_extension(tmp_path: Path, plate: Mesh, suffix: str) -> None:
    document = read(save(tmp_path / "in.vtk", tangle(plate)))
    outcome = untangle(document.mesh)
    write(document, outcome.after, tmp_path / f"out{suffix}")
    after = read(tmp_path / f"out{suffix}")
    assert after.mesh.check()[0] == 0
    np.testing.assert_array_equal(after.mesh.topology.simplices, document.mesh.topology.simplices)
    fixed = ~document.mesh.movable
    np.testing.assert_array_equal(after.source.points[fixed, :2], document.source.points[fixed, :2])
    if suffix == ".msh":
        assert after.format.name == "gmsh22"  # never meshio's default of ANSYS


@pytest.mark.parametrize("suffix", [".vtk", ".vtu", ".mesh"])
def test_conversions_keep_the_materials(tmp_path: Path, suffix: str) -> None:
    document = read(SAMPLES / "two_materials.msh")
    _, dropped = write(document, untangle(document.mesh).after, tmp_path / f"out{suffix}")
    held = suffix != ".mesh"
    assert dropped == (*(("group steel", "group copper") if not held else ()), "comments")
    after = read(tmp_path / f"out{suffix}")
    np.testing.assert_array_equal(after.mesh.movable, document.mesh.movable)
    assert sorted(after.fixed.values()) == sorted(document.fixed.values())


def test_materials_become_sets_and_sets_materials(tmp_path: Path) -> None:
    document = read(SAMPLES / "two_materials.msh")
    labels = document.source.arrays.cell["gmsh:physical"][0]
    write(document, document.mesh, tmp_path / "out.inp")
    deck = read(tmp_path / "out.inp")
    np.testing.assert_array_equal(np.concatenate(deck.source.arrays.cell["abaqus:section"]), labels)
    _, dropped = write(deck, deck.mesh, tmp_path / "back.msh")
    assert dropped == ("keywords *HEADING, *MATERIAL, *SOLID SECTION",)
    back = read(tmp_path / "back.msh")
    np.testing.assert_array_equal(np.concatenate(back.source.arrays.cell["gmsh:physical"]), labels)
    np.testing.assert_array_equal(back.mesh.movable, document.mesh.movable)


def test_a_file_of_sets_holds_its_interface(tmp_path: Path) -> None:
    document = read(SAMPLES / "two_materials.msh")
    write(document, document.mesh, tmp_path / "out.inp")
    np.testing.assert_array_equal(read(tmp_path / "out.inp").mesh.movable, document.mesh.movable)


def test_groups_of_different_dimension_are_different_sets(tmp_path: Path, bracket: Mesh) -> None:
    """Numbers of gmsh's groups are those of a dimension, and its names may differ in what Abaqus cannot see."""
    tets = bracket.topology.simplices
    cells = [("triangle", tets[:3, :3]), ("tetra", tets)]
    physical = [np.array([1, 1, 2]), 1 + np.arange(len(tets)) % 2]
    groups = {"wall, left": [1, 2], "wall": [2, 2], "steel": [1, 3], "Steel": [2, 3]}
    data = {"gmsh:physical": physical, "gmsh:geometrical": physical}
    mesh = meshio.Mesh(bracket.points, cells, cell_data=data, field_data={k: np.array(v) for k, v in groups.items()})
    mesh.write(tmp_path / "in.msh", file_format="gmsh22", binary=False)
    document = read(tmp_path / "in.msh")
    write(document, document.mesh, tmp_path / "out.inp")
    sets = read(tmp_path / "out.inp").source.arrays.cell_sets
    sizes = {name: [len(rows) for rows in runs] for name, runs in sets.items()}
    half = len(tets) // 2
    assert sizes == {"wall_left": [2, 0], "wall": [1, 0], "steel": [0, half], "Steel_2": [0, half]}


def test_one_array_tells_materials_apart(tmp_path: Path, plate: Mesh) -> None:
    m = len(plate.topology.simplices)
    two = {"gmsh:physical": [1 + np.arange(m) % 2], "RegionId": [np.arange(m)]}
    document = read(save(tmp_path / "two.vtu", plate, cell_data=two))
    write(document, document.mesh, tmp_path / "two.msh")
    after = read(tmp_path / "two.msh").source.arrays.cell
    np.testing.assert_array_equal(np.concatenate(after["gmsh:physical"]), two["gmsh:physical"][0])
    np.testing.assert_array_equal(np.concatenate(after["RegionId"]), two["RegionId"][0])
    plain = read(save(tmp_path / "plain.vtu", plate, cell_data={"number": [np.arange(m)]}))
    assert "cell data number" in write(plain, plain.mesh, tmp_path / "plain.mesh")[1]
    assert read(tmp_path / "plain.mesh").mesh.movable.any()
    chosen = read(tmp_path / "plain.vtu", regions="number")
    write(chosen, chosen.mesh, tmp_path / "chosen.msh")
    assert not read(tmp_path / "chosen.msh").mesh.movable.any()


def test_labels_of_points_are_no_tags_of_gmsh(tmp_path: Path, plate: Mesh) -> None:
    document = read(save(tmp_path / "in.mesh", plate, point_data={"medit:ref": np.arange(plate.topology.n)}))
    write(document, document.mesh, tmp_path / "out.msh")
    np.testing.assert_array_equal(read(tmp_path / "out.msh").source.arrays.point["medit:ref"], range(plate.topology.n))
    with gmsh_session() as gmsh:
        gmsh.open(str(tmp_path / "out.msh"))
        assert len(gmsh.view.getTags()) == 1


def test_a_converted_file_has_one_run_for_each_type(tmp_path: Path, bracket: Mesh) -> None:
    """Programs that read MEDIT files take the last of several lists of one kind."""
    tets, label = bracket.topology.simplices, np.arange(len(bracket.topology.simplices)) % 3
    cells = [("tetra", tets[:100]), ("triangle", tets[:5, :3]), ("tetra", tets[100:])]
    data = {"label": [label[:100], label[:5] + 7, label[100:]], "vector": [np.ones((len(c), 3)) for _, c in cells]}
    meshio.Mesh(bracket.points, cells, cell_data=data).write(tmp_path / "in.vtk")
    document = read(tmp_path / "in.vtk", regions="label")
    _, dropped = write(document, document.mesh, tmp_path / "out.mesh")
    assert (tmp_path / "out.mesh").read_text().count("Tetrahedra") == 1
    assert dropped == ("cell data vector",)
    after = read(tmp_path / "out.mesh")
    np.testing.assert_array_equal(after.mesh.topology.simplices, document.mesh.topology.simplices)
    np.testing.assert_array_equal(after.source.arrays.cell["medit:ref"][0], label)


def test_what_a_format_cannot_hold_is_named(tmp_path: Path) -> None:
    document = read(SAMPLES / "plate_tangled.obj")
    assert write(document, document.mesh, tmp_path / "out.off")[1] == ("comments", "objects and groups")
    points = np.column_stack([document.mesh.points, np.zeros(document.mesh.topology.n)])
    cells = [("triangle", document.parts[0].vertices), ("line", [[0, 1]]), ("vertex", [[3]])]
    meshio.Mesh(points, cells, point_data={"a b": points[:, 0]}).write(tmp_path / "in.vtu")
    rich = read(tmp_path / "in.vtu")
    lost = ("line cells", "vertex cells", "point data a b", "comments")
    assert write(rich, rich.mesh, tmp_path / "out.obj")[1] == lost
    assert write(rich, rich.mesh, tmp_path / "out.vtk")[1] == lost[-1:]


@pytest.mark.parametrize("binary", [False, True])
def test_fields_survive_in_gmsh_files(tmp_path: Path, plate: Mesh, binary: bool) -> None:
    """gmsh itself reads what meshio has written."""
    n, m = plate.topology.n, len(plate.topology.simplices)
    arrays = {"t": np.linspace(0, 1, n), "v": np.arange(3.0 * n).reshape(n, 3) / 7}
    points = np.column_stack([plate.points, np.zeros(n)])
    mesh = meshio.Mesh(points, [("triangle", plate.topology.simplices)], arrays, {"load": [np.arange(m) % 4]})
    mesh.write(tmp_path / "in.vtk", binary=binary)
    document = read(tmp_path / "in.vtk")
    assert write(document, document.mesh, tmp_path / "out.msh")[1] == ()
    after = read(tmp_path / "out.msh").source.arrays
    np.testing.assert_array_equal(np.concatenate(after.cell["load"]), np.arange(m) % 4)
    for name, values in arrays.items():
        np.testing.assert_array_equal(after.point[name], values)
    with gmsh_session() as gmsh:
        gmsh.open(str(tmp_path / "out.msh"))
        views = [gmsh.view.getModelData(tag, 0) for tag in gmsh.view.getTags()]
    assert sorted(len(data) for _, _, data, _, _ in views) == sorted([n, n, m])


def test_msh_keeps_its_version(tmp_path: Path) -> None:
    document = read(SAMPLES / "two_materials.msh")
    assert output_format(document, str(tmp_path / "x.msh")).name == "gmsh22"


def test_existing_file_keeps_its_mode_and_links_are_followed(tmp_path: Path, plate: Mesh) -> None:
    path = save(tmp_path / "real.vtk", tangle(plate))
    path.chmod(0o640)
    link = tmp_path / "link.vtk"
    link.symlink_to(path)
    document = read(link)
    write(document, untangle(document.mesh).after, link)  # INPUT = OUTPUT
    assert link.is_symlink()
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    assert read(path).mesh.check()[0] == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["link.vtk", "real.vtk"]


def test_new_file_obeys_the_umask(tmp_path: Path, plate: Mesh) -> None:
    document = read(save(tmp_path / "in.vtk", plate))
    old = os.umask(0o027)
    try:
        write(document, document.mesh, tmp_path / "out.vtk")
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "out.vtk").stat().st_mode) == 0o640


@pytest.mark.parametrize("fault", ["writer", "disk"])
def test_a_failed_write_leaves_the_original(
    tmp_path: Path, plate: Mesh, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = save(tmp_path / "in.post", plate)
    original = path.read_bytes()
    document = read(path)

    def broken(*args: object, **kwargs: object) -> None:
        raise OSError(28, "No space left on device") if fault == "disk" else ValueError("bad")

    monkeypatch.setattr(meshio, "write", broken)
    with pytest.raises(
        WriteError, match="No space left" if fault == "disk" else r"cannot be written as permas \(meshio's writer"
    ):
        write(document, tangle(document.mesh), path)
    assert path.read_bytes() == original
    assert [p.name for p in tmp_path.iterdir()] == ["in.post"]


def test_errors_carry_the_name_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "bad.vtk"
    meshio.Mesh([[0.0, 0, 0], [1, 0, 0], [0, 1, np.nan]], [("triangle", [[0, 1, 2]])]).write(path)
    with pytest.raises(InvalidMeshError, match=r"bad\.vtk: vertex 2 has a coordinate that is not finite"):
        read(path)
