"""SU2 files: zones, markers, numbers that may be left out, and what stands between."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from files_medit import surface
from files_su2 import FILES, plane, zones
from shapes import block, plate

from meshfix_cli import read
from meshfix_cli.errors import MeshfixError, ReadError
from meshfix_cli.mesh.lagrange import lattice
from meshfix_cli.meshfile.su2 import parse

SMALL = b"""NDIME= 2
NELEM= 3
5 0 1 4 0
9 1 2 3 4
5 0 4 3 2
NPOIN= 5
0 0 0
2 0 1
2 2 2
0 2 3
0.5 1 4
NMARK= 1
MARKER_TAG= wall
MARKER_ELEMS= 2
3 0 1 0
3 1 2 1
"""


def test_elements_keep_their_places_whatever_their_types() -> None:
    source = parse(SMALL)
    assert [(run.type, None if run.ids is None else run.ids.tolist()) for run in source.cells] == [
        ("triangle", [0]), ("quad", [1]), ("triangle", [2]), ("line", None),
    ]  # fmt: skip
    assert source.cells[1].vertices.tolist() == [[1, 2, 3, 4]]
    assert [rows.tolist() for rows in source.arrays.cell_sets["wall"]] == [[], [], [], [0, 1]]


def test_what_stands_between_is_another_programs_mesh(tmp_path: Path) -> None:
    for name, (points, cells) in {"plane.su2": plate(), "solid.su2": block()}.items():
        FILES[name](tmp_path / name)
        source = parse((tmp_path / name).read_bytes())
        np.testing.assert_array_equal(source.points, points[:, : cells.shape[1] - 1])
        np.testing.assert_array_equal(source.cells[0].vertices, cells)
        facets = np.concatenate([run.vertices for run in source.cells[1:]])
        np.testing.assert_array_equal(facets, surface(cells))
        assert list(source.arrays.cell_sets) == ["wall", "far field"]


def test_zones_are_parts_with_an_interface_of_their_own(tmp_path: Path) -> None:
    zones(tmp_path / "zones.su2")
    plane(tmp_path / "plane.su2")
    both, one = read(tmp_path / "zones.su2"), read(tmp_path / "plane.su2")
    assert both.mesh.topology.m == 2 * one.mesh.topology.m
    assert both.mesh.check()[0] == 2 * one.mesh.check()[0]
    assert both.source.regions == ("su2:zone",)
    assert both.ids.tolist() == list(range(both.mesh.topology.m))


def test_zones_that_lie_over_one_another_are_no_fault() -> None:
    square = SMALL.replace(b"5 0 4 3 2", b"5 0 4 3")
    source = parse(b"NZONE= 2\nIZONE= 1\n" + square + b"IZONE= 2\n" + square)
    assert source.apart
    assert len(source.points) == 10
    assert source.cells[4].vertices.tolist() == [[5, 6, 9]]


def bent(x: np.ndarray) -> np.ndarray:
    """Where a place in the unit cube goes: a polynomial of order 3 in the first coordinate alone."""
    moved = x.copy()
    moved[..., 1] += 0.2 * x[..., 0] ** 3
    return moved


@pytest.mark.parametrize(
    ("number", "places"),
    [
        (205, [(x, y) for y in range(4) for x in range(4 - y)]),
        (209, [(x, y) for y in range(4) for x in range(4)]),
        (210, [(x, y, z) for z in range(4) for y in range(4 - z) for x in range(4 - y - z)]),
        (212, [(x, y, z) for z in range(4) for y in range(4) for x in range(4)]),
        (213, [(x, y, z) for z in range(4) for y in range(4) for x in range(4 - y)]),
    ],
)  # fmt: skip
def test_nodes_of_higher_order_run_along_rows(number: int, places: list[tuple[int, ...]], tmp_path: Path) -> None:
    points = bent(np.array(places) / 3)
    lines = [f"NDIME= {points.shape[1]}", "NELEM= 1", " ".join(map(str, (number, *range(len(places)), 0)))]
    lines += [f"NPOIN= {len(points)}", *(" ".join(map(repr, point)) for point in points.tolist())]
    path = tmp_path / "one.su2"
    path.write_text("\n".join(lines) + "\n")
    document = read(path)
    assert document.mesh.quadratic is not None  # it is curved
    assert document.mesh.check()[0] == 0
    (run,) = document.source.cells
    expected = np.array(lattice(run.type.rstrip("0123456789"), 3, "vtk")) / 3
    np.testing.assert_allclose(document.source.points[run.vertices[0]], bent(expected), atol=1e-15)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (b"NELEM= 3", b"NELEM= 5", "line 8: there are more lines than announced"),
        (b"NPOIN= 5", b"NPOIN= 999999999999999999999", "is truncated: .* points announced"),
        (b"MARKER_ELEMS= 2", b"MARKER_ELEMS= 3", "is truncated: 3 elements announced"),
        (b"NELEM= 3", b"NELEM= 2", "line 5: there are more lines than announced"),
        (b"MARKER_ELEMS= 2", b"MARKER_ELEMS= 1", "line 16: there are more lines than announced"),
        (b"NPOIN= 5", b"NPOIN=", "line 6: NPOIN has no number"),
        (b"NDIME= 2", b"NDIME= 4", "NDIME is 4"),
        (b"5 0 1 4 0", b"199 0 1 4 0", "line 3: elements of the type 199 are not known"),
        (b"5 0 1 4 0", b"1105 0 1 4 0", "line 3: elements of the type 1105 are not known"),
        (b"9 1 2 3 4", b"9 1 2 3", "line 4: there are not 5 numbers"),
        (b"9 1 2 3 4", b"9 1 2 3 7", "the cell 1 names the point 7"),
        (b"0.5 1 4", b"0.5 x 4", "line 11: 'x' is not a number"),
        (b"NPOIN= 5", b"MPOIN= 5", "a zone has no NPOIN"),
    ],
)
def test_what_is_wrong_is_named(before: bytes, after: bytes, words: str) -> None:
    assert before in SMALL
    with pytest.raises(ReadError, match=words):
        parse(SMALL.replace(before, after))


@pytest.mark.parametrize("name", FILES)
def test_truncated(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    data = (tmp_path / name).read_bytes()
    end = data.rindex(b"MARKER_ELEMS") if b"MARKER" in data else data.rindex(b"NPOIN")
    for cut in range(1, end, max(1, end // 40)):
        (tmp_path / name).write_bytes(data[:cut])
        try:
            document = read(tmp_path / name)
        except MeshfixError:
            continue
        assert document.mesh.topology.m in (len(plate()[1]), 2 * len(plate()[1]), len(block()[1]))
