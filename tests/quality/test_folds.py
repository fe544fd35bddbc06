"""Boundaries that fold back upon themselves in a line or a plane are named, and nothing that only touches is."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from bodies import BODIES, Body
from geometries import grid
from numpy.typing import NDArray
from programs import TILTED
from scipy.optimize import linprog

from meshfix_cli import kernels, untangle
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.obstacles import find_obstacles

COUNT = 7  # points along each axis of a block


def block(d: int) -> Body:
    """A square or a cube; its first coordinates are integers, so that what lies in a wall does so exactly."""
    points, cells = grid(*[np.arange(float(COUNT))] * d)
    return Body(points, cells.astype(np.int64))


def folded(random: np.random.Generator, body: Body) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Move two vertices within the wall where the last coordinate is 0, over some of their neighbours."""
    points, d = body.points.copy(), body.dimension
    inside = ((points[:, :-1] > 0) & (points[:, :-1] < COUNT - 1)).all(axis=1)
    moved = random.choice(np.flatnonzero((points[:, -1] == 0) & inside), 2, replace=False)
    points[moved, :-1] = random.integers(1, 4 * COUNT - 6, (2, d - 1)) / 4 + 1 / 8  # no fold is thinner than that
    return points, moved


def wall(body: Body) -> list[tuple[int, list[int]]]:
    """Each simplex with a facet in the wall, and the vertices of that."""
    found = [(row, [v for v in cell if body.points[v, -1] == 0]) for row, cell in enumerate(body.cells.tolist())]
    return [(row, facet) for row, facet in found if len(facet) == body.dimension]


def have_a_place_in_common(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether two simplices (d+1, d) do beyond their rims: HiGHS looks for the place that is deepest in both."""
    if (one.max(axis=0) <= other.min(axis=0)).any() or (other.max(axis=0) <= one.min(axis=0)).any():
        return False
    rows, bounds = [], []
    for corners in (one, other):
        shares = np.linalg.inv(np.column_stack([corners, np.ones(len(corners))])).T  # of each corner, as plane
        rows.append(np.column_stack([-shares[:, :-1], np.ones(len(corners))]))
        bounds.append(shares[:, -1])
    objective = [0.0] * one.shape[1] + [-1.0]
    best = linprog(objective, np.concatenate(rows), np.concatenate(bounds), bounds=[(None, None)] * len(objective))
    return bool(-best.fun > 1e-9)


@pytest.mark.parametrize("d", [2, 3])
def test_what_folds_in_a_wall_is_named_and_nothing_else(random: np.random.Generator, d: int) -> None:
    """Facets in the wall that have places in common fold, where both are turned over or none is."""
    body, named = block(d), 0
    facets = wall(body)
    before = {row: _sign(body.points[facet, :-1]) for row, facet in facets}
    for _ in range(5):
        points, moved = folded(random, body)
        turned = {row: _sign(points[facet, :-1]) * before[row] for row, facet in facets}  # 0: it has no size
        expected = {
            (row, other)
            for (row, mine), (other, theirs) in combinations(facets, 2)
            if np.isin(mine + theirs, moved).any() and turned[row] * turned[other] > 0
            if have_a_place_in_common(points[mine, :-1], points[theirs, :-1])
        }
        found = find_obstacles(Mesh.build(points, body.cells)).folding
        assert {tuple(pair) for pair in found.tolist()} == expected
        named += len(expected)
    assert named >= 5


def _sign(corners: NDArray[np.float64]) -> float:
    return float(np.sign(np.linalg.det(corners[1:] - corners[:1])))


@pytest.mark.parametrize("d", [2, 3])
def test_folds_are_found_wherever_the_wall_lies_and_end_the_work_early(random: np.random.Generator, d: int) -> None:
    body = block(d)
    points = body.points.copy()
    middle = np.full(d, float(COUNT // 2))
    middle[-1] = 0
    next_one = middle + np.eye(d)[0]
    pair = [int(np.flatnonzero((points == place).all(axis=1))[0]) for place in (middle, next_one)]
    points[pair] = points[pair[::-1]]
    expected = find_obstacles(Mesh.build(points, body.cells)).folding.tolist()
    assert expected
    turn = TILTED if d == 3 else np.array([[0.8, 0.6], [-0.6, 0.8]])
    for scale, offset in ((1.0, 0.0), (1e-6, 0.0), (1e9, 0.0), (1.0, 1e4)):
        mesh = Mesh.build((points @ turn) * scale + offset, body.cells)
        found = [find_obstacles(mesh, threads).folding.tolist() for threads in (1, 2)]
        assert found[0] == found[1] == expected
    outcome = untangle(Mesh.build(points, body.cells))
    assert not outcome.valid
    assert len([record for record in outcome.records if record.phase.startswith("FF")]) <= 30


@pytest.mark.parametrize(("d", "name"), [(d, name) for d, kinds in BODIES.items() for name in kinds])
def test_no_fold_is_found_in_a_valid_mesh(d: int, name: str) -> None:
    """Slits, cracks, contact and thin layers; all vertices are fixed, so that inner facets are looked at as well."""
    for seed in range(3):
        body = BODIES[d][name](np.random.default_rng([4, seed]))
        mesh = Mesh.build(body.points, body.cells)
        for one in (mesh, mesh.with_fixed(np.ones(mesh.topology.n, dtype=bool))):
            assert len(find_obstacles(one).folding) == 0


@pytest.mark.parametrize("thin", [1e-2, 1e-6, 1e-10])
@pytest.mark.parametrize("d", [2, 3])
def test_a_thin_layer_beside_a_thin_gap_is_no_fold(d: int, thin: float) -> None:
    """The lower sides of the layer and of what is beyond the gap have their insides on the same side."""
    heights = np.array([0.0, thin, 2 * thin, 1.0])
    points, cells = grid(*[np.arange(5.0)] * (d - 1), heights)
    middles = points[cells].mean(axis=1)
    gap = (middles[:, -1] > thin) & (middles[:, -1] < 2 * thin) & (middles[:, 0] < 3)
    mesh = Mesh.build(points, cells[~gap])
    assert not find_obstacles(mesh.with_fixed(np.ones(mesh.topology.n, dtype=bool)))


def test_facets_of_two_simplices_have_their_insides_on_both_sides() -> None:
    points = np.array([(0.0, 0), (2, 0), (1, 0), (3, 0)])
    for facets, shared, found in (
        ([(0, 1), (2, 3)], (0, 0), 1),
        ([(0, 1), (3, 2)], (0, 0), 0),
        ([(0, 1), (3, 2)], (0, 1), 1),
        ([(0, 2), (1, 3)], (1, 1), 0),
        ([(0, 2), (2, 1)], (1, 1), 0),
    ):
        facets_of, sides = np.array(facets, dtype=np.int32), np.array(shared, dtype=np.uint8)
        assert len(kernels.crossings_and_folds(points, facets_of, sides, 1)[1]) == found
