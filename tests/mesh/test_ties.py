"""Nodes between corners: which they are, whether they lie there, and how they follow."""

from __future__ import annotations

import numpy as np
import pytest
from elements import MESHES
from refined import COMPLETE, SERENDIPITY, middles, refined

from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.ties import Ties, curved, ties_of

TRIANGLES = np.array([[0, 1, 2, 4, 5, 6], [2, 1, 3, 5, 7, 8]])
SQUARE = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [0.5, 0], [0.5, 0.5], [0, 0.5], [1, 0.5], [0.5, 1]])


def ties() -> Ties:
    return ties_of([(ELEMENTS["triangle6"], TRIANGLES)], len(SQUARE))[0]


@pytest.mark.parametrize("types", [SERENDIPITY, COMPLETE], ids=["serendipity", "complete"])
@pytest.mark.parametrize("name", ["quads and triangles", "every solid"])
def test_each_node_is_between_its_corners_once(name: str, types: dict[str, str]) -> None:
    points, cells = refined(*MESHES[name](), types)
    found, at_odds = ties_of([(ELEMENTS[key], rows) for key, rows in cells], len(points))
    assert not at_odds.any()
    expected = middles(cells)
    assert {node for tie in found.groups for node in tie.nodes.tolist()} == set(expected)
    assert sum(len(tie.nodes) for tie in found.groups) == len(expected) == found.nodes.sum()
    for tie in found.groups:
        for node, corners, weights in zip(tie.nodes.tolist(), tie.corners.tolist(), tie.weights, strict=True):
            order = np.argsort(expected[node][0])
            assert corners == expected[node][0][order].tolist()
            np.testing.assert_allclose(weights, expected[node][1][order])
    assert not curved([(ELEMENTS[key], rows) for key, rows in cells], found, points).any()


def test_nodes_follow_corners_that_moved_to_the_last_bit() -> None:
    points, moved = SQUARE.copy(), np.zeros(9, dtype=bool)
    points[0], moved[0] = (0.1, 1 / 3), True
    points[7] += 1e-9  # which no corner takes along
    before = points.copy()
    followed = ties().follow(points, moved)
    assert np.flatnonzero(followed).tolist() == [4, 6]
    assert points[4].tolist() == ((before[0] + before[1]) / 2).tolist()
    assert points[6].tolist() == ((before[0] + before[2]) / 2).tolist()
    rest = ~followed
    assert points[rest].tobytes() == before[rest].tobytes()
    single = SQUARE.astype(np.float32)
    single[0] = before[0]
    ties().follow(single, moved)
    assert single[4].tolist() == ((single[0].astype(float) + single[1]) / 2).astype(np.float32).tolist()


@pytest.mark.parametrize("node", range(4, 9))
def test_a_node_that_is_elsewhere_is_off(node: int) -> None:
    for shift, expected in ((1e-12, []), (1e-4, [node]), (0.1, [node]), (1e6, [node])):
        points = SQUARE + np.array([np.pi, np.e])
        points[node, 1] += shift
        assert np.flatnonzero(ties().off(points, lambda: np.ones(9))).tolist() == expected


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e30])
def test_what_is_rounded_is_not_off(size: float) -> None:
    """To few digits, or to single precision, far from the origin; but not by more than these leave."""
    random = np.random.default_rng(5)
    triangles = [(ELEMENTS["triangle6"], np.arange(9 * 500).reshape(-1, 9)[:, TRIANGLES].reshape(-1, 6))]
    found = ties_of(triangles, 9 * 500)[0]
    corners = random.uniform(-0.2, 0.2, (500, 4, 2)) + SQUARE[:4]
    between = [corners[:, ends].mean(axis=1) for ends in ([0, 1], [1, 2], [0, 2], [1, 3], [2, 3])]
    points = np.concatenate([corners, np.stack(between, axis=1)], axis=1).reshape(-1, 2)
    for offset in (0, 10, 100):
        there = (points + offset) * size
        six, seven = (np.array([float(f"{x:.{n}g}") for x in there.ravel()]).reshape(-1, 2) for n in (6, 7))
        for rounded in (there, seven, six, there.astype(np.float32), there.astype(np.float32).astype(float)):
            assert not curved(triangles, found, rounded).any()
            rounded[found.nodes] += 0.02 * size
            assert curved(triangles, found, rounded).all()


def test_corners_stay_where_a_node_between_them_is_held() -> None:
    held = np.zeros(9, dtype=bool)
    held[[3, 4]] = True
    assert np.flatnonzero(ties().with_corners(held)).tolist() == [0, 1, 3, 4]


def test_an_element_with_nodes_between_other_corners_is_at_odds() -> None:
    other = TRIANGLES.copy()
    other[1, 3:] = [8, 7, 5]
    _, at_odds = ties_of([(ELEMENTS["triangle6"], other)], 9)
    assert at_odds.tolist() == [False, True]
    quad = np.array([[0, 1, 3, 2, 4, 7, 8, 6, 5]])  # whose middle is that of a diagonal, too
    _, at_odds = ties_of([(ELEMENTS["triangle6"], TRIANGLES), (ELEMENTS["quad9"], quad)], 9)
    assert at_odds.tolist() == [False, False, True]


def test_collapsed_elements_have_nodes_between_fewer_corners() -> None:
    """A corner may be the node on an edge that is lost, or have one beside it."""
    quad = np.array([[0, 1, 2, 2, 3, 4, 2, 5], [0, 1, 2, 2, 3, 4, 6, 5]])
    found, at_odds = ties_of([(ELEMENTS["quad8"], quad)], 7)
    assert not at_odds.any()
    pairs = {
        node: list(zip(corners, weights, strict=True))
        for tie in found.groups
        for node, corners, weights in zip(tie.nodes.tolist(), tie.corners.tolist(), tie.weights.tolist(), strict=True)
    }
    half = 0.5
    assert pairs == {3: [(0, half), (1, half)], 4: [(1, half), (2, half)], 5: [(0, half), (2, half)], 6: [(2, 1.0)]}
    middle = ties_of([(ELEMENTS["quad9"], np.array([[0, 1, 2, 2, 3, 4, 2, 5, 6]]))], 7)[0]
    (tie,) = [tie for tie in middle.groups if 6 in tie.nodes]
    assert dict(zip(tie.corners[0].tolist(), tie.weights[0].tolist(), strict=True)) == {0: 0.25, 1: 0.25, 2: 0.5}


def test_numbers_and_coordinates_that_cannot_be_are_refused() -> None:
    with pytest.raises(InvalidMeshError, match=r"element 1 refers to vertices \[2, 1, 3, 5, 7, 9\]"):
        ties_of([(ELEMENTS["triangle6"], np.where(TRIANGLES == 8, 9, TRIANGLES))], 9)
    points = SQUARE.copy()
    points[6, 1] = np.nan
    with pytest.raises(InvalidMeshError, match="vertex 6 has a coordinate that is not finite"):
        ties().off(points, lambda: np.ones(9))
