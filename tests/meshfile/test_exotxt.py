"""Exodus files as text: blocks, sets, orders of nodes, dialects, and faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elements import MESHES
from files_exodus import halves
from files_exotxt import FILES, file
from files_medit import surface
from second_order import element
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.exodus.exotxt import parse
from meshfix_cli.meshfile.exodus.types import ORDER
from meshfix_cli.meshfile.groups import groups_of

POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
SQUARE = file(POINTS, [(3, "TRI", np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]))], {5: [1, 2]}, {6: [(1, 1)]})


def test_blocks_and_sets(tmp_path: Path) -> None:
    FILES["solid.exotxt"](tmp_path / "in.exotxt")
    document = read(tmp_path / "in.exotxt")
    points, cells = block()
    inner, outer = halves(points, cells)
    groups = groups_of(document.source)
    assert {name: group.counts for name, group in groups.items()} == {
        "block_10": {3: len(inner)}, "block_20": {3: len(outer)}, "nodelist_7": {0: 3},
        "surface_4": {0: len(np.unique(surface(cells)))},
    }  # fmt: skip
    np.testing.assert_array_equal(groups["surface_4"].points, np.unique(surface(cells)))
    assert document.ids[:3].tolist() == [3, 6, 9]
    assert document.source.regions == ("exodus:block",)


@pytest.mark.parametrize("dimension", [2, 3])
def test_all_elements_are_read(dimension: int) -> None:
    points, listed = MESHES["quads and triangles" if dimension == 2 else "every solid"]()
    source = parse(
        file(points, [(i, key.upper(), rows.astype(np.int64)) for i, (key, rows) in enumerate(listed, 1)]).encode()
    )
    assert [run.type for run in source.cells] == [key for key, _ in listed]
    for run, (_, rows) in zip(source.cells, listed, strict=True):
        np.testing.assert_array_equal(run.vertices, rows)


@pytest.mark.parametrize("key", ["tetra10", "hexahedron20", "hexahedron27", "wedge15", "quad8"])
def test_nodes_of_second_order(key: str) -> None:
    """They take several lines, and have the order of Exodus."""
    nodes = element(key)[:, : ELEMENTS[key].shape.dimension]
    order = np.array(ORDER.get(key, range(len(nodes))))
    name = {"tetra": "TETRA", "hexah": "HEX", "wedge": "WEDGE", "quad8": "QUAD"}[key[:5]]
    (run,) = parse(file(nodes, [(1, name, np.argsort(order)[None])]).encode()).cells
    assert run.type == key
    np.testing.assert_array_equal(run.vertices, [np.arange(len(nodes))])


def test_lines_that_were_wrapped() -> None:
    source = parse(SQUARE.replace("node , dist fact", "node , dist\nfact").encode())
    assert source.points.tolist() == POINTS.tolist()


def test_a_number_never_touches_the_one_before_it() -> None:
    """A blank that lacks somewhere leaves a field that begins where the number before it ends."""
    text = SQUARE.replace("   1.0000000E+00   0.0000000E+00\n", "   1.0000000E+00  0.0000000E+00\n", 1)
    assert text != SQUARE
    source = parse(text.encode())
    moved = source.points + 1 / 3
    assert source.layout is not None
    np.testing.assert_allclose(parse(source.layout.rewritten(source.points, moved, {})).points, moved, atol=1e-9)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("! Database initial", "! Nothing", "it does not tell how many nodes and elements"),
        ("! Coordinates\n", "! Places\n", "it has no coordinates"),
        ("         5         4         1", "         6         4         1", "is not a number|6 rows announced"),
        ("         5         4         1", "         4         4         1", "there are more lines than announced"),
        ("         5         4         1", "         5         5         1", "5 elements announced, and not all"),
        ("         5         4         1", "         5         4         2", "4 elements announced, and not all"),
        ("5.0000000E-01", "5.0000000X-01", "'5.0000000X-01' is not a number"),
        ("         4         1         5\n", "         4         1         x\n", "'x' is not an integer"),
        ("         4         1         5\n", "         4         1\n", "is truncated: 4 rows announced|not an integer"),
        ("         5         2         2  ", "         5         3         2  ", "a set has not the 3 nodes"),
        ("TRI", "PAPER", "has elements called 'PAPER', which are not known"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after, 1).encode())


def test_a_node_that_is_not_there(tmp_path: Path) -> None:
    (tmp_path / "in.exotxt").write_text(
        SQUARE.replace("         4         1         5\n", "         4         1         9\n")
    )
    with pytest.raises(Exception, match="8"):
        read(tmp_path / "in.exotxt")
