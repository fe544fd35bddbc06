"""Where not all of a star can be right: the fewest that are wrong anywhere, found by trying all sets to leave out."""

from __future__ import annotations

from itertools import combinations
from time import process_time

import numpy as np
import pytest
from meshes import relocate
from numpy.typing import NDArray
from scipy.optimize import linprog

from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.solve.strategies import Move

CLEAR = 1e-6  # height
RING = [[0, i + 1, (i + 1) % 7 + 1] for i in range(7)]
OCTAHEDRON = [[0, 1 + i, 3 + j, 5 + k] for i in (0, 1) for j in (0, 1) for k in (0, 1)]


def star(seed: int, d: int) -> Mesh:
    """Return the fan of a polygon, or of an octahedron, that crosses itself, about vertex 0."""
    random = np.random.default_rng(seed)
    if d == 2:
        angles = np.sort(random.uniform(0, 2 * np.pi, 7))
        around = np.stack([np.cos(angles), np.sin(angles)], axis=1) * random.uniform(0.1, 1, (7, 1))
    else:
        around = np.repeat(np.eye(3), 2, axis=0) * np.tile([-1, 1], 3)[:, None] + random.normal(0, 0.3, (6, 3))
    around[random.integers(len(around))] *= -1
    points = np.concatenate([random.normal(0, 0.3, (1, d)), around])
    return Mesh.build(points, [("triangle", RING) if d == 2 else ("tetra", OCTAHEDRON)])


def heights(points: NDArray[np.float64], simplices: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return rows (n, c): at x the height of the first vertex, put there, over the facet opposite is c + n.x."""
    rows = []
    for simplex in simplices:
        here, d = list(simplex).index(0), points.shape[1]
        values = []
        for x in (np.zeros(d), *np.eye(d)):
            corners = points[simplex]
            corners[here] = x
            values.append(np.linalg.det(corners[1:] - corners[0]))
        gradient = np.array(values[1:]) - values[0]
        rows.append(np.append(gradient, values[0]) / np.linalg.norm(gradient))
    return np.array(rows)


def fewest_wrong(rows: NDArray[np.float64]) -> int:
    """Return how many have to be left out, so that somewhere all others are positive."""
    d = rows.shape[1] - 1
    for count in range(len(rows)):
        for out in combinations(range(len(rows)), count):
            kept = np.delete(rows, out, axis=0)
            constraints = np.column_stack([-kept[:, :d], np.ones(len(kept))])
            bounds = [(-2, 2)] * d + [(None, None)]
            if -linprog([0] * d + [-1], constraints, kept[:, d], bounds=bounds).fun > CLEAR:
                return count
    return len(rows)


@pytest.mark.parametrize("d", [2, 3])
def test_few_are_wrong_where_not_all_can_be_right(d: int) -> None:
    fewest, excess = [], []
    for seed in range(60 if d == 2 else 30):
        mesh = star(seed, d)
        rows, points = heights(mesh.points, mesh.topology.simplices), mesh.points.copy()
        for blocks in mesh.topology.colours:
            relocate(mesh, Move.UNTANGLE_MOST, points, blocks)
        before, after = (int((rows[:, :d] @ p[0] + rows[:, d] <= 0).sum()) for p in (mesh.points, points))
        assert (points[1:] == mesh.points[1:]).all() and after <= before
        fewest.append(fewest_wrong(rows))
        excess.append(after - fewest[-1])
    assert 0 in fewest and max(fewest) >= 2
    assert set(excess) <= {0, 1}
    assert np.mean(excess) < 0.05  # what is left out is chosen one by one


def test_a_star_of_very_many_elements_takes_no_time() -> None:
    """What does not hold the optimum down is not tried: with all that are wrong it would be minutes here."""
    n, random = 1500, np.random.default_rng(0)
    angles = 2 * np.pi * (np.arange(n) + random.uniform(-18, 18, n)) / n
    points = np.concatenate([[[0.01, 0.02]], np.stack([np.cos(angles), np.sin(angles)], axis=1)])
    mesh = Mesh.build(points, [("triangle", [[0, i + 1, (i + 1) % n + 1] for i in range(n)])])
    assert mesh.check()[0] > n / 3
    start = process_time()
    for blocks in mesh.topology.colours:
        relocate(mesh, Move.UNTANGLE_MOST, points.copy(), blocks)
    assert process_time() - start < 5
