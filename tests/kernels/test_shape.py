"""The shape of all elements as one energy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from meshes import tangle

from meshfix_cli import Mesh, kernels, untangle
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.solve.region import Region
from meshfix_cli.solve.shape import Goal, shaped

GOAL = (30.0, 12.0, 0.0, 1.5, 0.0, 0.0)  # degrees, degrees, measure, weight, sharpness, evenness
NO_CORNERS = np.empty(0), np.empty(0, dtype=np.int32), np.empty((0, 8), dtype=np.int32)


def region_of(mesh: Mesh) -> tuple[np.ndarray, Region]:
    points = mesh.along_curve(mesh.points)
    region = Region(mesh.topology.stars(1), mesh.along_curve(mesh.movable))
    return points[region.vertices], region


def valid(mesh: Mesh) -> Mesh:
    """Valid, and far from the best."""
    return untangle(tangle(mesh, 30, 0.5), smooth=0).after


def test_the_energy_is_that_of_the_metrics(mesh: Mesh) -> None:
    start = valid(mesh)
    points, region = region_of(start)
    energy, _ = kernels.shape_energy(points, region.simplices, *NO_CORNERS, len(region.moving), *GOAL, 1)
    own = start.movable[start.topology.simplices].any(axis=1)
    ratio, angle = evaluate("mean_ratio", start)[own], evaluate("min_angle", start)[own]
    goal, floor, _, weight, *_ = GOAL
    below = np.maximum(0, goal - angle) ** 2 + 30 * np.maximum(0, floor - angle) ** 2
    assert (below > 0).any()
    assert energy == pytest.approx((-100 * ratio - 0.3 * angle + weight * below).sum(), rel=1e-9)


@pytest.mark.parametrize("share", [0.0, 3.0])
def test_the_gradient_is_right(mesh: Mesh, share: float, random: np.random.Generator) -> None:
    start = valid(mesh)
    points, region = region_of(start)
    free, d = len(region.moving), points.shape[1]
    goal = (*GOAL[:2], share * start.check()[1], *GOAL[3:])
    _, gradient = kernels.shape_energy(points, region.simplices, *NO_CORNERS, free, *goal, 1)
    centre = points.mean(axis=0)
    unit = np.linalg.norm(points - centre, axis=1).max() / len(points) ** (1 / d)
    for _ in range(5):
        way = random.standard_normal((free, d))
        ends = []
        for step in (1e-7, -1e-7):
            there = points.copy()
            there[:free] += step * unit * way
            ends.append(kernels.shape_energy(there, region.simplices, *NO_CORNERS, free, *goal, 1)[0])
        assert (gradient * way).sum() == pytest.approx((ends[0] - ends[1]) / 2e-7, rel=1e-4)


def test_no_step_leads_out_of_the_valid_meshes(mesh: Mesh) -> None:
    points, region = region_of(tangle(mesh, 30, 2))
    assert kernels.shape_energy(points, region.simplices, *NO_CORNERS, len(region.moving), *GOAL, 1)[0] == math.inf
    start = valid(mesh)
    free = start.along_curve(start.movable)
    after = start.with_vertices(shaped(start.along_curve(start.points), start.topology.stars(1), free, Goal(25.0), 1))
    assert after.check()[0] == 0
    assert (after.points[~start.movable] == start.points[~start.movable]).all()
    for metric in ("mean_ratio", "min_angle"):
        assert evaluate(metric, after).mean() > evaluate(metric, start).mean()


def test_the_bits_are_those_of_one_thread_and_the_units_do_not_matter(fine: Mesh) -> None:
    start = valid(fine)
    points, free = start.along_curve(start.points), start.along_curve(start.movable)
    results = [shaped(points, start.topology.stars(1), free, Goal(25.0, 10.0), threads) for threads in (1, 2, 3)]
    assert len({result.tobytes() for result in results}) == 1
    far = shaped(1e3 * points + 5.0, start.topology.stars(1), free, Goal(25.0, 10.0), 1)
    h = start.mean_edge_length()
    assert np.abs((far - 5.0) / 1e3 - results[0]).max() < 1e-2 * h


def test_a_floor_holds_the_worst(mesh: Mesh) -> None:
    start = untangle(tangle(mesh, 30, 0.5)).after
    points, free = start.along_curve(start.points), start.along_curve(start.movable)
    own = start.movable[start.topology.simplices].any(axis=1)
    worst = evaluate("min_angle", start)[own].min()
    ends = [
        start.with_vertices(shaped(points, start.topology.stars(1), free, Goal(worst + 3, f), 1)) for f in (0.0, worst)
    ]
    without, held = (evaluate("min_angle", end)[own].min() for end in ends)
    assert held >= min(without, worst)
    assert held > worst - 0.5


def test_the_smallest_measure_is_kept(mesh: Mesh) -> None:
    for tangled in (tangle(mesh, 5, 0.3), tangle(mesh, 30, 0.5)):
        start = untangle(tangled, smooth=1).after
        outcome = untangle(start, smooth="best")
        assert outcome.after.check()[1] >= start.check()[1]
        assert outcome.after is not start
