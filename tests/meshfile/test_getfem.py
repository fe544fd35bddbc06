"""GetFEM's files: regions, transformations, the order of points, and faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elements import MESHES
from files_getfem import FILES, file, region
from files_medit import material
from second_order import element, reference
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.getfem import parse
from meshfix_cli.meshfile.groups import groups_of

POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
CELLS = [("GT_PK(2,1)", [i, (i + 1) % 4, 4]) for i in range(4)]
SQUARE = file(POINTS, CELLS, region(3, ["0", "2/2", "3/0"]))
# Points are those of a lattice, x fastest.
LINEAR = {
    "tetra": ("GT_PK(3,1)", [0, 1, 2, 3]), "pyramid": ("GT_PYRAMID(1)", [0, 1, 3, 2, 4]),
    "wedge": ("GT_PRISM(3,1)", [*range(6)]), "hexahedron": ("GT_QK(3,1)", [0, 1, 3, 2, 4, 5, 7, 6]),
    "triangle": ("GT_PK(2,1)", [0, 1, 2]), "quad": ("GT_QK(2,1)", [0, 1, 3, 2]),
}  # fmt: skip
SECOND = {
    "triangle6": "GT_PK(2,2)", "quad9": "GT_QK(2,2)", "quad8": "GT_Q2_INCOMPLETE(2)", "tetra10": "GT_PK(3,2)",
    "wedge18": "GT_PRODUCT(GT_PK(2,2),GT_PK(1,2))", "hexahedron20": "GT_Q2_INCOMPLETE(3)", "hexahedron27": "GT_QK(3,2)",
}  # fmt: skip


def test_regions_are_sets(tmp_path: Path) -> None:
    FILES["solid.mesh"](tmp_path / "in.mesh")
    source = read(tmp_path / "in.mesh").source
    points, cells = block()
    groups = groups_of(source)
    assert groups["region 7"].counts == {3: int((material(points, cells) == 2).sum())}
    assert sorted(groups["region 8"].points.tolist()) == sorted({*cells[0, 1:].tolist(), *cells[1, :3].tolist()})
    assert not source.oriented


def test_faces_of_triangles() -> None:
    source = parse(SQUARE.encode())
    assert groups_of(source)["region 3"].counts == {2: 1, 1: 2}
    assert sorted(map(sorted, source.cells[1].vertices.tolist())) == [[0, 4], [2, 3]]


@pytest.mark.parametrize("name", ["every solid", "quads and triangles"])
def test_all_linear_types(name: str, tmp_path: Path) -> None:
    points, blocks = MESHES[name]()
    convexes = [(LINEAR[key][0], row) for key, rows in blocks for row in rows[:, LINEAR[key][1]].tolist()]
    (tmp_path / "in.mesh").write_text(file(points, convexes))
    document = read(tmp_path / "in.mesh")
    assert document.not_judged == {}
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.check()[0] == 0


@pytest.mark.parametrize("key", SECOND)
def test_points_of_second_order_lie_on_a_lattice(key: str) -> None:
    rank = np.lexsort(reference(key).T)
    source = parse(file(element(key)[rank], [(SECOND[key], [*range(len(rank))])]).encode())
    assert [run.type for run in source.cells] == [key]
    np.testing.assert_array_equal(rank[source.cells[0].vertices[0]], np.arange(len(rank)))


@pytest.mark.parametrize(
    ("name", "size", "expected"),
    [
        ("GT_PK(2,3)", 10, "triangle10"),
        ("GT_QK(3,3)", 64, "hexahedron64"),
        ("GT_LINEAR_QK(2)", 4, "quad"),
        ("GT_X", 5, "polyhedron_of_5"),
    ],
)
def test_other_transformations(name: str, size: int, expected: str) -> None:
    text = file(np.arange(3.0 * size).reshape(size, 3), [(name, range(size))])
    assert [run.type for run in parse(text.encode()).cells] == [expected]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("BEGIN POINTS", "BEGIN PAINTS", "POINTS LIST does not begin"),
        ("POINT COUNT 5", "POINT COUNT 6", "it announces 6 rows of POINT"),
        ("CONVEX COUNT 4", "CONVEX COUNT 5", "it announces 5 rows of CONVEX"),
        ("3  0  4", "3  0  5", "the cell 3 names the point 5"),
        ("3  0  4", "3  0  y", "'y' is not an integer"),
        ("0.5  0.5", "0.5  0.x", "'0.x' is not a number"),
        ("0.5  0.5", "0.5", "not all the same number of coordinates"),
        ("'GT_PK(2,1)'      3  0  4", "3  0  4", "no geometric transformation"),
        ("3    'GT_PK(2,1)'      3  0  4", "3", "a convex has no points"),
        ("END MESH", "MESH", "there are more lines than announced"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after, 1).encode())


def test_several_meshes_are_refused() -> None:
    with pytest.raises(ReadError, match="holds several meshes"):
        parse((SQUARE + SQUARE).encode())
