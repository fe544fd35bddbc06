"""UCD files: dialects of their counts, types and orders of nodes, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from elements import MESHES
from files_avsucd import FILES
from files_medit import material, surface
from shapes import block, plate

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.avsucd import parse
from meshfix_cli.meshfile.solved import ids_of

SQUARE = b"""5 4 0 0 0
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
9 .5 .5 0
11 3 tri 1 2 9
12 3 tri 2 3 9
13 4 tri 3 4 9
14 -1 tri 4 1 9
"""
WORDS = {"tetra": "tet", "pyramid": "pyr", "wedge": "prism", "hexahedron": "hex"}


def by_vtk(path: Path) -> tuple[np.ndarray, list[list[int]]]:
    """Points, and the points of each cell, in the order of VTK's reader."""
    reader: Any = pytest.importorskip("vtkmodules.vtkIOGeometry").vtkAVSucdReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    cells = []
    for i in range(grid.GetNumberOfCells()):
        cell = grid.GetCell(i)  # the same object for each
        cells.append([cell.GetPointId(j) for j in range(cell.GetNumberOfPoints())])
    return np.array([grid.GetPoint(i) for i in range(grid.GetNumberOfPoints())]), cells


def test_cells_have_their_numbers_and_materials() -> None:
    source = parse(SQUARE)
    assert [(run.type, ids_of(run, 0).tolist(), run.vertices.tolist()) for run in source.cells] == [
        ("triangle", [11, 12, 13, 14], [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    ]  # fmt: skip
    assert source.regions == ("avsucd:material",)
    assert source.arrays.cell["avsucd:material"][0].tolist() == [3, 3, 4, -1]


@pytest.mark.parametrize("name", FILES)
def test_what_stands_there_is_another_programs_mesh(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    source = parse((tmp_path / name).read_bytes())
    points, cells = plate() if name == "plane.ucd" else block()
    at = next(i for i, run in enumerate(source.cells) if run.vertices.shape[1] == cells.shape[1])
    found = np.sort(source.points[source.cells[at].vertices], axis=1)
    np.testing.assert_allclose(found, np.sort(points[cells], axis=1), 0, 1e-9)
    np.testing.assert_array_equal(source.arrays.cell["avsucd:material"][at], material(points, cells))
    if name in ("plane.ucd", "solid.inp"):
        assert sum(len(run.vertices) for run in source.cells) == len(cells) + len(surface(cells))
    if name in ("plane.ucd", "meshio.avs"):  # VTK reads no steps, and dies of points in another order
        theirs, corners = by_vtk(tmp_path / name)
        np.testing.assert_array_equal(source.points.astype(np.float32), theirs.astype(np.float32))
        ours = [sorted(row) for run in source.cells for row in run.vertices.tolist()]
        assert sorted(ours) == sorted(sorted(row) for row in corners)


@pytest.mark.parametrize("top_first", [False, True])
def test_both_orders_of_nodes_are_those_of_the_table(top_first: bool, tmp_path: Path) -> None:
    """Mixed elements, as they are or upside down; pyramids begin with their tip, and turn with the others."""
    points, blocks = MESHES["every solid"]()
    orders = {
        "tetra": [0, 1, 3, 2] if top_first else [0, 1, 2, 3], "wedge": [3, 4, 5, 0, 1, 2] if top_first else [*range(6)],
        "pyramid": [4, 0, 1, 2, 3] if top_first else [4, 3, 2, 1, 0],
        "hexahedron": [4, 5, 6, 7, 0, 1, 2, 3] if top_first else [*range(8)],
    }  # fmt: skip
    rows = [(WORDS[key], row) for key, cells in blocks for row in (cells[:, orders[key]] + 1).tolist()]
    lines = [f"{i} 1 {word} {' '.join(map(str, row))}" for i, (word, row) in enumerate(rows, 1)]
    nodes = [f"{i} {' '.join(map(repr, p))}" for i, p in enumerate(points.tolist(), 1)]
    (tmp_path / "in.ucd").write_text("\n".join([f"{len(nodes)} {len(lines)} 0 0 0", *nodes, *lines, ""]))
    document = read(tmp_path / "in.ucd")
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.check()[0] == 0
    found = [(run.type, row) for run in document.source.cells for row in run.vertices.tolist()]
    assert found == [(key, row) for key, cells in blocks for row in cells.tolist()]


def test_dialects_of_the_counts() -> None:
    expected = parse(SQUARE).cells[0].vertices.tolist()
    for head in (b"5 4 0 0", b"# a\n  # b\n 5  4\t0 0 0", b"1\ndata\nstep1 at 0.5 s\n5 4"):
        for end in (b"\n", b"\r\n", b"\r"):
            source = parse(SQUARE.replace(b"5 4 0 0 0", head).replace(b"\n", end))
            assert source.cells[0].vertices.tolist() == expected


def test_second_order_is_held(tmp_path: Path) -> None:
    text = SQUARE.replace(b"14 -1 tri 4 1 9", b"14 -1 tri2 4 1 9 1 2 3")
    source = parse(text)
    assert [run.type for run in source.cells] == ["triangle", "triangle_of_6"]
    (tmp_path / "in.ucd").write_bytes(text)
    assert read(tmp_path / "in.ucd").not_judged == {"triangle_of_6": 1}


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (b"5 4 0", b"6 4 0", "line 7: '.*' is not|cells of the type|is not a"),
        (b"5 4 0", b"5 9999999999 0", "is truncated: 9,999,999,999 cells announced"),
        (b"5 4 0", b"999999999999 4 0", "is truncated: 999,999,999,999 rows are announced"),
        (b"5 4 0", b"-5 4 0", "line 1: a count is negative"),
        (b"5 4 0", b"5 3 0", "line 10: there are more lines than announced"),
        (b"4 0 0 0\n", b"4 x 0 0\n", "line 1: 'x' is not an integer"),
        (b"9 .5 .5", b"9 .5 y", "line 6: 'y' is not a number"),
        (b"9 .5 .5", b"4 .5 .5", "the point 4 is defined twice"),
        (b"tri 4 1 9", b"tri 4 1 8", "the cell 14 names the point 8, and there is none"),
        (b"tri 4 1 9", b"tri 4 1 z", "line 10: 'z' is not an integer"),
        (b"tri 4 1 9", b"tri 4 1", "line 10: cells of the type 'tri' with 2 points are not known"),
        (b"tri 4 1 9", b"ball 4 1 9", "line 10: cells of the type 'ball' with 3 points are not known"),
        (b"14 -1 tri 4 1 9", b"14", "line 10: cells of the type '' with 0 points are not known"),
        (b"5 4 0 0 0", b"2\ngeom\nstep1\n5 4", "holds several meshes"),
        (b"5 4 0 0 0", b"\x07", "is a binary file of AVS, which meshfix does not read"),
    ],
)
def test_what_is_wrong_is_named(before: bytes, after: bytes, words: str) -> None:
    assert before in SQUARE
    data = after if after == b"\x07" else SQUARE.replace(before, after)
    with pytest.raises(ReadError, match=words):
        parse(data)
