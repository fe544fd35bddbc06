"""The foldover-free energy where the boundary slides on curved surfaces and along curves."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from geometries import bent, rings, shell
from meshes import sliding, sliding_on_curves
from numpy.typing import NDArray

from meshfix_cli import kernels, untangle
from meshfix_cli.mesh.freedom import Freedom
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.solve import on_surfaces
from meshfix_cli.solve.foldover import minimisations_in_regions
from meshfix_cli.solve.perturb import perturb

Points = NDArray[np.float64]
MADE: dict[str, Callable[[], tuple[Points, NDArray[np.int32]]]] = {
    "shell": shell,
    "bent": bent,
    "disc": partial(rings, 1.0, 2.0, 60),
}


def freedom_of(mesh: Mesh) -> Freedom:
    assert mesh.freedom is not None
    return mesh.freedom


def tangled(name: str, percent: float = 10) -> Mesh:
    valid = Mesh.build(*MADE[name]())
    return perturb(sliding_on_curves(valid), percent, valid.mean_edge_length(), 0)[0]


def mended(mesh: Mesh, max_move: float = np.inf, threads: int = 1) -> tuple[Points, Points]:
    """Where the vertices were, and where they are after the last pass."""
    points, free = mesh.along_curve(mesh.points), mesh.along_curve(mesh.movable)
    judged = mesh.judged()
    broken = np.zeros(len(points), dtype=bool)
    broken[judged.vertices(judged.check(points, 1)[0])] = True
    given = mesh.topology.stars(threads), points, points, free, broken
    *_, last = on_surfaces.minimisations((1, 2, 4), max_move, threads, mesh.freedom, *given)
    return points, last


@pytest.mark.parametrize("name", MADE)
def test_what_touches_a_shape_is_tangent_to_it(name: str) -> None:
    """A small step along a direction is one on the shape, to second order."""
    freedom = freedom_of(sliding_on_curves(Mesh.build(*MADE[name]())))
    shapes = freedom.shapes
    assert shapes is not None
    d = shapes.corners.shape[2]
    places = np.ascontiguousarray(shapes.corners.mean(axis=1)[shapes.directions[shapes.shape] == d - 1])
    which = shapes.shape[shapes.directions[shapes.shape] == d - 1]
    on, _ = shapes.kernel.nearest(places, which, 1)
    axes = shapes.kernel.axes(on, which, 2).reshape(-1, d, d)
    np.testing.assert_array_equal(axes[:, d - 1], 0)
    along = axes[:, : d - 1]
    products = along @ np.swapaxes(along, 1, 2)
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(d - 1), products.shape), atol=1e-12)
    size = np.linalg.norm(shapes.corners[:, 1] - shapes.corners[:, 0], axis=1).min()
    for k in range(d - 1):
        here, there = (shapes.kernel.nearest(on + some * size * along[:, k], which, 1)[0] for some in (0, 1e-3))
        slope = ((there - here) * along[:, k]).sum(axis=1) / np.linalg.norm(there - here, axis=1)
        assert np.median(slope) > 0.999


@pytest.mark.parametrize("name", MADE)
def test_clusters_of_a_boundary_are_mended_on_their_shapes(name: str) -> None:
    mesh = tangled(name)
    freedom, h = freedom_of(mesh), mesh.mean_edge_length()
    start, last = mended(mesh)
    assert mesh.check()[0] > 0
    assert mesh.with_vertices(last).check()[0] == 0
    moved = (last != start).any(axis=1)
    assert (moved & freedom.curved).any()
    assert not moved[~mesh.along_curve(mesh.movable)].any()
    assert freedom.rounded(last)[1].max() < 0.02 * h
    flat = (freedom.frame >= 0) & ~freedom.curved
    off = (last - freedom.onto(last, start))[flat]
    assert np.abs(off).max(initial=0.0) < 1e-12  # which the caller takes away
    np.testing.assert_array_equal(mended(mesh, threads=3)[1], last)


@pytest.mark.parametrize("share", [0.2, 1.0])
def test_no_vertex_goes_out_of_reach(share: float) -> None:
    mesh = tangled("bent")
    reach = share * mesh.mean_edge_length()
    start, last = mended(mesh, max_move=reach)
    assert 0 < np.linalg.norm(last - start, axis=1).max() <= reach
    assert mesh.with_vertices(last).check()[0] < mesh.check()[0]


def test_what_is_not_mended_does_not_move() -> None:
    """A pass takes what has fewer inverted elements, or nothing."""
    mesh = tangled("bent")
    start, last = mended(mesh, max_move=1e-9)
    np.testing.assert_array_equal(last, start)


def test_clusters_are_what_neighbours_join() -> None:
    mesh = Mesh.build(*bent())
    stars, free = mesh.topology.stars(), mesh.along_curve(mesh.movable)
    far = np.zeros(len(free), dtype=bool)
    far[np.flatnonzero(free)[[0, -1]]] = True
    near = free & stars.grown(far, 1).view(bool)
    clusters = list(on_surfaces._clusters(stars, near))
    assert len(clusters) == 2
    np.testing.assert_array_equal(clusters[0] | clusters[1], near)
    assert not (clusters[0] & clusters[1]).any()
    assert [list(one) for one in on_surfaces._clusters(stars, free)] == [list(free)]


def test_the_strategy_ff_mends_curved_boundaries_and_only_these_ask_for_it() -> None:
    mesh = tangled("bent", 25)
    outcome = untangle(mesh, "FF", smooth=0)
    phases = [record.phase for record in outcome.records]
    assert outcome.valid
    assert "FF on surfaces" in phases
    points, stars = mesh.along_curve(mesh.points), mesh.topology.stars()
    inside = mesh.along_curve(mesh.movable) & ~freedom_of(mesh).curved
    only_inside = minimisations_in_regions((None,), np.inf, 1, mesh.freedom, stars, points, points, inside, inside)
    assert min(len(kernels.check(one, stars.simplices, 1)[0]) for one in only_inside) > 0
    valid = Mesh.build(*shell())
    flat = perturb(sliding(valid), 25, valid.mean_edge_length(), 0)[0]
    assert "FF on surfaces" not in [record.phase for record in untangle(flat, "FF", sweeps=5, smooth=0).records]
