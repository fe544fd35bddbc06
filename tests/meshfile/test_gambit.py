"""Neutral files of Gambit: the order of points, groups and conditions, VTK's reader beside ours, and faults."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from elements import MESHES
from files_gambit import FILES, condition, file, group
from files_medit import material, surface
from second_order import element, reference
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, straight_key
from meshfix_cli.meshfile.gambit import parse
from meshfix_cli.meshfile.groups import groups_of

POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
CELLS = [(3, [1, 2, 5]), (3, [2, 3, 5]), (3, [3, 4, 5]), (3, [4, 1, 5])]
OTHERS = [group(7, "half", [1, 2]), condition("bottom", True, [[1, 3, 1]])]
SQUARE = file(POINTS, CELLS, OTHERS)
TYPES = {"quad": 2, "triangle": 3, "hexahedron": 4, "wedge": 5, "tetra": 6, "pyramid": 7}
ALONG = {"pyramid": [0, 1, 3, 2, 4], "hexahedron": [0, 1, 3, 2, 4, 5, 7, 6]}


def made(dimension: int, path: Path, *others: str) -> Any:
    points, blocks = MESHES["quads and triangles" if dimension == 2 else "every solid"]()
    listed = [(TYPES[key], row) for key, some in blocks for row in (some[:, ALONG.get(key, ...)] + 1).tolist()]
    path.write_text(file(points, listed, others))
    return points, blocks


def test_groups_and_conditions(tmp_path: Path) -> None:
    source = parse(SQUARE.encode())
    assert source.arrays.cell["gambit:group"][0].tolist() == [7, 7, 0, 0]
    assert source.cells[1].vertices.tolist() == [[0, 1]]
    FILES["solid.neu"](tmp_path / "in.neu")
    document = read(tmp_path / "in.neu")
    points, cells = block()
    labels = document.source.arrays.cell["gambit:group"][0]
    np.testing.assert_array_equal(labels, material(points, cells))
    held = document.mesh.topology.interface(labels)
    assert held.any()
    assert not document.mesh.movable[held].any()
    groups = groups_of(document.source)
    assert list(groups) == ["fluid", "a solid", "wall", "tips"]
    assert groups["wall"].counts == {2: len(surface(cells))}
    np.testing.assert_array_equal(groups["wall"].points, np.unique(surface(cells)))
    assert groups["tips"].points.tolist() == [0, 1]


@pytest.mark.parametrize("dimension", [2, 3])
def test_vtk_reads_the_same_elements(dimension: int, tmp_path: Path) -> None:
    points, blocks = made(dimension, tmp_path / "in.neu")
    document = read(tmp_path / "in.neu")
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.check()[0] == 0
    reader: Any = pytest.importorskip("vtkmodules.vtkIOGeometry").vtkGAMBITReader()
    reader.SetFileName(str(tmp_path / "in.neu"))
    reader.Update()
    grid, theirs = reader.GetOutput(), []
    for i in range(grid.GetNumberOfCells()):
        cell = grid.GetCell(i)
        theirs.append([cell.GetPointId(j) for j in range(cell.GetNumberOfPoints())])
    runs = document.source.cells
    assert [row for run in runs for row in run.vertices.tolist()] == [
        row for _, some in blocks for row in some.tolist()
    ]
    listed = [run.vertices[:, ALONG.get(run.type, ...)] for run in runs]  # VTK takes them as they are
    assert theirs == [row for some in listed for row in some.tolist()]
    places = np.array([grid.GetPoint(i) for i in range(len(points))])[:, : points.shape[1]]
    np.testing.assert_allclose(document.source.points, places, atol=1e-6)


@pytest.mark.parametrize("key", ["tetra", "pyramid", "wedge", "hexahedron"])
def test_faces_are_those_of_the_element(key: str, tmp_path: Path) -> None:
    """All faces of an element are its facets, each once."""
    _, blocks = made(3, tmp_path / "in.neu")
    before = sum(len(some) for name, some in blocks[: [name for name, _ in blocks].index(key)])
    facets = ELEMENTS[key].shape.facets
    listed = [[before + 1, TYPES[key], face] for face in range(1, len(facets) + 1)]
    made(3, tmp_path / "in.neu", condition("skin", True, listed))
    source = read(tmp_path / "in.neu").source
    found = [set(row) for run in source.cells[len(blocks) :] for row in run.vertices.tolist()]
    cell = dict(blocks)[key][0]
    assert sorted(map(sorted, found)) == sorted(sorted(cell[list(facet)].tolist()) for facet in facets)


@pytest.mark.parametrize("key", ["triangle6", "quad8", "quad9", "tetra10", "wedge18", "hexahedron27"])
def test_points_of_second_order_stand_among_the_corners(key: str) -> None:
    """Around triangles and quadrilaterals; along the axes of others, first by z, then by y, then by x."""
    nodes, shape = element(key), ELEMENTS[key].shape
    rank = np.lexsort(reference(key).T)
    if shape.dimension == 2:
        turns = np.arctan2(*(reference(key)[:, :2] - reference(key)[: shape.corners, :2].mean(axis=0)).T[::-1])
        rank = np.argsort((turns - turns[0]) % (2 * np.pi))
        rank = np.array([*rank[rank != 8], *rank[rank == 8]])
    linear = straight_key(key) or ""
    text = file(nodes[rank][:, : shape.dimension], [(TYPES[linear], [*range(1, len(nodes) + 1)])])
    (run,) = parse(text.encode()).cells
    assert run.type == key
    np.testing.assert_array_equal(rank[run.vertices[0]], np.arange(len(nodes)))


def test_faces_of_elements_of_second_order_are_those_of_their_corners() -> None:
    nodes = element("tetra10")
    rank = np.lexsort(reference("tetra10").T)
    skin = condition("skin", True, [[1, 6, 1], [1, 6, 3]])
    source = parse(file(nodes[rank], [(6, [*range(1, 11)])], [skin]).encode())
    assert [sorted(rank[row].tolist()) for row in source.cells[1].vertices] == [[0, 1, 2], [1, 2, 3]]


def test_second_order_of_which_little_is_known_is_held(tmp_path: Path) -> None:
    (tmp_path / "in.neu").write_text(file(POINTS, [*CELLS, (3, [1, 2, 3, 4, 5])]))
    assert read(tmp_path / "in.neu").not_judged == {"triangle_of_5": 1}


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (
            "         5         4         1",
            "         6         4         1",
            "6 points are announced, and not all are there",
        ),
        ("         5         4         1", "         4         4         1", "there are more lines than announced"),
        ("         5         4         1", "         5         5         1", "there are not the 5 elements"),
        ("         5         4         1", "         x         4         1", "it has no NUMNP"),
        ("       4  3  3        4", "       4  3  4        4", "there are not the 4 elements that it announces"),
        (
            "       4  3  3        4",
            "       4  9  3        4",
            "elements of the type 9 with 3 points, which are not known",
        ),
        ("       4  3  3        4", "       4  3  3        6", "the cell 4 names the point 6, and there is none"),
        ("       4  3  3        4", "       4  3  3        y", "line 20: 'y' is not an integer"),
        ("5.00000000000e-01", "5.0000000000xe-01", "line 14: '5.0000000000xe-01' is not a number"),
        ("ELEMENTS:          2", "ELEMENTS:          3", "a group has not the 3 elements that it announces"),
        ("GROUP:", "CROUP:", "a group has no number"),
        ("       1       1       0", "       1       2       0", "a boundary condition has not the 2 rows"),
        ("bottom       1       1", "bottom", "a boundary condition has no name"),
        ("NODAL COORD", "MODAL COORD", "it has no NODAL COORDINATES"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after, 1).encode())


def test_what_is_cut_is_truncated() -> None:
    with pytest.raises(ReadError, match="is truncated: its last section has no ENDOFSECTION"):
        parse(SQUARE.encode()[:-20])
