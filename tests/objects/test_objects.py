"""Meshes of other libraries in, and of the same kind out: what comes back is what the command line writes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import elements
import generate
import meshio
import numpy as np
import pytest
from meshes import tangle
from places import SAMPLES

import meshfix_cli
from meshfix_cli import InvalidMeshError, Mesh, MeshfixError, OptionError, Repairer, perturb, quality, read, untangle
from meshfix_cli.objects import kinds

pyvista = pytest.importorskip("pyvista")
vtk = pytest.importorskip("vtkmodules.vtkIOLegacy")

TETS, SHELL = SAMPLES / "bracket_tangled.vtk", SAMPLES / "shell_tangled.obj"


def hexes(path: Path) -> Path:
    """Tangled hexahedra with data, a material, and a set."""
    mesh = Mesh.build(*elements.box_of_hexahedra(200))
    cells = [(block.element.key, block.vertices) for block in mesh.topology.blocks]
    material = [(mesh.points[rows].mean(axis=1)[:, 0] > 0.5).astype(int) for _, rows in cells]
    data = {"temperature": np.arange(len(mesh.points)) / 7}
    valid = meshio.Mesh(mesh.points, cells, data, {"material": material})
    perturb(valid, 25, "1h").mesh.write(path)
    return path


def in_vtk(path: Path) -> Any:
    reader = vtk.vtkUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def pair(path: Path) -> Any:
    mesh = meshio.read(path)
    return mesh.points, mesh.cells_dict


def points_of(mesh: Any) -> Any:
    if hasattr(mesh, "GetPoints"):
        return pyvista.wrap(mesh).points
    return mesh[0] if isinstance(mesh, tuple) else mesh.points


MAKERS: dict[str, Callable[[Path], Any]] = {
    "meshio": meshio.read, "pyvista": pyvista.read, "vtk": in_vtk, "pair": pair,
}  # fmt: skip


@pytest.mark.parametrize("kind", MAKERS)
def test_tetrahedra_come_back_as_the_command_line_writes_them(kind: str, tmp_path: Path) -> None:
    given = MAKERS[kind](TETS)
    before = np.array(points_of(given))
    result = untangle(given)
    assert result.valid and type(result.mesh) is type(given)
    np.testing.assert_array_equal(points_of(given), before)
    subprocess.run([sys.executable, "-m", "meshfix_cli", "untangle", "-q", TETS, tmp_path / "out.vtk"], check=True)
    np.testing.assert_array_equal(points_of(result.mesh), meshio.read(tmp_path / "out.vtk").points)
    assert quality(result.mesh).inverted == 0 and quality(given).inverted == 700


@pytest.mark.parametrize("kind", ["meshio", "pyvista"])
def test_data_are_kept_and_interfaces_held(kind: str, tmp_path: Path) -> None:
    given = MAKERS[kind](hexes(tmp_path / "hexes.vtu"))
    result = untangle(given, smooth="best")
    assert result.valid and "between regions of material" in result.document.fixed
    out = result.mesh
    if kind == "meshio":
        np.testing.assert_array_equal(out.point_data["temperature"], given.point_data["temperature"])
        np.testing.assert_array_equal(out.cell_data["material"][0], given.cell_data["material"][0])
        np.testing.assert_array_equal(out.cells[0].data, given.cells[0].data)
    else:
        np.testing.assert_array_equal(out["temperature"], given["temperature"])
        np.testing.assert_array_equal(out["material"], given["material"])
        np.testing.assert_array_equal(out.cells, given.cells)
    free = untangle(given, regions="none").document.fixed
    assert "between regions of material" not in free


def test_single_precision_stays() -> None:
    mesh = meshio.read(TETS)
    points = mesh.points.astype("f4")
    result = untangle((points, mesh.cells_dict["tetra"]))
    assert result.mesh[0].dtype == np.float32 and result.valid
    grid = pyvista.read(TETS)
    grid.points = points
    np.testing.assert_array_equal(untangle(grid).mesh.points, result.mesh[0])


def test_surfaces_come_back_as_polygons() -> None:
    given = pyvista.read(SHELL)
    result = untangle(given)
    assert result.valid and isinstance(result.mesh, pyvista.PolyData)
    assert any("Hausdorff distance" in note for note in result.notes)
    np.testing.assert_array_equal(result.mesh.faces, given.faces)


def test_polygons_strips_and_lines_are_cells_of_vtk() -> None:
    """In the order in which VTK numbers them, which the data have."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0.0]])
    grid = pyvista.PolyData(points, faces=[3, 0, 1, 2, 3, 0, 2, 3, 4, 1, 4, 5, 2], lines=[2, 0, 1])
    grid.cell_data["number"] = np.arange(4)
    source = kinds.kind_of(grid).source(grid)
    assert [run.type for run in source.cells] == ["line", "triangle", "quad"]
    assert [values.tolist() for values in source.arrays.cell["number"]] == [[0], [1, 2], [3]]
    assert quality(grid).elements == 3


def test_voxels_come_back_as_voxels() -> None:
    grid = pyvista.ImageData(dimensions=(6, 6, 6)).cast_to_unstructured_grid()
    tangled = perturb(grid, 25, "1h")
    assert not tangled.valid and tangled.mesh.n_cells == 125
    result = untangle(tangled.mesh)
    assert result.valid and set(result.mesh.celltypes) == set(grid.celltypes)


@pytest.mark.parametrize("cells", [
    lambda rows: rows, lambda rows: {"triangle": rows}, lambda rows: {5: rows}, lambda rows: [("triangle", rows)],
])  # fmt: skip
def test_cells_are_an_array_or_arrays_by_their_types(cells: Callable[[Any], Any]) -> None:
    mesh = tangle(Mesh.build(*generate.plate(0.2)))
    given = cells(mesh.topology.simplices)
    result = untangle((mesh.points, given))
    assert result.valid and result.mesh[1] is given
    np.testing.assert_array_equal(result.mesh[0], untangle(mesh).after.points)


def test_paths_and_documents_are_written_in_their_format(tmp_path: Path) -> None:
    result = untangle(str(TETS))
    assert isinstance(result.mesh, Mesh)
    assert result.write(tmp_path / "out.vtk") == ()
    again = untangle(read(TETS))
    np.testing.assert_array_equal(again.mesh.points, read(tmp_path / "out.vtk").mesh.points)
    assert untangle(meshio.read(TETS)).write(tmp_path / "other.vtu") == ()
    np.testing.assert_array_equal(meshio.read(tmp_path / "other.vtu").points, again.mesh.points)


def test_options_are_those_of_the_command_line(tmp_path: Path) -> None:
    words = ["--strategy", "LUS", "--smooth", "1", "--max-move", "0.8h", "--slide", "flat"]
    subprocess.run([sys.executable, "-m", "meshfix_cli", "untangle", "-q", "--allow-inverted", TETS, "-o",
                    tmp_path / "out.vtk", *words], check=True)  # fmt: skip
    result = untangle(meshio.read(TETS), "LUS", smooth=1, max_move="0.8h", slide="flat")
    np.testing.assert_array_equal(result.points, meshio.read(tmp_path / "out.vtk").points)


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "unknown": ({"smoth": 3}, "there is no option 'smoth': did you mean 'smooth'?"),
    "unlike all": ({"xyz": 3}, "there is no option 'xyz'; there are .*smooth.*threads"),
    "strategy": ({"strategy": "XX"}, "strategy is one of auto, LS, US"),
    "smooth": ({"smooth": "worst"}, "from 0 to 1,000,000, or 'auto', or 'best', and not 'worst'"),
    "sweeps": ({"sweeps": 1.5}, "sweeps is a whole number from 0 on"),
    "threads": ({"threads": 0}, "threads is a whole number from 1 to 1,024, and not 0"),
    "threshold": ({"threshold": float("nan")}, "threshold is a number from 0 to 90, and not nan"),
    "length": ({"max_move": "2k"}, "max_move is neither a length"),
    "flag": ({"only_invalid": 1}, "only_invalid is True or False"),
    "metric": ({"metrics": "beauty"}, "metrics is one of"),
    "require": ({"require": "min_angle > much"}, "require: 'much' is not a number"),
    "invalid and displaced": ({"only_invalid": True, "displace": "u"}, "displace and only_invalid exclude each other"),
    "threshold and reference": ({"threshold": 9, "reference": TETS}, "reference and threshold exclude each other"),
    "not a name": ({"fix": [1, 2]}, "fix is a text, or several, and no numbers, which `fixed` takes"),
    "not a name of an array": ({"displace": np.zeros(3)}, "displace is the name of an array, and not the array itself"),
    "regions": ({"regions": 3}, "regions is the name of an array"),
    "flag of points": ({"join_points": "no"}, "join_points is True or False"),
    "fixed": ({"fixed": [2000]}, "meshio.Mesh: fixed names vertex 2000, and there are those from 0 to 1862"),
    "fixed by numbers": ({"fixed": [0.5]}, r"fixed is an array of shape \(1,\) and type float64, and neither a mask"),
    "fix": ({"fix": "wall"}, "meshio.Mesh: there is no point data, set or group named 'wall'"),
    "displace": ({"displace": "u"}, "meshio.Mesh: there is no point data named 'u'"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_is_one_sentence(case: str) -> None:
    options, words = WRONG[case]
    with pytest.raises(MeshfixError, match=words) as caught:
        untangle(meshio.read(TETS), **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("given", "words"), [
    (3, "builtins.int is no mesh that meshfix knows"),
    (pyvista.ImageData(dimensions=(3, 3, 3)), "cast_to_unstructured_grid"),
    ((np.zeros((4, 3)), np.array([[0, 1]])), r"an array of shape \(1, 2\); known are"),
    ((np.zeros((4, 3)), np.array([[0.5, 1, 2, 3]])), "not an array"),
    ((np.zeros(4), np.array([[0, 1, 2, 3]])), r"of \(n, 2\) or \(n, 3\) numbers"),
    ((np.zeros((4, 3)), np.array([[0, 1, 2, 9]])), r"\(points, cells\): "),
    (pyvista.UnstructuredGrid(), "pyvista.UnstructuredGrid: "),
    ("nowhere.vtk", "nowhere.vtk: No such file"),
])  # fmt: skip
def test_what_is_no_mesh_is_one_sentence(given: Any, words: str) -> None:
    for ask in (untangle, quality, Repairer):
        with pytest.raises(MeshfixError, match=words):
            ask(given)


def test_a_bare_mesh_has_no_names() -> None:
    mesh = Mesh.build(*generate.plate(0.3))
    for options in ({"slide": "flat"}, {"fix": "a"}, {"require": "min_angle > 1"}):
        with pytest.raises(OptionError, match="give the document"):
            untangle(mesh, **options)  # type: ignore[call-overload]


def test_what_a_document_holds_is_told_where_it_is_read() -> None:
    document = read(TETS, fixed=[3])
    for options in ({"fix": "a"}, {"fixed": [3]}, {"regions": "none"}, {"join_points": True}):
        with pytest.raises(OptionError, match="give fix, fixed, regions and join_points to `read`"):
            untangle(document, **options)


@pytest.mark.parametrize("kind", [*MAKERS, "path", "Mesh"])
def test_vertices_are_held_by_a_mask_or_by_their_indices(kind: str) -> None:
    given = TETS if kind == "path" else read(TETS).mesh if kind == "Mesh" else MAKERS[kind](TETS)
    before = read(TETS).mesh
    indices = np.flatnonzero(before.movable)[5:900:100]
    mask = np.isin(np.arange(len(before.points)), indices)
    for fixed in (indices, indices.tolist(), mask, [*indices, indices[0]]):
        result = untangle(given, fixed=fixed)
        after = result.after.points
        np.testing.assert_array_equal(after[indices], before.points[indices])
        assert (after != before.points).any(axis=1).sum() > 100
        if kind != "Mesh":
            assert result.document.fixed["by fixed"] == len(indices)
    moved = perturb(given, 100, "h", fixed=indices)
    points = moved[0].points if isinstance(moved, tuple) else moved.points
    np.testing.assert_array_equal(points[indices], before.points[indices])


def test_vertices_that_are_held_do_not_slide() -> None:
    shell = pyvista.read(SHELL)
    which = np.flatnonzero(read(SHELL).mesh.movable)[::7]
    for slide in ("none", "curved"):
        after = untangle(shell, fixed=which, slide=slide).mesh.points
        np.testing.assert_array_equal(after[which], shell.points[which])


def test_a_repairer_of_a_bare_mesh_holds_what_that_holds() -> None:
    mesh = Mesh.build(*generate.plate(0.2), fixed=[150, 151])
    repair = Repairer(mesh, fixed=[152])
    points = repair(perturb(mesh, 25, "h", fixed=[152])[0].points)
    assert repair.outcome is not None and repair.outcome.valid
    np.testing.assert_array_equal(points[150:153], mesh.points[150:153])


class Pair(NamedTuple):
    """What a user calls points and cells."""

    points: Any
    cells: Any


def test_a_named_pair_comes_back_as_one() -> None:
    points, triangles = generate.plate(0.3)
    result = untangle(Pair(points, triangles)).mesh
    assert isinstance(result, Pair)
    assert result.cells is triangles


def test_the_reference_of_a_bare_mesh_is_of_any_kind() -> None:
    points, triangles = generate.plate(0.3)
    mesh = Mesh.build(points, triangles)
    moved = mesh.with_points(points * [1.0, 2.0])
    expected = untangle(moved, reference=mesh).after.points
    np.testing.assert_array_equal(untangle(moved, reference=(points, triangles)).after.points, expected)
    with pytest.raises(MeshfixError, match="114 triangles, and the mesh"):
        untangle(moved, reference=(points, triangles[1:]))


def morph(mesh: Any) -> Any:
    """Bend a bracket by vectors of its points."""
    there = np.zeros_like(mesh.points)
    there[:, 2] = 0.8 * np.sin(2 * mesh.points[:, 0])
    return there


def test_a_displacement_comes_first_and_the_mesh_is_the_reference(tmp_path: Path) -> None:
    mesh = meshio.read(SAMPLES / "bracket.vtk")
    moves = np.random.default_rng(1).standard_normal(mesh.points.shape) * 0.1
    moves[~read(SAMPLES / "bracket.vtk").mesh.movable] = morph(mesh)[~read(SAMPLES / "bracket.vtk").mesh.movable]
    mesh.point_data["u"] = moves
    result = untangle(mesh, displace="u")
    moved = meshio.Mesh(mesh.points + moves, mesh.cells)
    expected = untangle(moved, reference=meshio.Mesh(mesh.points, mesh.cells))
    assert result.records[0].inverted == expected.records[0].inverted > 0 and result.valid
    np.testing.assert_allclose(result.points, expected.points, atol=1e-6)  # vertices have another order
    path = tmp_path / "morph.vtu"
    mesh.write(path)
    out = tmp_path / "out.vtu"
    subprocess.run([sys.executable, "-m", "meshfix_cli", "untangle", "-q", path, out, "--displace", "u"], check=True)
    np.testing.assert_array_equal(meshio.read(out).points, result.points)


def test_a_plane_mesh_is_not_displaced_out_of_its_plane() -> None:
    mesh = Mesh.build(*generate.plate(0.2))
    flat = np.column_stack([mesh.points, np.zeros(len(mesh.points))])
    here = meshio.Mesh(flat, [("triangle", mesh.topology.simplices)], {"u": np.ones_like(flat)})
    with pytest.raises(MeshfixError, match="u moves points out of the plane"):
        untangle(here, displace="u")
    here.point_data["u"] = np.ones_like(flat) * [1, 2, 0]
    np.testing.assert_array_equal(untangle(here, displace="u").points, flat + np.array([1, 2, 0]))
    here.point_data["u"] = here.point_data["u"][:, :2].copy()
    np.testing.assert_array_equal(untangle(here, displace="u").points, flat + np.array([1, 2, 0]))
    here.point_data["u"] = np.ones(len(flat))
    with pytest.raises(
        MeshfixError, match="the point data 'u' are no vectors, 2 or 3 numbers for each point: there are 1"
    ):
        untangle(here, displace="u")


def test_all_public_names_are_among_those_that_a_shell_completes() -> None:
    assert {*meshfix_cli.__all__} <= {*dir(meshfix_cli)}


def test_a_repairer_builds_the_mesh_once(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = meshio.read(SAMPLES / "bracket.vtk")
    tangled = [perturb(mesh, 25, "2h", seed).points for seed in (0, 1, 0)]
    repair = Repairer(mesh)
    boundary = ~repair._document.mesh.movable
    monkeypatch.setattr(Mesh, "build", None)
    repaired = []
    for points in tangled:
        repaired.append(repair(points))
        assert repair.outcome is not None and repair.outcome.valid and repair.outcome.records[0].inverted > 0
        np.testing.assert_array_equal(repaired[-1][boundary], mesh.points[boundary])
    np.testing.assert_array_equal(repaired[0], repaired[2])
    np.testing.assert_array_equal(repair(mesh.points), mesh.points)
    with pytest.raises(MeshfixError, match="towards and threshold exclude each other"):
        Repairer(mesh, towards=True, threshold=20)
    with pytest.raises(MeshfixError, match="those of the mesh"):
        repair(mesh.points[1:])
    with pytest.raises(MeshfixError, match="not finite"):
        repair(mesh.points * np.nan)
    for no_numbers in (mesh.points.astype(str), [[0.0, 1.0], [0.0]], mesh.points * 1j):
        with pytest.raises(MeshfixError, match="the points are"):
            repair(no_numbers)


def test_a_repairer_gives_elements_their_shapes_back() -> None:
    mesh = meshio.read(SAMPLES / "bracket.vtk")
    repair = Repairer(mesh, towards=True)
    boundary = ~repair._document.mesh.movable
    moved = np.where(boundary[:, None], mesh.points + 2 * morph(mesh), mesh.points)
    points, expected = repair(moved), untangle(meshio.Mesh(moved, mesh.cells), reference=mesh)
    assert repair.outcome is not None and repair.outcome.records[0].inverted > 0 and repair.outcome.valid
    np.testing.assert_allclose(points, expected.points, atol=1e-6)


def test_what_is_not_judged_is_never_called_valid() -> None:
    """Also by a repairer, whose outcome is that of the elements that are judged."""
    cells = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7], [4, 4, 7, 7]])
    points = np.array([(x, y) for y in range(3) for x in range(3)], dtype=np.float64)
    result, repair = untangle((points, {"quad": cells})), Repairer((points, {"quad": cells}))
    repair(points)
    assert repair.outcome is not None
    assert (result.valid, repair.outcome.valid) == (False, False)
    told = "0 of 4 elements inverted (0 before), 1 collapsed quadrilateral not judged, smallest scaled Jacobian 1"
    assert repr(result) == f"<Result (points, cells): {told}>"
    repair = Repairer((points, {"quad": cells[:4]}))
    repair(points)
    assert repair.outcome is not None and repair.outcome.valid


@pytest.mark.parametrize(
    "given", [None, "x", np.full((9, 2), "x"), np.zeros((9, 2), complex), [[1.0, 2.0], [1.0]], np.zeros((9, 3)), 1.0]
)
def test_a_repairer_takes_points_only(given: Any) -> None:
    points = np.array([(x, y) for y in range(3) for x in range(3)], dtype=np.float64)
    repair = Repairer((points, {"quad": np.array([[0, 1, 4, 3], [1, 2, 5, 4]])}))
    with pytest.raises(InvalidMeshError, match=r"^the points are [^\n]*$"):
        repair(given)
    np.testing.assert_array_equal(repair(points.tolist()), points)


def test_what_a_notebook_shows() -> None:
    result = untangle(meshio.read(TETS))
    assert repr(result) == "<Result meshio.Mesh: 0 of 7,968 elements inverted (700 before), smallest angle 17.3>"
    html = result._repr_html_()
    assert html.startswith("<pre") and "inverted elements" in html and "valid: no element is inverted" in html


def test_the_package_is_typed_for_those_outside(tmp_path: Path) -> None:
    (tmp_path / "user.py").write_text(
        "import meshio\nimport numpy as np\nimport meshfix_cli\n"
        'mesh = meshfix_cli.read("a.vtk").mesh\n'
        'outcome = meshfix_cli.untangle(mesh, "FF", smooth="best")\nprint(outcome.untangled, outcome.valid)\n'
        'result = meshfix_cli.untangle((np.zeros((4, 3)), np.zeros((1, 4), int)), max_move="2h")\n'
        "points, cells = result.mesh\nreveal_type(points)\nprint(result.valid)\n"
        'print(meshfix_cli.quality(mesh).inverted, meshfix_cli.perturb(mesh, 25, "h")[1])\n'
        "reveal_type(meshfix_cli.Repairer(mesh)(points))\n"
        'meshfix_cli.untangle(mesh, smooth="worst")\n'
    )
    (tmp_path / "mypy.ini").write_text("[mypy]\nstrict = True\n[mypy-meshio.*]\nignore_missing_imports = True\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "user.py"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    lines = done.stdout.splitlines()
    assert [line.split(":")[1] for line in lines[:-1]] == ["9", "12", *["13"] * (len(lines) - 3)]
    assert "No overload variant" in lines[2] and "ndarray" in lines[0] and "ndarray" in lines[1]


def test_errors_are_exported() -> None:
    errors = [getattr(meshfix_cli, name) for name in meshfix_cli.__all__ if name.endswith("Error")]
    assert len(errors) == 6 and all(issubclass(one, MeshfixError) for one in errors)
