"""Netgen's files: domains, boundaries and their names, dialects, the order of nodes, and faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elements import MESHES
from files_medit import material
from files_netgen import FILES, file, points_of, section
from second_order import element, middles
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, straight_key
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.netgen import parse

POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
TRIANGLES = section("surfaceelements", [f" 1 1 1 0 3 {a} {b} 5" for a, b in ((1, 2), (2, 3), (3, 4), (4, 1))])
SQUARE = file(POINTS, TRIANGLES, section("materials", ["1 sheet"]), dimension=2)
# Corners as Netgen has them.
MIRRORED = {
    "tetra": [0, 2, 1, 3], "pyramid": [0, 3, 2, 1, 4], "wedge": [0, 2, 1, 3, 5, 4],
    "hexahedron": [0, 3, 2, 1, 4, 7, 6, 5],
}  # fmt: skip
# Between which corners its program puts nodes when it makes a mesh one of second order.
SECOND = {
    "triangle6": "12 02 01", "quad8": "01 23 03 12", "tetra10": "01 02 03 12 13 23",
    "pyramid13": "01 23 03 12 04 14 24 34", "wedge12": "02 01 12 35 34 45",
    "hexahedron20": "01 23 03 12 45 67 47 56 04 15 26 37",
}  # fmt: skip


def test_domains_and_boundaries(tmp_path: Path) -> None:
    FILES["solid.vol"](tmp_path / "in.vol")
    document = read(tmp_path / "in.vol")
    parts = material(*block())
    held = document.mesh.topology.interface(parts)
    assert held.any()
    assert not document.mesh.movable[held].any()
    groups = groups_of(document.source)
    assert list(groups) == ["lower", "upper", "air", "iron core"]
    assert groups["iron core"].counts == {3: int((parts == 2).sum())}
    assert document.source.untold == ("geometry",)


def test_names_of_edges_in_the_plane(tmp_path: Path) -> None:
    FILES["plane.vol"](tmp_path / "in.vol")
    document = read(tmp_path / "in.vol")
    assert document.source.points.shape[1] == 2
    groups = groups_of(document.source)
    assert list(groups) == ["left", "right", "the_end"]
    assert groups["the_end"].points.tolist() == [0, 1]


@pytest.mark.parametrize("name", ["every solid", "quads and triangles"])
def test_all_linear_types(name: str, tmp_path: Path) -> None:
    points, blocks = MESHES[name]()
    three = points.shape[1] == 3
    lines = []
    for key, rows in blocks:
        ordered = (rows[:, MIRRORED.get(key, ...)] + 1).tolist()
        lines += [" ".join(map(str, [*([1] if three else [1, 1, 1, 0]), len(row), *row])) for row in ordered]
    keyword = "volumeelements" if three else "surfaceelements"
    (tmp_path / "in.vol").write_text(file(points, section(keyword, lines), "", dimension=points.shape[1]))
    document = read(tmp_path / "in.vol")
    assert document.not_judged == {}
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.check()[0] == 0


@pytest.mark.parametrize("key", SECOND)
def test_nodes_of_second_order_come_in_the_order_of_vtk(key: str) -> None:
    shape = ELEMENTS[key].shape
    corners = element(key)[: shape.corners][MIRRORED.get(straight_key(key) or "", ...)]
    between = [corners[[int(one) for one in pair]].mean(axis=0) for pair in SECOND[key].split()]
    row = " ".join(map(str, range(1, ELEMENTS[key].nodes + 1)))
    line = f"1 {ELEMENTS[key].nodes} {row}"
    flat = section("surfaceelements", [f"1 1 1 {line}"])
    text = file(
        np.concatenate([corners, between]), flat if shape.dimension == 2 else section("volumeelements", [line]), ""
    )
    source = parse(text.encode())
    assert source.cells[0].type == key
    nodes = source.points[source.cells[0].vertices[0]]
    np.testing.assert_allclose(nodes[shape.corners :], middles(key, nodes[: shape.corners]))
    np.testing.assert_array_equal(nodes[: shape.corners], element(key)[: shape.corners])


@pytest.mark.parametrize("keyword", ["surfaceelements", "surfaceelementsgi", "surfaceelementsuv"])
def test_dialects_of_surfaces(keyword: str) -> None:
    more = {"surfaceelements": "", "surfaceelementsgi": " 7 8 9", "surfaceelementsuv": " 0.5 1 2e-3 4 5 6"}[keyword]
    text = SQUARE.replace("surfaceelements", keyword).replace(" 5\n", f" 5{more}\n")
    assert [len(run.vertices) for run in parse(text.encode()).cells] == [4]


@pytest.mark.parametrize(
    ("keyword", "line", "label"),
    [
        ("edgesegments", "3 0 1 2", 3),
        ("edgesegmentsgi", "3 0 1 2 5 6", 3),
        ("edgesegmentsgi2", "3 0 1 2 5 6 7 8 9 0.5 9 0.5", 3),
        ("edgesegmentsgi3", "1 2 5 6 0.5 0.5 3", 4),
    ],
)
def test_dialects_of_edges(keyword: str, line: str, label: int) -> None:
    source = parse(file(POINTS, TRIANGLES, section(keyword, [line]), "", dimension=2).encode())
    assert source.cells[1].vertices.tolist() == [[0, 1]]
    assert source.arrays.cell["netgen:index"][1].tolist() == [label]


def test_points_that_are_elements() -> None:
    names = section("cd3names", ["1 a", "2 corner"])
    source = parse(file(POINTS, TRIANGLES, section("pointelements", ["4 2"]) + names).encode())
    assert groups_of(source)["corner"].points.tolist() == [3]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("points\n5", "points\n6", "there are more lines than announced"),
        ("points\n5", "points\n4", "there are more lines than announced|names the point 5"),
        ("points\n5", "points\nx", "'x' is not an integer"),
        ("points\n5", "paints\n5", "holds no points"),
        ("surfaceelements\n4", "surfaceelements\n4000", "4,000 elements announced"),
        ("1 1 1 0 3 4 1 5", "1 1 1 0 3 4 1 6", "the cell 4 names the point 6, and there is none"),
        ("1 1 1 0 3 4 1 5", "1 1 1 0 -3 4 1 5", "an element has -3 points"),
        ("1 1 1 0 3 4 1 5", "1 1 1 0 4 4 1 5", "there are not 9 numbers"),
        ("materials\n1", "materials\n2", "2 names are announced"),
        ("dimension\n2", "dimension\n4", "a mesh in 4 dimensions"),
        ("endmesh", "curvedelements\n1\nendmesh", "has curved elements"),
        ("endmesh", "endmesh\n" + SQUARE, "holds several meshes"),
        ("endmesh", points_of(POINTS) + "endmesh", "holds several meshes"),
        ("    0.5000000000000000  ", "    0.5000000000000x00  ", "is not a number"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after, 1).encode())


def test_what_is_cut_is_truncated() -> None:
    with pytest.raises(ReadError, match="is truncated"):
        parse(SQUARE.encode().rstrip()[:-4])
