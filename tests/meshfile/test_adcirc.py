"""Grids of ADCIRC: boundaries, depths, numbers of nodes, and faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elements import MESHES
from files_adcirc import FILES, file

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.adcirc import parse
from meshfix_cli.meshfile.formats import sniff
from meshfix_cli.meshfile.groups import groups_of

POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
CELLS = [[1, 2, 5], [2, 3, 5], [3, 4, 5], [4, 1, 5]]
BOUNDARIES = "1 = open boundaries\n2\n2\n1\n2\n1 = land boundaries\n2\n2 0\n3\n4\n"
SQUARE = file(POINTS, CELLS, BOUNDARIES)


def test_boundaries_are_sets_and_depths_are_data(tmp_path: Path) -> None:
    FILES["fort.14"](tmp_path / "fort.14")
    document = read(tmp_path / "fort.14")
    assert document.source.points.shape[1] == 2
    groups = groups_of(document.source)
    assert {name: group.points.tolist() for name, group in groups.items()} == {
        "open boundary 1": [0, 1], "land boundary 1": [2, 3], "land boundary 2": [4, 5, 6, 7],
    }  # fmt: skip
    held = document.source.held
    assert held is not None
    assert np.flatnonzero(held).tolist() == [4, 5, 6, 7]
    assert document.source.arrays.point["depth"][:2].tolist() == [-1.5, -3]
    assert "depths stay with their nodes, also where these move" in document.source.notes


def test_quads_and_triangles(tmp_path: Path) -> None:
    points, blocks = MESHES["quads and triangles"]()
    (tmp_path / "hgrid.gr3").write_text(file(points, [row for _, rows in blocks for row in (rows + 1).tolist()]))
    document = read(tmp_path / "hgrid.gr3")
    assert document.not_judged == {}
    assert not document.mesh.topology.flipped.any()


def test_nodes_have_numbers() -> None:
    text = SQUARE.replace("\n         5 ", "\n        50 ").replace(" 5\n", " 50\n")
    source = parse(text.encode())
    assert source.cells[0].vertices.tolist() == [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]


@pytest.mark.parametrize("title", ["", "$grid", "mesh 4 5", "5 4"])
def test_titles(title: str) -> None:
    text = title + SQUARE.removeprefix("a grid")
    form = sniff(text.encode())
    assert form is not None
    assert form.name == "adcirc"
    assert len(parse(text.encode()).points) == 5


@pytest.mark.parametrize("text", ["4 1\n1 1 2 3\n2 2 3 4\n", "# made\n12 1\n1 3 4 1\n2 4 5 1\n", "5\nwater\n1 0 0 0\n"])
def test_other_tables_are_none(text: str) -> None:
    form = sniff(text.encode())
    assert form is None or form.name != "adcirc"


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("4 5 !", "4 6 !", "line 12: '=' is not an integer"),
        ("4 5 !", "4 x !", "its second line has no numbers"),
        ("4 5 !", "40 5 !", "40 elements announced"),
        ("4 3 4 1 5", "4 3 4 1 6", "the cell 4 names the point 6"),
        ("4 3 4 1 5", "4 -3 4 1 5", "an element has -3 nodes"),
        ("4 3 4 1 5", "4 4 4 1 5", "there are not 6 numbers"),
        ("0.50000000 ", "0.5x000000 ", "is not a number"),
        ("2 0\n3\n4\n", "2 0\n3\n", "2 nodes of a boundary announced"),
        ("2 0\n3\n4\n", "2 0\n3\n9\n", "the land boundary 1 names a node that is not there"),
        ("1 = land", "x = land", "'x' is not an integer"),
        ("1 = land", "-1 = land", "is below 0"),
        ("1 = land boundaries\n2\n2 0\n3\n4\n", "1 = land boundaries\n", "its boundaries are not all there"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after, 1).encode())
