"""Surfaces in space: the sides from which they are seen, their ends, and how elements are judged."""

from __future__ import annotations

import numpy as np
import pytest
from surfaces import box, bumps, laid, moebius, three_sheets, torus

from meshfix_cli import kernels
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.sides import crowded_edges, is_closed
from meshfix_cli.mesh.surface import inward
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.quality.metrics import METRICS
from meshfix_cli.quality.summary import summarise


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    """Rotate about an oblique axis."""
    axis = np.array([1.0, 2.0, -0.5]) / np.linalg.norm([1.0, 2.0, -0.5])
    cross = np.cross(np.eye(3), axis)
    return points @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


@pytest.mark.parametrize("quads", [False, True])
def test_a_flat_sheet_is_judged_as_a_plane_mesh(quads: bool, random: np.random.Generator) -> None:
    n = 8
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    flat = np.stack([x, y], axis=-1).reshape(-1, 2) + 0.2 * random.uniform(-1, 1, ((n + 1) ** 2, 2))
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    rows = np.stack([corner, corner + n + 1, corner + n + 2, corner + 1], axis=1).astype(np.int32)
    cells = [("quad", rows)] if quads else np.concatenate([rows[:, :3], rows[:, [0, 2, 3]]])
    space = turned(np.column_stack([flat, np.zeros(len(flat))]), 0.7)
    names = [name for name, metric in METRICS.items() if ("quad" if quads else "triangle") in metric.elements]
    plane, surface = Mesh.build(flat, cells), Mesh.build(space, cells)
    for name in names:
        np.testing.assert_allclose(evaluate(name, surface), evaluate(name, plane), rtol=1e-9)
    one, other = summarise(plane), summarise(surface)
    assert (one.inverted, one.histogram) == (other.inverted, other.histogram) and one.inverted == 0
    assert other.min_measure == pytest.approx(one.min_measure)


def test_an_element_that_is_turned_over_is_told_by_what_is_around_it() -> None:
    points, rows = torus(jitter=0.0)
    mesh = Mesh.build(points, rows)
    assert mesh.check()[0] == 0
    star = rows[(rows == 100).any(axis=1)]
    other = np.setdiff1d(star, [100])
    points[100] += 2.2 * (points[other[0]] - points[100])
    moved = Mesh.build(points, rows)
    areas = kernels.area_vectors(points, np.arange(0, rows.size + 1, 3, dtype=np.int32), rows.ravel(), 1)
    middle = points[rows].mean(axis=1)
    tube = middle * [1, 1, 0] / np.linalg.norm(middle[:, :2], axis=1)[:, None] * 2
    against = np.flatnonzero((areas * (middle - tube)).sum(axis=1) < 0)
    assert len(against) > 0
    assert summarise(moved).inverted_elements.tolist() == against.tolist()


def test_elements_numbered_against_the_rest_are_told_and_those_seen_from_inside() -> None:
    points, rows = torus()
    mixed = rows.copy()
    mixed[[5, 90]] = mixed[[5, 90]][:, [0, 2, 1]]
    mesh = Mesh.build(points, mixed)
    assert np.flatnonzero(mesh.topology.misnumbered).tolist() == [5, 90] and mesh.check()[0] == 0
    assert is_closed(mesh.topology) and not inward(mesh).any()
    assert inward(Mesh.build(points, rows[:, [0, 2, 1]])).all()
    open_ones = Mesh.build(*bumps())
    assert not is_closed(open_ones.topology) and not inward(open_ones).any()


def test_a_moebius_band_is_held_where_its_sides_meet() -> None:
    points, rows = moebius()
    mesh = laid(points, rows)
    assert not mesh.topology.connectivity.orientable and not is_closed(mesh.topology)
    assert mesh.check()[0] == 0
    inside = ~mesh.topology.boundary
    assert 0 < (inside & ~mesh.movable).sum() <= 4 < mesh.movable.sum()


def test_edges_of_three_sheets_are_held() -> None:
    points, rows = three_sheets()
    mesh = laid(points, rows)
    edges = mesh.topology.connectivity.vertices[crowded_edges(mesh.topology)]
    np.testing.assert_array_equal(points[edges][:, :, :2], 0)
    assert len(edges) == 4 and not mesh.movable[edges].any() and mesh.movable.sum() == 3 * 9


def test_repeated_elements_count_once() -> None:
    for quads in (False, True):
        points, rows = torus(quads=quads)
        twice = np.concatenate([rows, rows[[7]]])
        mesh = Mesh.build(points, [("quad", twice)] if quads else twice)
        assert mesh.topology.m == len(rows) and is_closed(mesh.topology)


@pytest.mark.parametrize("triangles", [False, True])
def test_edges_and_corners_of_a_cube_are_features(triangles: bool) -> None:
    points, rows = box(triangles=triangles)
    mesh = laid(points, rows)
    on_faces = ((points == 0) | (points == 6)).sum(axis=1)
    np.testing.assert_array_equal(mesh.movable, on_faces == 1)
