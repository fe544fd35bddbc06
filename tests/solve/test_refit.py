"""The surface that points sample: quadrics are found exactly, and where nothing is told points stay."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from meshfix_cli.solve.refit import refitted

Array = NDArray[np.float64]


def sphere(count: int) -> Array:
    points = np.random.default_rng(0).standard_normal((count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


@pytest.mark.parametrize("threads", [1, 2])
def test_points_off_a_quadric_come_back_to_it(threads: int) -> None:
    random = np.random.default_rng(1)
    x, y = random.uniform(-1, 1, (2, 3000))
    sample = np.column_stack([x, y, 0.3 * x**2 - 0.2 * x * y + 0.1 * y - 0.5])
    seen = np.tile([0.0, 0.0, 1.0], (3000, 1))
    rows = np.flatnonzero((np.abs(x) < 0.9) & (np.abs(y) < 0.9))
    points = sample.copy()
    points[rows, 2] += 0.01 * random.standard_normal(len(rows))
    found = refitted(points, rows, seen, sample, seen, threads)
    np.testing.assert_allclose(found[rows], sample[rows], atol=1e-8)  # what is added to the equations for their rank
    others = np.setdiff1d(np.arange(3000), rows)
    np.testing.assert_array_equal(found[others], points[others])
    np.testing.assert_array_equal(found, refitted(points, rows, seen, sample, seen))


def test_the_wall_across_tells_nothing() -> None:
    outer = sphere(4000)
    sample, seen = np.concatenate([outer, 0.99 * outer]), np.concatenate([outer, -outer])
    points = np.concatenate([0.995 * outer, 0.99 * outer])
    found = refitted(points, np.arange(4000), seen, sample, seen)
    assert np.median(np.abs(np.linalg.norm(found[:4000], axis=1) - 1)) < 1e-4


def test_points_of_no_surface_stay() -> None:
    sample = np.random.default_rng(2).uniform(-1, 1, (500, 3))
    up = np.tile([0.0, 0.0, 1.0], (500, 1))
    rows = np.arange(500)
    moved = (refitted(sample, rows, up, sample, up) != sample).any(axis=1)
    assert moved.mean() < 0.05
    few, normals = sample[:6], up[:6]
    np.testing.assert_array_equal(refitted(few, rows[:6], normals, few, normals), few)
    np.testing.assert_array_equal(refitted(sample, rows, 0 * up, sample, up), sample)
    away = np.where(rows[:, None] < 2, [[np.nan, 0.0, 0.0]], sample)
    np.testing.assert_array_equal(refitted(away, rows[:2], up, sample, up)[2:], sample[2:])
