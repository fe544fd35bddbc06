"""Boundaries that a displacement has moved keep the shape that they have got, where they slide."""

from __future__ import annotations

import meshio
import numpy as np
import pytest
from geometries import kuhn, shell
from meshes import sliding, sliding_on_curves
from numpy.typing import NDArray

from meshfix_cli import Mesh, untangle
from meshfix_cli.mesh.freedom import Freedom
from meshfix_cli.repair import Sliding

Array = NDArray[np.float64]
TURN = np.array([[0.8, -0.6, 0.0], [0.48, 0.64, -0.6], [0.36, 0.48, 0.8]])
STRETCH = np.array([1.5, 1.0, 0.8])


def displaced(mesh: Mesh, there: Array) -> meshio.Mesh:
    """A mesh with a displacement of its boundary; what is inside is left behind."""
    moves = np.where(mesh.movable[:, None], 0.0, there - mesh.points)
    return meshio.Mesh(mesh.points, [("tetra", mesh.topology.simplices)], {"u": moves})


def freedom_of(mesh: Mesh) -> Freedom:
    assert mesh.freedom is not None
    return mesh.freedom


@pytest.mark.parametrize("slide", ["flat", "curved"])
def test_planes_are_those_of_the_displaced_boundary(slide: Sliding) -> None:
    mesh = Mesh.build(*kuhn())
    given = displaced(mesh, mesh.points @ (TURN * STRETCH).T)
    held, slid = untangle(given, displace="u"), untangle(given, displace="u", slide=slide)
    assert held.valid
    assert slid.valid
    degrees = freedom_of(sliding(mesh)).degrees
    counts = (slid.report.facts or {})["sliding"]
    assert (counts["lines"], counts["planes"]) == ((degrees == 1).sum(), (degrees == 2).sum())
    after = slid.points @ TURN / STRETCH
    moved = (slid.points != given.points + given.point_data["u"]).any(axis=1) & mesh.topology.boundary
    assert moved.sum() > 100
    for side in (mesh.points.min(axis=0), mesh.points.max(axis=0)):
        there = mesh.points == side
        assert np.abs((after - side)[there]).max() < 1e-12
    ratio, before = slid.summary.to_reference, held.summary.to_reference
    assert ratio is not None and before is not None
    assert ratio[1] >= before[1]


def test_surfaces_are_those_of_the_displaced_boundary() -> None:
    """An expanded shell is far from the one before, on which nothing could slide."""
    mesh = Mesh.build(*shell())
    given = displaced(mesh, 1.3 * mesh.points)
    result = untangle(given, displace="u", slide="curved")
    assert result.valid
    before, after = freedom_of(sliding_on_curves(mesh)), freedom_of(result.after)
    assert (result.report.facts or {})["sliding"]["surfaces"] == before.curved.sum() > 100
    assert before.shapes is not None and after.shapes is not None
    rounded = np.sort(np.linalg.norm(after.shapes.corners, axis=2), axis=None)
    np.testing.assert_allclose(rounded, 1.3 * np.sort(np.linalg.norm(before.shapes.corners, axis=2), axis=None))
    outside = mesh.topology.boundary
    radii, first = (np.linalg.norm(points[outside], axis=1) for points in (result.points, mesh.points))
    np.testing.assert_allclose(radii, 1.3 * first, rtol=0.01)


def test_vertices_do_not_slide_back_to_where_they_were_before() -> None:
    """A shell that turns in itself: each vertex is on the surface still, and where the displacement has put it."""
    mesh = Mesh.build(*shell())
    there = mesh.points @ TURN.T
    given = displaced(mesh, there)
    result = untangle(given, displace="u", slide="curved")
    outside = mesh.topology.boundary
    assert np.linalg.norm((result.points - there)[outside], axis=1).mean() < 0.1 * mesh.mean_edge_length()


def test_a_displaced_boundary_that_is_folded_is_told() -> None:
    mesh = Mesh.build(*shell())
    there = 1.3 * mesh.points
    v, w = mesh.topology.facets_between(None)[0][0, :2]
    v, w = mesh.topology.connectivity.vertices[[v, w]]
    there[v] += 1.6 * (there[w] - there[v])
    result = untangle(displaced(mesh, there), displace="u", slide="curved")
    shape = (result.report.facts or {})["shape"]
    assert shape["displaced"]
    assert shape["folds"] > 0
