"""Meshes of OpenFOAM: all elements out of their faces, zones, patches, folders; VTK's reader is the oracle."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest
from commands import run
from elements import MESHES
from files_medit import material
from files_openfoam import faces_of, header, labels, read_independently, write
from shapes import block

from meshfix_cli import read, untangle
from meshfix_cli import write as write_mesh
from meshfix_cli.errors import MeshfixError, ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.meshfile.faces import Faces
from meshfix_cli.meshfile.openfoam.lists import File

SOLID = [name for name, make in MESHES.items() if make()[0].shape[1] == 3]
FORMS = {
    "text": {},
    "binary": {"binary": True},
    "single": {"binary": True, "scalar": 32},
    "packed": {"packed": True},
    "packed binary": {"binary": True, "packed": True},
}
forms = pytest.mark.parametrize("form", FORMS)


def tangled(folder: Path, form: str) -> Path:
    points, cells = block()
    rotor = np.flatnonzero(material(points, cells) == 1)
    return write(folder, points, [("tetra", cells)], rotor=rotor, **FORMS[form])  # type: ignore[arg-type]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("name", SOLID)
@pytest.mark.parametrize("binary", [False, True])
def test_elements_of_every_type_are_found_in_their_faces(name: str, binary: bool, tmp_path: Path) -> None:
    points, blocks = MESHES[name]()
    document = read(write(tmp_path / "case", points, blocks, binary=binary))
    mesh, expected = document.mesh, Mesh.build(points, blocks)
    assert not document.not_judged
    assert mesh.check()[0] == expected.check()[0] == 0
    assert not mesh.topology.flipped.any()
    starts = np.cumsum([0, *(len(rows) for _, rows in blocks)])
    for run_ in document.source.cells:
        if ELEMENTS[run_.type].shape.dimension == 3 and run_.ids is not None:
            for number, row in zip(run_.ids.tolist(), run_.vertices.tolist(), strict=True):
                at = int(np.searchsorted(starts, number, side="right")) - 1
                key, rows = blocks[at]
                assert run_.type == key
                assert sorted(row) == sorted(rows[number - starts[at]].tolist())


@pytest.mark.parametrize("name", SOLID[:4])
def test_vtk_finds_the_same_cells(name: str, tmp_path: Path) -> None:
    points, blocks = MESHES[name]()
    folder = write(tmp_path / "case", points, blocks)
    document, (theirs, others) = read(folder), read_independently(folder)
    np.testing.assert_allclose(document.source.points, theirs, atol=1e-6)  # which VTK keeps in single precision
    vtk = {ELEMENTS[one.type].vtk: one for one in document.source.cells if one.ids is not None}
    for number, (kind, *vertices) in enumerate(others["cells"]):
        mine = vtk[kind]
        assert mine.ids is not None
        assert sorted(mine.vertices[mine.ids.tolist().index(number)].tolist()) == sorted(vertices)


@forms
def test_only_the_points_change(form: str, tmp_path: Path) -> None:
    folder, target = tangled(tmp_path / "case", form), tmp_path / "out"
    run("untangle", "-q", folder, target)
    before, after = contents(folder / "constant"), contents(target / "constant")
    changed = [name for name in before if before[name] != after[name]]
    assert before.keys() == after.keys()
    assert changed == ["polyMesh/points.gz" if "packed" in form else "polyMesh/points"]
    old, new = before[changed[0]], after[changed[0]]
    if "packed" in form:
        old, new = gzip.decompress(old), gzip.decompress(new)
    assert len(old.split(b"\n(", 1)[0]) == len(new.split(b"\n(", 1)[0])
    assert old[-80:] == new[-80:]
    document, back = read(folder), read(target)
    moved = (back.source.points != document.source.points).any(axis=1)
    assert 0 < moved.sum() < document.mesh.movable.sum() + 1
    assert not moved[~document.mesh.movable].any()
    assert back.mesh.check()[0] == 0 < document.mesh.check()[0]


def test_vtk_reads_what_was_written(tmp_path: Path) -> None:
    folder = tangled(tmp_path / "case", "text")
    document = read(folder)
    points = document.file_points(untangle(document.mesh).after)
    run("untangle", "-q", folder / "case.foam", tmp_path / "out" / "case.foam", code=1)  # there is no such folder
    (tmp_path / "out").mkdir()
    run("untangle", "-q", folder / "case.foam", tmp_path / "out" / "case.foam")
    theirs, _ = read_independently(tmp_path / "out")
    np.testing.assert_allclose(points, theirs, atol=1e-6)


@forms
def test_what_did_not_move_is_as_it_was(form: str, tmp_path: Path) -> None:
    folder = tangled(tmp_path / "case", form)
    document = read(folder)
    write_mesh(document, document.mesh, tmp_path / "out")
    assert contents(folder / "constant") == contents(tmp_path / "out" / "constant")


@pytest.mark.parametrize("named", [".", "constant", "constant/polyMesh", "case.foam", "constant/polyMesh/points"])
def test_in_place_only_the_points_are_replaced(named: str, tmp_path: Path) -> None:
    folder = tangled(tmp_path / "case", "text")
    before = contents(folder)
    run("untangle", "-q", folder / named, folder / named)
    after = contents(folder)
    assert [name for name in before if before[name] != after[name]] == ["constant/polyMesh/points"]
    assert before.keys() == after.keys()


def test_zones_are_regions_and_patches_are_groups(tmp_path: Path) -> None:
    points, cells = block()
    document = read(write(tmp_path / "case", points, [("tetra", cells)]))
    assert document.fixed["between regions of openfoam:zone"] > 0
    sets = document.source.arrays.cell_sets
    assert list(sets) == ["rotor", "stator", "inlet", "outer wall", "baffle"]
    assert document.source.arrays.point_sets["probes"].tolist() == [3]
    count = sum(map(len, sets["rotor"]))
    assert count == len(cells) // 2


def test_polyhedra_are_held_and_named(tmp_path: Path) -> None:
    """A cube beside two that share its side: its six faces are seven, and it is no hexahedron."""
    points = np.array([(x, y, z) for x in (0.0, 1.0, 2.0) for y in (0.0, 1.0) for z in (0.0, 0.5, 1.0)])

    def corners(x: int, low: int, high: int) -> list[int]:
        return [6 * (x + i) + 3 * j + k for k in (low, high) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]

    two = np.array([corners(1, 0, 1), corners(1, 1, 2)])
    folder = write(tmp_path / "case", points, [("hexahedron", np.array([corners(0, 0, 2), *two]))])
    there = folder / "constant" / "polyMesh"
    faces, owner, neighbour = [], [], []
    whole = corners(0, 0, 2)
    middle = {6, 7, 8, 9, 10, 11}
    for cell, row in enumerate(two.tolist(), start=1):
        for facet in ELEMENTS["hexahedron"].shape.facets:
            loop = [row[node] for node in facet]
            if set(loop) <= middle:
                faces.append(loop[::-1])
                owner.append(0)
                neighbour.append(cell)
    shared = [two.tolist()[0][node] for node in (4, 5, 6, 7)]
    faces.append(shared)
    owner.append(1)
    neighbour.append(2)
    for cell, row in ((0, whole), (1, two.tolist()[0]), (2, two.tolist()[1])):
        for facet in ELEMENTS["hexahedron"].shape.facets:
            loop = [row[node] for node in facet]
            if not set(loop) <= middle and set(loop) != set(shared):
                if cell == 0 and len(set(loop) & middle) == 2 and {6, 8} <= set(loop):
                    loop.insert(loop.index(8) if loop.index(8) > loop.index(6) else loop.index(6), 7)
                faces.append(loop)
                owner.append(cell)
        text = "".join(f"{len(face)}({' '.join(map(str, face))})\n" for face in faces)
    (there / "faces").write_text(header("faceList", "faces") + f"{len(faces)}\n(\n{text})\n")
    (there / "owner").write_bytes(header("labelList", "owner").encode() + labels(owner))
    (there / "neighbour").write_bytes(header("labelList", "neighbour").encode() + labels(neighbour))
    for name in ("boundary", "cellZones", "faceZones", "pointZones"):
        (there / name).unlink()
    document = read(folder)
    assert document.not_judged == {"polyhedron": 1}
    assert document.mesh.topology.m == 2
    assert document.mesh.check()[0] == 0


def test_comments_may_stand_in_lists(tmp_path: Path) -> None:
    """They are no numbers, and stay where they were."""
    folder = tangled(tmp_path / "case", "text")
    expected, there = read(folder).source, folder / "constant" / "polyMesh"
    for path in there.iterdir():
        at = path.read_bytes().rindex(b"(\n") + 2
        path.write_bytes(path.read_bytes()[:at] + b"// 7 (\n/* 3(0 1 2)\n*/" + path.read_bytes()[at:])
    found = read(folder).source
    assert found.points.tobytes() == expected.points.tobytes()
    for one, other in zip(found.cells, expected.cells, strict=True):
        np.testing.assert_array_equal(one.vertices, other.vertices)
    assert found.arrays.point_sets["probes"].tolist() == [3]
    run("untangle", "-q", folder, tmp_path / "out")
    assert b"// 7 (\n/* 3(0 1 2)\n*/" in (tmp_path / "out" / "constant" / "polyMesh" / "points").read_bytes()


@pytest.mark.parametrize("name", SOLID)
def test_numbers_of_32_and_of_64_bits_make_the_same_cells(name: str) -> None:
    faces, owner, neighbour = faces_of(MESHES[name]()[1])
    lists = [
        np.cumsum([0, *map(len, faces)]),
        np.concatenate(faces),
        owner,
        neighbour + [-1] * (len(faces) - len(neighbour)),
    ]
    one, other = (Faces._make(np.array(values, dtype=kind) for values in lists) for kind in ("i4", "i8"))
    for (key, vertices, cells), (kind, nodes, ids) in zip(one.elements(), other.elements(), strict=True):
        assert (key, vertices.dtype, nodes.dtype) == (kind, np.int32, np.int64)
        np.testing.assert_array_equal(vertices, nodes)
        np.testing.assert_array_equal(cells, ids)


def test_points_of_later_times_are_told(tmp_path: Path) -> None:
    folder = tangled(tmp_path / "case", "text")
    assert read(folder).notes == ()
    for time, name in (("0.5", "points"), ("0.25", "points.gz"), ("old", "points")):
        (folder / time / "polyMesh").mkdir(parents=True)
        (folder / time / "polyMesh" / name).touch()
    assert "as in 0.5/polyMesh" in " ".join(read(folder).notes)


def test_a_mesh_of_openfoam_becomes_another_file(tmp_path: Path) -> None:
    folder = tangled(tmp_path / "case", "text")
    run("untangle", "-q", folder, tmp_path / "out.vtk")
    assert read(tmp_path / "out.vtk").mesh.check()[0] == 0
    assert run("untangle", "-q", folder, "-", code=1).stdout == b""


def test_the_report_on_a_case_that_becomes_another_is_on_stdout(tmp_path: Path) -> None:
    folder = tangled(tmp_path / "case", "text")
    for _ in range(2):  # the second time the folder is there
        done = run("untangle", folder, tmp_path / "out")
        assert b"valid: no element is inverted" in done.stdout and done.stderr == b""


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    folder = tangled(tmp_path / "case", "text")
    there = folder / "constant" / "polyMesh"
    with pytest.raises(ReadError, match="holds no mesh"):
        read(tmp_path)
    with pytest.raises(ReadError, match="name the folder"):
        read_stream(there / "points")
    wrong = {
        "points": (b".0", b".x"), "faces": (b"3(", b"3(999"), "owner": (b"\n0\n", b"\n-7\n"),
        "neighbour": (b"\n575\n", b"\n99999\n"), "cellZones": (b"\n561\n", b"\n99999\n"),
    }  # fmt: skip
    for name, change in wrong.items():
        data = (there / name).read_bytes()
        begin = data.index(b"}\n// ") + 90
        for cut in (0, 100, *range(begin, len(data) - 90, max(1, (len(data) - begin) // 15))):
            (there / name).write_bytes(data[:cut])
            with pytest.raises(MeshfixError):
                read(folder)
        assert change[0] in data, name
        (there / name).write_bytes(data.replace(*change))
        with pytest.raises(MeshfixError):
            read(folder)
        (there / name).write_bytes(data)
    (there / "owner").unlink()
    with pytest.raises(ReadError, match="there is no file owner"):
        read(folder)


@pytest.mark.parametrize("sizes", ["label=40;scalar=64", "label=0;scalar=64", "label=32;scalar=128"])
def test_numbers_have_32_or_64_bits(sizes: str) -> None:
    header = f'FoamFile\n{{\n    format binary;\n    arch "LSB;{sizes}";\n    class labelList;\n}}\n'
    with pytest.raises(ReadError, match="bits, and 32 or 64 are read"):
        File.of(header.encode())


def read_stream(path: Path) -> None:
    from meshfix_cli.meshfile.reading import parse
    from meshfix_cli.meshfile.recognise import Format

    parse(path.read_bytes(), Format("openfoam"))


@pytest.mark.parametrize("kind", ["cyclic", "processor", "wedge", "empty", "wall"])
def test_points_of_patches_that_are_paired_do_not_slide(kind: str, tmp_path: Path) -> None:
    folder = tangled(tmp_path / "case", "text")
    boundary = folder / "constant" / "polyMesh" / "boundary"
    boundary.write_text(boundary.read_text().replace("type            patch", f"type            {kind}"))
    document = read(folder)
    (inlet,) = [
        np.unique(run.vertices[rows])
        for run, rows in zip(document.source.cells, document.source.arrays.cell_sets["inlet"], strict=True)
        if len(rows)
    ]
    result = untangle(document, slide="flat", smooth="best")
    notes = [note for note in result.report.notes if "periodic" in note]
    moved = (result.points != document.source.points).any(axis=1)
    if kind == "wall":
        assert document.source.held is None
        assert moved[inlet].any()
        assert not notes
    else:
        assert document.source.held is not None
        assert set(np.flatnonzero(document.source.held)) == set(inlet)
        assert not moved[inlet].any()
        assert len(notes) == 1
