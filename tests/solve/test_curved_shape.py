"""Shapes of curved elements: the smallest scaled Jacobians rise, and nothing pays for it."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from bent import FAMILIES, HIGHER, curved, mesh_of, straight
from geometries import grid
from monomials import jacobians, positions
from refined import SERENDIPITY, refined

from meshfix_cli.mesh.judged import VALID
from meshfix_cli.mesh.quadratic import Array, Quadratic
from meshfix_cli.repair import Method
from meshfix_cli.solve.curved_shape import KEPT, better_shapes
from meshfix_cli.solve.limits import Limits


def size(key: str) -> float:
    """How far nodes are moved, of the edges: elements are bad, and valid."""
    return 0.02 if key in HIGHER else 0.1


def risen(quadratic: Quadratic, points: Array, limits: Limits, highest: float = 1.0) -> list[Array]:
    return [points, *better_shapes(quadratic, points, limits, limits.free, highest, thorough=True)]


@pytest.mark.parametrize("key", list(FAMILIES))
def test_each_step_is_better_and_nothing_pays(key: str) -> None:
    quadratic, points, free = curved(key, size(key))
    found = risen(quadratic, points, Limits(free, points))
    judged = [quadratic.judge(one, 1) for one in found]
    assert len(found) > 1
    smallest = [float(one.scaled_jacobians[quadratic.with_one(free)].min()) for one in judged]
    assert all(after > before for before, after in pairwise(smallest))
    for before, after in pairwise(judged):
        assert (after.verdicts == VALID).all()
        assert (after.smallest >= np.minimum(before.smallest, KEPT)).all()
    assert found[-1][~free].tobytes() == points[~free].tobytes()


@pytest.mark.parametrize("key", ["triangle6", "tetra10", "hexahedron20"])
def test_threads_make_no_difference_and_no_node_goes_too_far(key: str) -> None:
    quadratic, points, free = curved(key, size(key))
    limits = Limits(free, points, 0.05)
    found = [risen(quadratic, points, replace(limits, threads=threads))[-1] for threads in (1, 2, 3)]
    assert found[0].tobytes() == found[1].tobytes() == found[2].tobytes()
    assert 0 < np.linalg.norm(found[0] - points, axis=1).max() <= 0.05 * (1 + 1e-12)


def test_what_is_well_enough_or_held_stays() -> None:
    quadratic, points, free = curved("triangle6", 0.1)
    low = float(quadratic.judge(points, 1).scaled_jacobians.min())
    assert len(risen(quadratic, points, Limits(free, points), low)) == 1
    assert len(risen(quadratic, points, Limits(np.zeros_like(free), points))) == 1


def test_the_best_of_all_is_no_worse_than_it_came() -> None:
    """Corners move as well, as those of straight elements do: what comes out is better than either alone."""
    points, rows = straight("tetra10")
    quadratic, points, free = curved("tetra10", 0.05)
    mesh = mesh_of(quadratic, points, "tetra10", rows, free)
    before = quadratic.judge(mesh.points, 1).scaled_jacobians.min()
    results = {}
    for smooth in ("auto", "best"):
        after = Method(smooth=smooth).solve(mesh, math.inf, 1).after
        results[smooth] = quadratic.judge(after.points, 1).scaled_jacobians.min()
        assert after.check()[0] == 0
    assert before <= results["auto"] <= results["best"]
    assert results["best"] > 1.5 * before
    nodes = after.points[rows[0]]
    assert jacobians("tetra10", nodes, positions("tetra10")).min() > 0


def test_an_element_that_is_held_does_not_keep_others_from_their_best() -> None:
    """It is the worst, whatever becomes of the others."""
    _, rows = straight("triangle6")
    quadratic, points, free = curved("triangle6", 0.1)
    inner = next(row for row in rows if free[row].all())
    free[inner] = False
    points[inner[3:]] += 0.3 * (points[inner[:3]].mean(axis=0) - points[inner[3:]])
    mesh = mesh_of(quadratic, points, "triangle6", rows, free).with_fixed(~free)
    before = quadratic.judge(points, 1).scaled_jacobians
    after = quadratic.judge(Method(smooth="best").solve(mesh, math.inf, 1).after.points, 1).scaled_jacobians
    others = quadratic.with_one(free)
    assert before[others].min() > before.min() == after.min()
    assert after[others].min() > before[others].min()
    assert after.mean() > before.mean()


def test_by_default_the_worst_rise_as_far_as_the_threshold_or_held_nodes_let_them() -> None:
    quadratic, points, free = curved("triangle6", 0.1)
    limits, some = Limits(free, points), quadratic.with_one(free)
    found = [points, *better_shapes(quadratic, points, limits, free, 0.5, thorough=False)]
    assert quadratic.judge(found[-1], 1).scaled_jacobians[some].min() >= 0.5
    low = int(np.flatnonzero(some & ~quadratic.with_one(~free))[0])  # of one that is free all edges become held
    rows = straight("triangle6")[1]
    free[rows[low, 3:5]] = False
    free[rows[low, :3]] = False
    points[rows[low, 3]] += 0.3 * (points[rows[low, 2]] - points[rows[low, 3]])
    assert quadratic.judge(points, 1).verdicts[low] == VALID
    held = quadratic.kernel.ceilings(points, free.astype(np.uint8), 1)
    found = [points, *better_shapes(quadratic, points, Limits(free, points), free, 1.0, thorough=False)]
    assert quadratic.judge(found[-1], 1).scaled_jacobians[low] == pytest.approx(held[low], rel=1e-6)


def test_the_best_of_what_is_valid_moves_nothing_where_only_what_is_invalid_may_move() -> None:
    quadratic, points, free = curved("triangle6", 0.1)
    mesh = mesh_of(quadratic, points, "triangle6", straight("triangle6")[1], free)
    after = Method(smooth="best", only_invalid=True).solve(mesh, math.inf, 1).after
    assert after.points.tobytes() == points.tobytes()


def sector(across: float, around: float) -> tuple[Quadratic, Array]:
    """Return two triangles of six nodes that fill a part of a ring, and their nodes, all of which lie on circles."""
    radius, angle = np.meshgrid(1 + across * np.linspace(0, 1, 3), around * np.linspace(0, 1, 3))
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 2)
    rows = np.array([[0, 2, 8, 1, 5, 4], [0, 8, 6, 4, 7, 3]], dtype=np.int32)
    return Quadratic([("triangle6", rows)], len(points)), points


@pytest.mark.parametrize(("across", "around"), [(1.0, 3.0), (0.1, 3.0), (1.0, 1.0)])
def test_what_is_valid_and_curved_keeps_its_shape_though_its_straight_elements_are_thin(
    across: float, around: float
) -> None:
    quadratic, points = sector(across, around)
    free = np.arange(len(points)) == 4
    mesh = mesh_of(quadratic, points, "triangle6", quadratic.nodes.reshape(2, 6), free)
    after = Method().solve(mesh, math.inf, 1).after
    before, there = (quadratic.judge(one.points, 1) for one in (mesh, after))
    assert (before.verdicts == VALID).all() and (there.verdicts == VALID).all()
    assert there.scaled_jacobians.min() >= before.scaled_jacobians.min()


def test_where_an_element_that_is_held_is_as_bad_as_the_worst_none_moves() -> None:
    """A shell is symmetric: those that nodes on the boundary keep bad are as bad as some that could rise."""
    points, rows = grid(*(np.linspace(0, 1, 3),) * 3)
    points, blocks = refined(points, [("tetra", rows)], SERENDIPITY)
    inside = np.asarray(((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1))
    radius, angle = 1 + 0.5 * points[:, 0], 2 * points[:, 1]
    bent = [radius * np.cos(angle), radius * np.sin(angle), points[:, 2] + 0.2 * np.sin(3 * points[:, 0])]
    points = np.stack(bent, axis=1)
    quadratic = Quadratic(blocks, len(points))
    before, held = quadratic.judge(points, 1), quadratic.kernel.ceilings(points, inside.astype(np.uint8), 1)
    assert (before.verdicts == VALID).all()
    worst = float(before.scaled_jacobians.min())
    assert held[before.scaled_jacobians <= worst * (1 + 1e-9)].min() == pytest.approx(worst)
    assert not list(better_shapes(quadratic, points, Limits(inside, points), inside, 0.26, thorough=False))


def test_the_highest_threshold_does_not_ask_for_all_that_best_does() -> None:
    quadratic, points, free = curved("triangle6", 0.1)
    mesh = mesh_of(quadratic, points, "triangle6", straight("triangle6")[1], free)
    records = Method(threshold=90.0).solve(mesh, math.inf, 1).records
    assert len(records) > 1
    assert not any("straight elements" in record.phase for record in records)
