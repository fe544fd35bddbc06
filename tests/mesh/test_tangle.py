"""The surface that points sample: quadrics are found exactly, and what only a tangle makes a feature of is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import surface_bodies
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.curved import Smooth
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.surface import laid_by_default
from meshfix_cli.mesh.tangle import SMOOTH, Tangle
from meshfix_cli.quality.summary import summarise

Array = NDArray[np.float64]


def sphere(count: int) -> Array:
    points = np.random.default_rng(0).standard_normal((count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def refitted(points: Array, rows: NDArray[np.integer], normals: Array, sample: Array, seen: Array) -> Array:
    one, other = points.copy(), points.copy()
    for found, threads in ((one, 1), (other, 2)):
        kernels.Sample(sample, seen).refit(found, rows.astype(np.int32), normals, SMOOTH, threads)
    np.testing.assert_array_equal(one, other)
    return one


def test_points_off_a_quadric_come_back_to_it() -> None:
    random = np.random.default_rng(1)
    x, y = random.uniform(-1, 1, (2, 3000))
    sample = np.column_stack([x, y, 0.3 * x**2 - 0.2 * x * y + 0.1 * y - 0.5])
    seen = np.tile([0.0, 0.0, 1.0], (3000, 1))
    rows = np.flatnonzero((np.abs(x) < 0.9) & (np.abs(y) < 0.9))
    points = sample.copy()
    points[rows, 2] += 0.01 * random.standard_normal(len(rows))
    found = refitted(points, rows, seen, sample, seen)
    np.testing.assert_allclose(found[rows], sample[rows], atol=1e-8)  # what is added to the equations for their rank
    others = np.setdiff1d(np.arange(3000), rows)
    np.testing.assert_array_equal(found[others], points[others])
    left = kernels.Sample(sample, seen).left(sample[rows], seen[rows], 1)
    assert left[:, 0].max() < 1e-7


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
    assert np.isinf(kernels.Sample(few, normals).left(few, normals, 1)[:, 0]).all()
    np.testing.assert_array_equal(refitted(sample, rows, 0 * up, sample, up), sample)
    away = np.where(rows[:, None] < 2, [[np.nan, 0.0, 0.0]], sample)
    np.testing.assert_array_equal(refitted(away, rows[:2], up, sample, up)[2:], sample[2:])


def test_edges_and_corners_are_no_quadrics_and_a_corner_is_farthest_from_one() -> None:
    x, y = (one.ravel() for one in np.meshgrid(np.arange(-8.0, 9.0), np.arange(-8.0, 9.0)))
    hip = np.column_stack([x, y, -np.maximum(np.abs(x), np.abs(y))])
    up = np.tile([0.0, 0.0, 1.0], (len(hip), 1))
    left, share = kernels.Sample(hip, up).left(hip, up, 1).T
    inner, on_edge = np.hypot(x, y) < 6, np.abs(x) == np.abs(y)
    assert left[inner & on_edge].min() > 0.03 and left[(np.abs(y) < 2) & (np.abs(x) == 5)].max() < 1e-7
    assert share[(x == 0) & (y == 0)][0] > 1.2


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("body", ["ellipsoid", "torus", "cylinder", "part"])
def test_a_tangle_hides_no_feature_and_makes_few(body: str, seed: int) -> None:
    whole = surface_bodies.BODIES[body]()
    folded = surface_bodies.tangled(whole, 25, 1.5, seed)
    mesh = laid_by_default(Mesh.build(folded.points, folded.cells), Smooth(40.0, 0.03 * whole.h))
    tangle, on_edges = Tangle.of(mesh), mesh.along_curve(whole.of_points == surface_bodies.HELD)
    assert mesh.freedom is not None and tangle.features[on_edges].all()
    seeming = (mesh.freedom.degrees < 2) & ~on_edges
    assert seeming.sum() > 50 and (tangle.features & ~on_edges).sum() <= 0.05 * seeming.sum()
    assert not tangle.plain[tangle.features].any()


def test_borders_of_regions_and_lines_are_always_features() -> None:
    whole = surface_bodies.torus(32, 12)
    folded = surface_bodies.tangled(whole, 25, 1.5)
    mesh = Mesh.build(folded.points, folded.cells)
    plain = laid_by_default(mesh, Smooth(40.0, 0.1))
    assert plain.surface is not None and plain.surface.kept is not None
    start, end = mesh.topology.edges()
    kept = plain.surface.kept
    labels = (np.arange(len(whole.cells)) < 300).astype(np.int64)[mesh.topology.connectivity.rows]
    numbers, simplices = np.arange(len(whole.points)), mesh.topology.connectivity.simplices
    expected = np.isin(numbers, simplices[labels == 0]) & np.isin(numbers, simplices[labels == 1])
    lines = np.stack([start[:5], end[:5]], axis=1)
    kept = replace(kept, labels=labels, lines=lines)
    tangle = Tangle.of(replace(plain, surface=replace(plain.surface, kept=kept)))
    expected[lines] = True
    np.testing.assert_array_equal(tangle.always, expected)
    assert not (tangle.plain & expected).any()


@pytest.mark.parametrize("seed", range(6))
def test_a_tetrahedron_is_seen_from_outside(seed: int) -> None:
    """What is around each of its vertices is all of it, whose area as a vector is nothing but rounding."""
    random = np.random.default_rng(seed)
    points = random.standard_normal((4, 3)) + 10 * random.standard_normal(3)
    cells = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
    if np.linalg.det(points[1:] - points[0]) < 0:
        cells = cells[:, ::-1]
    assert summarise(Mesh.build(points, cells)).inverted == 0
