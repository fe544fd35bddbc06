"""Legacy .vtk files, against what VTK reads."""

from __future__ import annotations

import re
import struct
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_vtk import FILES, read_independently
from numpy.typing import NDArray
from places import SAMPLES

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.vtk import legacy as vtk

every = pytest.mark.parametrize("name", FILES)

POINTS = "0 0 0 1 0 0 1 1 0 0 1 0 .5 .25 0"
FAN = "3 0 1 4 3 1 2 4 3 2 3 4 3 3 0 4"


def text(body: str, kind: str = "POLYDATA", version: str = "3.0") -> bytes:
    return f"# vtk DataFile Version {version}\ntitle\nASCII\nDATASET {kind}\n{body}\n".encode()


def fan(data: str = "", kind: str = "double") -> bytes:
    """Four triangles around a point."""
    return text(f"POINTS 5 {kind}\n{POINTS}\nPOLYGONS 4 16\n{FAN}\n{data}")


def made(name: str, folder: Path) -> bytes:
    FILES[name](folder / name)
    return (folder / name).read_bytes()


def parsed(data: bytes) -> Source:
    source = vtk.parse(data)
    assert source is not None
    return source


def by_vtk(data: bytes, folder: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    (folder / "other.vtk").write_bytes(data)
    return read_independently(folder / "other.vtk")


def cells_of(others: dict[str, Any]) -> list[list[int]]:
    """Vertices of each cell as VTK finds them."""
    cells = []
    for key in ("cells", "Verts", "Lines", "Polys", "Strips"):
        if key in others:
            offsets, vertices = (numbers.ravel().astype(int).tolist() for numbers in others[key])
            cells += [vertices[a:b] for a, b in pairwise(offsets)]
    return cells


@every
def test_points_and_cells_are_those_of_vtk(name: str, tmp_path: Path) -> None:
    source = parsed(made(name, tmp_path))
    points, others = read_independently(tmp_path / name)
    assert source.points.dtype == (np.float32 if "float" in name or name == "old_20.vtk" else np.float64)
    np.testing.assert_array_equal(source.points, points)
    expected, found = cells_of(others), 0
    for run in source.cells:
        assert run.ids is not None
        for row, vertices in zip(run.ids, run.vertices, strict=True):
            assert set(vertices.tolist()) == set(expected[row])
            found += 1
    assert found == len(others["types"]) == len(expected)


@every
def test_arrays_are_those_of_vtk(name: str, tmp_path: Path) -> None:
    source = parsed(made(name, tmp_path))
    _, others = read_independently(tmp_path / name)
    order = np.argsort(np.concatenate([run.ids for run in source.cells if run.ids is not None]))
    found = {f"Point {key}": values for key, values in source.arrays.point.items()}
    found |= {f"Cell {key}": np.concatenate(runs)[order] for key, runs in source.arrays.cell.items()}
    numeric = {key for key, value in others.items() if key[:5] in ("Point", "Cell ") and value[0] != "vtkStringArray"}
    assert found.keys() == numeric
    for key, values in found.items():
        expected = others[key][2]
        if key == "Point colour":  # which VTK turns into bytes
            values = (255 * values + 0.5).astype(int)
        np.testing.assert_array_equal(values.reshape(expected.shape), expected)


@every
def test_a_truncated_file_is_refused(name: str, tmp_path: Path) -> None:
    """Up to the data; there, what is found has the numbers of the whole file."""
    data = made(name, tmp_path)
    whole = parsed(data)
    mesh = re.search(rb"(?i)\n(cell|point)_data", data)
    assert mesh is not None
    blanks = [place.start() for place in re.finditer(rb"\s", data)]
    ends = blanks if b"\0" not in data else list(range(len(data)))
    refused = 0
    for end in ends[:: len(ends) // 150]:
        try:
            source = parsed(data[:end])
        except ReadError:
            refused += 1
            continue
        assert end > mesh.start() or re.match(
            rb"\s*(METADATA\s|LINES|POLYGONS|TRIANGLE_STRIPS|$)", data[end : mesh.start()]
        )
        for key, values in source.arrays.point.items():
            np.testing.assert_array_equal(values, whole.arrays.point[key])
        for key, runs in source.arrays.cell.items():
            np.testing.assert_array_equal(np.concatenate(runs), np.concatenate(whole.arrays.cell[key]))
    assert refused > 50


@every
def test_promoted(name: str, tmp_path: Path) -> None:
    data = made(name, tmp_path)
    result = vtk.promoted(data)
    assert vtk.promoted(result) == result
    if parsed(data).points.dtype == np.float64:
        assert result == data
        return
    assert parsed(result).points.dtype == np.float64
    if b"\0" not in data:
        assert result == re.sub(rb"(?i)(\npoints \d+ )float", rb"\1double", data)
    points, others = read_independently(tmp_path / name)
    after, others_after = by_vtk(result, tmp_path)
    np.testing.assert_equal(others_after, others)
    np.testing.assert_array_equal(after.astype(np.float32), points.astype(np.float32))


@every
def test_reversed_cells_are_read_back(name: str, tmp_path: Path) -> None:
    source = parsed(made(name, tmp_path))
    assert source.layout is not None
    runs = [i for i, run in enumerate(source.cells) if run.type in ("triangle", "tetra") and len(run.vertices) > 2]
    rows = {runs[0]: np.array([2, 0]), runs[-1]: np.array([1])}
    result = source.layout.rewritten(source.points, source.points, turned(source.cells, rows))
    _, others = read_independently(tmp_path / name)
    _, others_after = by_vtk(result, tmp_path)
    expected, found = cells_of(others), cells_of(others_after)
    for run, here in rows.items():
        for row in np.asarray(source.cells[run].ids)[here]:
            expected[row][:2] = expected[row][1::-1]
    assert found == expected
    assert all(np.array_equal(others[key][2], others_after[key][2]) for key in others if key[:5] in ("Point", "Cell "))


@pytest.mark.parametrize("name", ["bracket.vtk", "bracket_tangled.vtk", "plate.vtk", "plate_tangled.vtk"])
def test_samples(name: str) -> None:
    data = (SAMPLES / name).read_bytes()
    counts = re.findall(rb"\n(?:POINTS|CELLS) (\d+)", data)
    source = parsed(data)
    assert [len(source.points), sum(len(run.vertices) for run in source.cells)] == list(map(int, counts))


def test_labels_of_materials_are_regions(tmp_path: Path) -> None:
    source = parsed(made("meshio_42.vtk", tmp_path))
    assert source.regions == ("gmsh:physical",)
    assert [set(np.ravel(runs).tolist()) for runs in source.arrays.cell["gmsh:physical"]] == [{1}, {2}]
    broken = fan("CELL_DATA 4\nSCALARS gmsh:physical int\nLOOKUP_TABLE default\n1 1 x 2")
    with pytest.raises(ReadError, match="gmsh:physical"):
        parsed(broken)


def test_arrays_that_cannot_be_read_are_named() -> None:
    data = fan("POINT_DATA 5\nSCALARS big vtktypeuint64 1\nLOOKUP_TABLE default\n1 2 3 4 18446744073709551615")
    arrays = parsed(data).arrays
    assert (arrays.point, arrays.unread) == ({}, ("point data big",))


def test_a_name_with_blanks_can_be_asked_for(tmp_path: Path) -> None:
    (tmp_path / "a.vtk").write_bytes(
        fan("POINT_DATA 5\nSCALARS do%20not%20move int 1\nLOOKUP_TABLE default\n0 0 0 0 1")
    )
    assert read(tmp_path / "a.vtk", fix="do not move").fixed == {"on the boundary": 4, "by --fix do not move": 1}


def test_polyhedra_have_the_vertices_of_their_faces() -> None:
    faces = "4 3 7 8 9 3 7 8 5 3 8 9 5 3 9 7 5"
    points = f"POINTS 10 float\n{POINTS} {POINTS}\n"
    old = text(f"{points}CELLS 2 23\n17 {faces} 4 0 1 2 4\nCELL_TYPES 2\n42 10", "UNSTRUCTURED_GRID")
    new = text(
        f"{points}CELLS 3 21\nOFFSETS long\n0 17 21\nCONNECTIVITY int\n{faces} 0 1 2 4\nCELL_TYPES 2\n42 10",
        "UNSTRUCTURED_GRID",
        "5.1",
    )
    for data in (old, new):
        polyhedra, tetrahedra = parsed(data).cells
        assert polyhedra.type == "polyhedron"
        assert dimension_of(polyhedra.type) == 3
        assert [sorted(set(vertices.tolist())) for vertices in polyhedra.vertices] == [[5, 7, 8, 9]]
        assert tetrahedra.vertices.tolist() == [[0, 1, 2, 4]]


@pytest.mark.parametrize("extra", ["", "2 0 1"], ids=["sizes by types", "sizes by the chain"])
def test_types_that_alternate(extra: str) -> None:
    """There is not a run for each cell, and the numbers are found where they stand."""
    cells = " ".join(["3 0 1 4 4 0 1 2 3"] * 2000) + f" {extra}"
    size, more = len(cells.split()), len(extra) // 5
    body = f"POINTS 5 double\n{POINTS}\nCELLS {4000 + more} {size}\n{cells}\nCELL_TYPES {4000 + more}\n"
    data = text(body + "5 9 " * 2000 + "4 " * more, "UNSTRUCTURED_GRID")
    source = parsed(data)
    assert {run.type: len(run.vertices) for run in source.cells} == {
        "triangle": 2000, "quad": 2000, **({"poly_line": 1} if more else {})
    }  # fmt: skip
    i, triangles = next((i, run) for i, run in enumerate(source.cells) if run.type == "triangle")
    assert (np.asarray(triangles.ids) % 2 == 0).all()
    assert (triangles.vertices == [0, 1, 4]).all()
    assert source.layout is not None
    result = source.layout.rewritten(source.points, source.points, turned(source.cells, {i: np.array([1])}))
    assert result == data.replace(b"3 0 1 4 4 0 1 2 3 3 0 1 4", b"3 0 1 4 4 0 1 2 3 3 1 0 4", 1)


def test_data_of_polydata_count_the_lines_first(tmp_path: Path) -> None:
    """As VTK does, wherever the section stands."""
    data = fan("LINES 1 3\n2 0 1\nCELL_DATA 5\nSCALARS s int\nLOOKUP_TABLE default\n10 20 30 40 50\n")
    source = parsed(data)
    assert [(run.type, np.asarray(run.ids).tolist()) for run in source.cells] == [
        ("line", [0]),
        ("triangle", [1, 2, 3, 4]),
    ]
    assert [runs.tolist() for runs in source.arrays.cell["s"]] == [[10], [20, 30, 40, 50]]
    assert cells_of(by_vtk(data, tmp_path)[1])[0] == [0, 1]


@pytest.mark.parametrize(
    "data",
    [
        fan(kind="int"),
        fan(kind="vtktypeint64"),
        fan().replace(b"3.0", b"6.0"),
    ],
    ids=["int", "int64", "version 6"],
)
def test_what_is_left_to_meshio(data: bytes) -> None:
    assert vtk.parse(data) is None
    assert vtk.promoted(data) == data


@pytest.mark.parametrize(
    ("rest", "found"),
    [
        ("SCALARS b int\nLOOKUP_TABLE default\n1 2 3 4 5\nHYPERTREE q 1\n1", {"a", "b"}),
        ("SCALARS b int\n1 2 3 4 5\n", {"a"}),
        ("SCALARS b quaternion\nLOOKUP_TABLE default\n1 2 3 4 5\n", {"a"}),
        ("FIELD f 2\nb 1 4 int 1 2 3 4 c 2 5 int 1 2 3 4 5 6 7 8 9 0", {"a", "c"}),
        ("FIELD f 2\nb 1 5 int 1 2 3 4 x c 1 5 char 1 2 3 4 -5", {"a", "c"}),
        ("FIELD f 2\nb 1 5 char 1 2 3 4 300 c 1 5 unsigned_char 1 2 3 4 255", {"a", "c"}),
        ("FIELD f 3\nNULL_ARRAY b 1 5 string\n1\n\n%20\n4\n5\nc 1 5 bit 1 0 1 0 1", {"a", "c"}),
        ("TENSORS6 b float\n" + "1 2 3 4 5 6 " * 5 + "EDGE_FLAGS c int 1 2 3 4 5", {"a", "b", "c"}),
        ("TEXTURE_COORDINATES b two float 1 2", {"a"}),
    ],
)
def test_odd_data_do_not_make_the_mesh_unreadable(rest: str, found: set[str]) -> None:
    source = parsed(fan(f"POINT_DATA 5\nSCALARS a float\nLOOKUP_TABLE default\n1 2 3 4 5\n{rest}"))
    assert source.arrays.point.keys() == found
    assert source.vertices_of("triangle", 3).tolist() == [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]


def test_metadata_may_end_with_the_file() -> None:
    data = "POINT_DATA 5\nSCALARS a float\nLOOKUP_TABLE default\n1 2 3 4 5\nMETADATA\nINFORMATION 0"
    assert parsed(fan(data)).arrays.point["a"].tolist() == [1, 2, 3, 4, 5]


def test_strings_in_binary_files() -> None:
    """Their lengths have one, two, four or eight bytes."""
    lengths = (b"\xc3", struct.pack(">H", 0x8003), struct.pack(">I", 0x40000003), struct.pack(">Q", 3))
    strings = b"".join(length + b"a\nb" for length in lengths)
    head = fan().split(b"POINTS", 1)[0].replace(b"ASCII", b"BINARY")
    points = np.array(POINTS.split(), dtype=">f4").tobytes()
    cells = np.array(FAN.split(), dtype=">i4").tobytes()
    data = (
        head + b"FIELD f 1\ns 1 4 string\n" + strings + b"\nPOINTS 5 float\n" + points + b"\nPOLYGONS 4 16\n" + cells
        + b"\nCELL_DATA 4\nSCALARS s vtkIdType\nLOOKUP_TABLE default\n" + struct.pack(">4i", 1, 2, 3, 4) + b"\n"
    )  # fmt: skip
    source = parsed(data)
    assert source.arrays.cell["s"][0].tolist() == [1, 2, 3, 4]
    assert source.untold == ("field data", "arrays of strings")


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"# vtk DataFile Version 3.0\ntitle\nASCII\n", "does not begin with"),
        (text("POINTS 5 double\n0 0 0 1"), "is truncated"),
        (text(f"POINTS 5 double\n{POINTS}"), "no cells in it"),
        (text("POLYGONS 1 4\n3 0 1 2"), "POINTS is missing"),
        (text(f"POINTS 5 double\n{POINTS}\nCELLS 1 4\n3 0 1 2", "UNSTRUCTURED_GRID"), "CELL_TYPES is missing"),
        (text(f"POINTS 5 double\n{POINTS}\nCELLS 1 4\n3 0 1 2\nCELL_TYPES 2\n5 5", "UNSTRUCTURED_GRID"), "do not"),
        (text(f"POINTS 5 double\n{POINTS}\nCELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n10", "UNSTRUCTURED_GRID"), "tetra with 3"),
        (fan().replace(b"4 16", b"4 12"), "'3' stands where a keyword"),
        (fan().replace(b"4 16", b"3 16"), "do not add up"),
        (fan().replace(b"4 16", b"99999999999999999 16"), "do not add up"),
        (fan().replace(b"4 16", b"4 99999999999999999"), "is truncated"),
        (fan().replace(b"POINTS 5", b"POINTS 999999999999999999"), "is truncated"),
        (fan().replace(b"POINTS 5", b"POINTS -5"), "'-5' is not a count"),
        (fan().replace(b"3 0 1 4", b"-1 0 1 4"), "do not add up"),
        (fan().replace(b".25", b"x"), "'x' is not a number"),
        (fan().replace(b"double", b"quaternion"), "'quaternion' is not a type"),
        (fan("POLYGONS 4 16\n" + FAN), "two sections POLYGONS"),
        (fan("POINT_DATA 5\nSCALARS a float\nLOOKUP_TABLE default\n1 2 3 4"), "is truncated"),
        (fan("POINT_DATA 5\nFIELD f 2\na 1 5 float\n1 2 3 4 5"), "is truncated"),
        (fan("SCALARS a float"), "'scalars' stands where a keyword"),
    ],
)  # fmt: skip
def test_malformed(data: bytes, reason: str) -> None:
    with pytest.raises(ReadError, match=re.escape(reason)):
        vtk.parse(data)


@pytest.mark.parametrize("offsets", ["0 3 6 9", "0 3 99 12", "-3 3 6 9 12", "0 6 3 9 12", "0 3 6 9 13"])
def test_offsets_that_do_not_fit(offsets: str) -> None:
    count = len(offsets.split())
    vertices = "0 1 4 1 2 4 2 3 4 3 0 4"
    body = (
        f"POINTS 5 double\n{POINTS}\nPOLYGONS {count} 12\nOFFSETS vtktypeint64\n{offsets}\nCONNECTIVITY vtktypeint64\n"
    )
    data = text(body + vertices, version="5.1")
    with pytest.raises(ReadError, match="offsets"):
        vtk.parse(data)
