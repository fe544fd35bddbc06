"""Files of Ansys Fluent: cells made of faces, zones with their names, and what is wrong with them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from elements import MESHES
from files_fluent import FILES, by_parts, text
from files_medit import surface
from shapes import block, plate

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.fluent import parse
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.sliding import slid

POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
CELLS = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
SQUARE = text(POINTS, [("triangle", CELLS)], np.array([1, 1, 2, 2]))


def loops(rows: np.ndarray) -> list[tuple[int, ...]]:
    """Cells, from their smallest vertex on."""
    return [tuple(np.roll(row, -int(row.argmin())).tolist()) for row in rows]


def test_edges_make_cells_and_zones_have_names() -> None:
    source = parse(SQUARE)
    assert loops(source.cells[0].vertices) == loops(CELLS)
    assert source.arrays.cell["fluent:zone"][0].tolist() == [2, 2, 10, 10]
    assert source.regions == ("fluent:zone",)
    assert {name: one.counts for name, one in groups_of(source).items()} == {
        "steel": {2: 2}, "copper": {2: 2}, "left": {1: 2}, "right": {1: 2}
    }  # fmt: skip


@pytest.mark.parametrize("name", ["solid.cas", "binary.cas"])
def test_faces_make_cells(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    document = read(tmp_path / name)
    points, cells = block()
    expected = by_parts(points, cells)[0] if name == "solid.cas" else cells
    (tetrahedra,) = [run.vertices for run in document.source.cells if run.type == "tetra"]
    np.testing.assert_array_equal(np.sort(tetrahedra, axis=1), np.sort(expected, axis=1))
    np.testing.assert_array_equal(document.source.points, points)
    faces = [run.vertices for run in document.source.cells if run.type == "triangle"]
    np.testing.assert_array_equal(np.unique(np.sort(np.concatenate(faces), axis=1), axis=0), sorted_skin(cells))


def sorted_skin(cells: np.ndarray) -> np.ndarray:
    return np.unique(np.sort(surface(cells), axis=1), axis=0)


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("name", ["every solid", "quads and triangles"])
def test_elements_of_every_type(name: str, binary: bool, tmp_path: Path) -> None:
    points, blocks = MESHES[name]()
    m = sum(len(rows) for _, rows in blocks)
    (tmp_path / "in.cas").write_bytes(text(points, blocks, np.ones(m, dtype=np.int64), mixed=True, binary=binary))
    document = read(tmp_path / "in.cas")
    assert document.mesh.check()[0] == 0
    assert document.not_judged == {}
    counts = {run.type: len(run.vertices) for run in document.source.cells[: len(blocks)]}
    assert counts == {key: len(rows) for key, rows in blocks}
    found = {frozenset(row) for run in document.source.cells[: len(blocks)] for row in run.vertices.tolist()}
    assert found == {frozenset(row) for _, rows in blocks for row in rows.tolist()}


def test_zones_hold_their_interface(tmp_path: Path) -> None:
    FILES["plane.msh"](tmp_path / "in.msh")
    document = read(tmp_path / "in.msh")
    labels = document.source.arrays.cell["fluent:zone"][0]
    np.testing.assert_array_equal(labels, np.where(by_parts(*plate())[1] == 1, 2, 10))
    held = document.mesh.topology.interface(labels)
    assert held.any()
    assert not document.mesh.movable[held].any()
    assert document.mesh.movable.any()  # faces inside hold nothing


def test_elements_are_not_renumbered() -> None:
    source = parse(SQUARE)
    assert not source.oriented
    with pytest.raises(ReadError, match="has cells that are made of faces"):
        source.layout.corners[0]()  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (b"(10 (1 1 5 1 2)", b"(10 (1 1 6 1 2)", "line 6: there are not the 6 nodes of 2 coordinates"),
        (b"(10 (1 1 5 1 2)", b"(10 (1 1 ffffffffff 1 2)", "is truncated: section 10 announces 1,099,511,627,775 rows"),
        (b"(10 (1 1 5 1 2)", b"(11 (1 1 5 1 2)", "it has no nodes, or no faces"),
        (b"5.000000000e-01 5", b"x.000000000e-01 5", "line 11: 'x.000000000e-01' is not a number"),
        (b"(13 (3 1 4 2 2)", b"(13 (3 1 5 2 2)", "there are not the 5 faces of 2 nodes"),
        (b"(13 (3 1 4 2 2)", b"(13 (3 1 4 2 0)", "there are not the 4 faces that are announced"),
        (b"\n2 5 1 2\n", b"\n2 5 1 g\n", "'g' is not a hexadecimal number"),
        (b"\n2 5 1 2\n", b"\n2 6 1 2\n", "names the point 6, and there is none"),
        (b"\n2 5 1 2\n", b"\n2 5 0 0\n", "a face lies beside no cell"),
        (b"\n2 5 1 2\n", b"\n2 5 1 0\n", "the faces of the cell 2 are no loop"),
        (b"\n2 5 1 2\n", b"\n2 5 1 fffff\n", "its faces name the cell 1048574, and there are not as many"),
        (
            b"\n2 5 1 2\n",
            b"\n2 5 1 7fffffffffffffff\n",
            "is not a hexadecimal number|is truncated|there are not as many",
        ),
    ],
)
def test_what_is_wrong_is_named(before: bytes, after: bytes, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after, 1))


def test_the_dimension_may_stand_alone() -> None:
    short = SQUARE.replace(b"1 1 5 1 2)", b"1 1 5 1)")
    np.testing.assert_array_equal(parse(short).points, POINTS)
    with pytest.raises(ReadError, match="does not tell how many coordinates they have"):
        parse(short.replace(b"(2 2)", b"(2 4)"))


@pytest.mark.parametrize("kind", [b"c", b"8"])
def test_points_of_periodic_faces_do_not_slide(kind: bytes, tmp_path: Path) -> None:
    """Zones of faces that have shadows, and zones of these."""
    points, cells = block()
    plain = text(points, [("tetra", cells)], np.ones(len(cells), dtype=np.int64))
    periodic, count = re.subn(rb"(\(13 \(4 \w+ \w+) 3 ", rb"\g<1> " + kind + b" ", plain)
    assert count == 1
    (tmp_path / "in.cas").write_bytes(plain)
    (tmp_path / "periodic.cas").write_bytes(periodic)
    free, document = read(tmp_path / "in.cas"), read(tmp_path / "periodic.cas")
    assert free.source.held is None
    assert document.source.held is not None
    faces = [row for run in document.source.cells if run.type == "triangle" for row in run.vertices.tolist()]
    half = len(faces) // 2
    assert set(np.flatnonzero(document.source.held)) == {vertex for row in faces[:half] for vertex in row}
    moves, all_move = slid(document).mesh.movable, slid(free).mesh.movable
    assert not (moves & document.source.held).any()
    np.testing.assert_array_equal(moves, all_move & ~document.source.held)
    assert (all_move & document.source.held).any()
