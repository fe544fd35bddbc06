"""Archives of Ansys Mechanical: types of elements, columns, components, and faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elements import MESHES
from files_mapdl import FILES, HEAD, component, elements, nodes, others
from files_medit import material
from second_order import element, middles
from shapes import block

from meshfix_cli import read, write
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import straight_key
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.mapdl import parse

POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
CELLS = [(1, 1, [1, 2, 5, 5]), (1, 1, [2, 3, 5, 5]), (2, 1, [3, 4, 5, 5]), (2, 1, [4, 1, 5, 5])]
SQUARE = HEAD + "ET,1,182\n" + nodes(POINTS) + elements(CELLS) + component("SOME", "ELEM", [1, -3])
# Which corners stand where in a hexahedron that repeats some of them, from 0.
REPEATING = {
    "tetra": [0, 1, 2, 2, 3, 3, 3, 3], "pyramid": [0, 1, 2, 3, 4, 4, 4, 4], "wedge": [0, 1, 2, 2, 3, 4, 5, 5],
}  # fmt: skip


def test_materials_types_and_components(tmp_path: Path) -> None:
    FILES["solid.cdb"](tmp_path / "in.cdb")
    document = read(tmp_path / "in.cdb")
    parts = material(*block())
    labels = {name: np.concatenate(runs) for name, runs in document.source.arrays.cell.items()}
    for name in ("ansys:material", "ansys:type"):
        np.testing.assert_array_equal(labels[name][: len(parts)], parts)
    held = document.mesh.topology.interface(parts)
    assert held.any()
    assert not document.mesh.movable[held].any()
    groups = groups_of(document.source)
    assert groups["SOME"].counts == {3: 5}
    assert groups["TIPS"].points.tolist() == [1, 4, 5, 6]
    assert [run.type for run in document.source.cells].count("triangle") == 1


def test_types_of_a_compact_block_are_those_of_the_commands_before(tmp_path: Path) -> None:
    FILES["compact.dat"](tmp_path / "in.dat")
    cells = read(tmp_path / "in.dat").source
    assert [np.unique(one).tolist() for one in cells.arrays.cell["ansys:type"]] == [[1], [2]]


@pytest.mark.parametrize("key", ["tetra10", "pyramid13", "wedge15"])
def test_hexahedra_of_second_order_that_repeat_nodes_are_what_is_left(key: str) -> None:
    """A node between two that are one is that one."""
    points = element(key)
    corners = points[REPEATING[straight_key(key) or ""]]
    places = np.concatenate([corners, middles("hexahedron20", corners)])
    rows = np.argmin(np.linalg.norm(places[:, None] - points, axis=2), axis=1) + 1
    text = HEAD + "ET,1,186\n" + nodes(points) + elements([(1, 1, rows.tolist())])
    (run,) = parse(text.encode()).cells
    assert run.type == key
    assert run.vertices.tolist() == [[*range(len(points))]]


@pytest.mark.parametrize(
    ("key", "kind"), [("tetra10", 187), ("hexahedron20", 186), ("quad8", 183), ("triangle6", 2), ("line3", 189)]
)
def test_nodes_of_elements_are_in_the_order_of_vtk(key: str, kind: int) -> None:
    points = element(key)
    text = HEAD + f"ET,1,{kind}\n" + nodes(points) + elements([(1, 1, [*range(1, len(points) + 1)])])
    (run,) = parse(text.encode()).cells
    assert (run.type, run.vertices.tolist()) == (key, [[*range(len(points))]])


@pytest.mark.parametrize(
    ("kind", "rows", "expected"),
    [
        ("200,5", [1, 2, 3, 4, 5, 6], "triangle6"),
        ("200,9", [*range(1, 11)], "tetra10"),
        ("200", [1, 2], "line"),
        ("188", [1, 2, 3], "line"),
        ("281", [1, 2, 3, 3, 5, 6, 3, 8], "triangle6"),
        ("281", [1, 2, 3, 4, 0, 0, 0, 0], "quad"),
        ("281", [1, 2, 3, 4, 5, 0, 7, 8], "quad_of_some"),
        ("186", [*range(1, 9), *[0] * 12], "hexahedron"),
        ("21", [1], "vertex"),
        ("174", [1, 2, 3, 4, 5], "quad_of_5"),
        ("999", [1, 2, 3, 4], "unknown_of_4"),
        ("999", [*range(1, 11)], "tetra10"),
    ],
)
def test_types(kind: str, rows: list[int], expected: str) -> None:
    text = HEAD + f"ET,1,{kind}\n" + nodes(np.arange(30.0).reshape(10, 3)) + elements([(1, 1, rows)])
    assert [run.type for run in parse(text.encode()).cells] == [expected]


@pytest.mark.parametrize("name", ["every solid", "quads and triangles"])
def test_all_linear_types(name: str, tmp_path: Path) -> None:
    points, blocks = MESHES[name]()
    listed = []
    for key, rows in blocks:
        order = REPEATING.get(key, [0, 1, 2, 2] if key == "triangle" else ...)
        listed += [(1, 1, row) for row in (rows[:, order] + 1).tolist()]
    kind = 185 if name == "every solid" else 181
    (tmp_path / "in.cdb").write_text(HEAD + f"ET,1,{kind}\n" + nodes(points) + elements(listed))
    document = read(tmp_path / "in.cdb")
    assert document.not_judged == {}
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.check()[0] == 0


def test_numbers_that_touch_are_told_apart_by_their_columns(tmp_path: Path) -> None:
    points, cells = block()
    (tmp_path / "in.cdb").write_text(
        HEAD + "ET,1,285\n" + nodes(-points - 1) + elements([(1, 1, row) for row in (cells + 1).tolist()], width=4)
    )
    source = read(tmp_path / "in.cdb").source
    np.testing.assert_allclose(source.points, -points - 1, rtol=1e-13)
    assert len(source.cells[0].vertices) == len(cells)


def test_other_formats_of_a_block() -> None:
    text = SQUARE.replace("(3i9,6e21.13e3)", "(1i9,2i9,6e21.13e3)").encode()
    assert parse(text).points.tolist() == POINTS.tolist()


def test_a_coordinate_that_is_left_out_is_put_there(tmp_path: Path) -> None:
    points = np.array([[0, 0, 0.0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.3, 0.3, 0], [0.2, 0.2, -1]])
    cells = [[1, 2, 5, 4], [2, 3, 5, 4], [3, 1, 5, 4], [2, 1, 5, 6], [3, 2, 5, 6], [1, 3, 5, 6]]
    (tmp_path / "in.cdb").write_text(HEAD + "ET,1,285\n" + nodes(points) + elements([(1, 1, row) for row in cells]))
    document = read(tmp_path / "in.cdb")
    assert np.flatnonzero(document.mesh.movable).tolist() == [4]
    assert document.source.held is not None
    assert document.source.held.tolist() == [True, True, False, False, False, False]
    layout = document.source.layout
    assert layout is not None
    moved = document.source.points.copy()
    moved[4] = [0.25, 0.125, -0.5]
    text = layout.rewritten(document.source.points, moved, {})
    assert b" 2.5000000000000E-001 1.2500000000000E-001-5.0000000000000E-001\n" in text
    np.testing.assert_array_equal(parse(text).points, moved)


def test_what_was_written_has_a_digit_before_the_point(tmp_path: Path) -> None:
    FILES["solid.cdb"](tmp_path / "in.cdb")
    document = read(tmp_path / "in.cdb")
    write(document, document.mesh, tmp_path / "out.cdb")
    layout = document.source.layout
    assert layout is not None
    text = layout.rewritten(document.source.points, document.source.points / -3, {})
    block_of = text.partition(b"e21.13e3)\n")[2].partition(b"N,R5.3")[0]
    for line in block_of.splitlines():
        for at in range(27, len(line), 21):
            assert line[at : at + 3].strip(b" -")[:1].isdigit()
            assert line[at + 2 : at + 3] == b"."
            assert line[at + 16 : at + 17] == b"E"


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("NBLOCK", "NBLACK", "has no blocks of nodes and elements"),
        ("EBLOCK", "EBLACK", "has no blocks of nodes and elements"),
        ("(3i9,6e21.13e3)", "(3a9)", "line 10: a block has no format that is known"),
        ("NBLOCK,6,SOLID,        5,        5", "NBLOCK,6,SOLID,        5,        6", "6 nodes announced"),
        ("EBLOCK,19,SOLID,        4,        4", "EBLOCK,19,SOLID,        4,        5", "5 elements announced"),
        ("4        5        5\n       -1", "4        6        5\n       -1", "the cell 4 names the point"),
        ("1.0000000000000E+000", "1.000000000x000E+000", "is not a number"),
        ("        4        0        4", "        9        0        4", "have not the lines that their numbers"),
        ("ELEM,       2", "ELEM,       9", "truncated"),
        ("(19i9)", "(9i9)", "has no 19 columns"),
        ("(19i9)", "(0i9)", "the format of a block has no integers"),
        ("ET,1,182", "ETBLOCK,1,1\n(1i9)\n        1\n       -1", "the types of elements have no numbers of their own"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    text = SQUARE.replace("4        1        5        5\n       -1", "4        5        5\n       -1")
    text = SQUARE if before not in text or "-1" not in before else text
    assert before in text
    with pytest.raises(ReadError, match=words):
        parse(text.replace(before, after, 1).encode())


def test_meshes_that_commands_make_are_refused() -> None:
    with pytest.raises(ReadError, match="but commands that make a mesh, which are not carried out"):
        parse(b"/PREP7\nET,1,185\nN,1,0,0,0\nN,2,1,0,0\nE,1,2\nFINISH\n")


def test_a_block_may_end_with_the_file() -> None:
    text = SQUARE.partition("       -1\nCMB")[0]
    assert len(parse(text.encode()).cells[0].vertices) == 4
    with pytest.raises(ReadError, match="is truncated"):
        parse(text.replace("SOLID,        4,        4", "SOLID").encode())


def test_surfaces_beside() -> None:
    text = SQUARE + "et,7,154\n" + others([(3, [1, 2, 3, 4])], 20, 7)
    runs = parse(text.encode()).cells
    assert [(run.type, run.ids.tolist()) for run in runs[1:] if run.ids is not None] == [("quad", [20])]
