"""FreeFEM's files: labels, the three kinds of meshes, what their first lines tell, and faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from files_freefem import FILES, edges, file, solid
from files_medit import material
from shapes import block, plate

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.formats import sniff
from meshfix_cli.meshfile.freefem import parse
from meshfix_cli.meshfile.groups import groups_of

SQUARE = (
    "5 4 4\n0 0 1\n1 0 1\n1 1 1\n0 1 1\n0.5 0.5 0\n1 2 5 0\n2 3 5 0\n3 4 5 0\n4 1 5 0\n1 2 7\n2 3 8\n3 4 8\n4 1 8\n"
)


def test_labels_are_regions_and_those_of_the_boundary_are_sets(tmp_path: Path) -> None:
    solid(tmp_path / "in.msh")
    document = read(tmp_path / "in.msh")
    held = document.mesh.topology.interface(material(*block()))
    assert held.any()
    assert not document.mesh.movable[held].any()
    assert list(groups_of(document.source)) == ["boundary 3", "boundary 4"]


def test_labels_of_vertices_are_data() -> None:
    assert parse(SQUARE.encode()).arrays.point["freefem:label"].tolist() == [1, 1, 1, 1, 0]
    assert groups_of(parse(SQUARE.encode()))["boundary 7"].points.tolist() == [0, 1]


def test_a_surface_in_space(tmp_path: Path) -> None:
    points, cells = plate()
    bent = points + [0, 0, 0.5] * points[:, :1] ** 2
    text = file(bent, cells, np.zeros(len(cells), dtype=np.int64), edges(cells))
    source = parse(text.encode())
    assert [run.type for run in source.cells] == ["triangle", "line"]
    np.testing.assert_array_equal(source.points, bent)


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (SQUARE, True),
        (SQUARE.replace("0.5 0.5 0", "1 1 0"), True),
        (SQUARE.replace("\n", "\r"), True),
        ("4 3 0\n1 1 2 5\n2 2 3 5\n3 3 4 5\n4 4 1 5\n", False),  # Triangle's elements
        ("4 3 0\n1 1 2 5\n2 2 3 5\n3 3 4 5\n4 4 1 5\n# made\n# by\n# hand\n", False),
        ("5 2 0 0\n1 0 0\n2 1 0\n", False),  # its nodes
        ("5 4 4\n0 0.5 1\n1 0 1\n", True),  # cut
        ("3 2 1\n1 2\n2 3\n", False),
    ],
)
def test_counts_and_vertices_tell_the_format(text: str, found: bool) -> None:
    form = sniff(text.encode())
    assert (form is not None and form.name == "freefem") == found


@pytest.mark.parametrize("variant", FILES)
def test_other_names(variant: str, tmp_path: Path) -> None:
    FILES[variant](tmp_path / "mesh.txt")
    assert read(tmp_path / "mesh.txt").format.name == "freefem"


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("5 4 4", "6 4 4", "has 3 numbers|1 boundary element|4 boundary elements announced"),
        ("5 4 4", "5 4 5", "5 boundary elements announced"),
        ("5 4 4", "5 4 3", "there are more lines than announced"),
        ("5 4 4", "5 x 4", "'x' is not an integer"),
        ("5 4 4", "5 -4 4", "-4 elements announced"),
        ("0 0 1\n", "0 1\n", "neither two nor three coordinates"),
        ("1 0 1\n", "1 0\n", "line 3: there are not 3 numbers"),
        ("4 1 5 0", "4 1 6 0", "the cell 4 names the point 6"),
        ("4 1 5 0", "4 1 5 5 0", "line 10: a line of an element has 5 numbers"),
        ("0.5 0.5", "0.5 0.x5", "'0.x5' is not a number"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after, 1).encode())
