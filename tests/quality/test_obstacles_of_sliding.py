"""Vertices that slide, and have no place where the elements around them would be valid, are found; others are not."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from meshes import sliding, sliding_on_curves
from numpy.typing import NDArray

from meshfix_cli import untangle
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.obstacles import find_obstacles
from meshfix_cli.solve.records import Outcome

Array = NDArray[np.float64]


def functions(mesh: Mesh, v: int) -> tuple[Array, Array]:
    """Determinants of the simplices at a vertex by its position: values at the origin (f,) and gradients (f, d)."""
    d, found = mesh.dimension, []
    for row in mesh.topology.simplices[(mesh.topology.simplices == v).any(axis=1)].tolist():
        corners = mesh.points[row].copy()
        values = []
        for x in np.vstack([np.zeros(d), np.eye(d)]):
            corners[row.index(v)] = x
            values.append(np.linalg.det(corners[1:] - corners[0]))
        found.append((values[0], np.array(values[1:]) - values[0]))
    return np.array([value for value, _ in found]), np.array([gradient for _, gradient in found])


def alone(mesh: Mesh, v: int) -> Mesh:
    """The same mesh in which no other vertex moves."""
    return mesh.with_fixed(np.arange(len(mesh.points)) != v)


def best_on_shape(mesh: Mesh, v: int) -> float:
    """The largest smallest height of the simplices at a vertex in all of the curve or surface in which it slides."""
    freedom = mesh.freedom
    assert freedom is not None and freedom.shapes is not None
    here, shapes = int(mesh.topology.number[v]), freedom.shapes
    shape = int(freedom.frame[here]) - len(freedom.axes)
    pieces = shapes.corners[shapes.first[shape] : shapes.first[shape + 1]]
    count = 200 if mesh.dimension == 2 else 40
    weights = np.random.default_rng(0).dirichlet(np.ones(mesh.dimension), count)
    places = np.ascontiguousarray(np.concatenate([weights @ piece for piece in pieces]))
    there = shapes.kernel.nearest(places, np.full(len(places), shape, dtype=np.int32), 1)[0]
    values, gradients = functions(mesh, v)
    heights = (values + there @ gradients.T) / np.linalg.norm(gradients, axis=1)
    return float(heights.min(axis=1).max())


def disc(random: np.random.Generator, inside: Array) -> Mesh:
    """Triangles from a point to a round rim."""
    angle = 2 * np.pi * (np.arange(14) + random.uniform(-0.25, 0.25, 14)) / 14
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    return Mesh.build(np.vstack([rim, [[0.0, 0.0]]]), [(14, i, (i + 1) % 14) for i in range(14)]).with_points(
        np.vstack([rim, [inside]])
    )


def ball(random: np.random.Generator, inside: Array) -> Mesh:
    """Tetrahedra from a point to a sphere."""
    from scipy.spatial import ConvexHull

    points = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    points += random.uniform(-0.1, 0.1, points.shape)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    cells = [(len(points), *row) for row in ConvexHull(points).simplices.tolist()]
    made = Mesh.build(np.vstack([points, [[0.0, 0.0, 0.0]]]), cells)
    return made.with_points(np.vstack([points, [inside]]))


@pytest.mark.parametrize("make", [disc, ball])
def test_places_on_curves_and_surfaces(make: type, random: np.random.Generator) -> None:
    """Where no sample of the whole curve or surface makes all simplices positive, and nowhere else, they are named."""
    named = found_free = 0
    for _ in range(60):
        way = random.standard_normal(2 if make is disc else 3)
        mesh = make(random, way / np.linalg.norm(way) * random.uniform(0.7, 1.4))
        mesh = sliding_on_curves(mesh, feature_angle=75.0)
        v = int(random.integers(len(mesh.points) - 1))
        one = alone(mesh, v)
        if not one.movable[v] or one.check()[0] == 0:
            continue
        best, found = best_on_shape(one, v), find_obstacles(one)
        again = find_obstacles(one, threads=3)
        assert np.array_equal(found.exclusive, again.exclusive)
        assert np.array_equal(found.inverted, again.inverted)
        mine = np.flatnonzero((one.topology.simplices == v).any(axis=1))
        blamed = np.isin(mine, np.concatenate([found.exclusive, found.inverted])).any()
        assert blamed or best > -1e-3
        assert not blamed or best <= 1e-9
        named, found_free = named + int(blamed), found_free + int(not blamed and best > 0)
    assert named > 5
    assert found_free > 5


def fan(random: np.random.Generator, apex: bool) -> Mesh:
    """A vertex in a straight edge of triangles, or in a flat side of tetrahedra, around which no other moves."""
    count = int(random.integers(4, 8))
    if apex:
        angle = np.sort(random.uniform(0, 2 * np.pi, count))
        rim = np.column_stack([np.cos(angle), np.sin(angle)]) + random.normal(0, 0.35, (count, 2))
        points = np.column_stack([np.vstack([rim, np.zeros(2), random.uniform(-0.5, 0.5, 2)]), np.zeros(count + 2)])
        points[-1, 2] = 1.0
        return Mesh.build(points, [(count, i, (i + 1) % count, count + 1) for i in range(count)])
    angle = np.concatenate([[0], np.sort(random.uniform(0, np.pi, count - 2)), [np.pi]])
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    rim[1:-1] += random.normal(0, 0.35, (count - 2, 2))
    return Mesh.build(np.vstack([rim, [[0.0, 0.0]]]), [(count, i, i + 1) for i in range(count - 1)])


@pytest.mark.parametrize("apex", [False, True])
def test_places_in_lines_and_planes(apex: bool, random: np.random.Generator) -> None:
    """HiGHS tells the largest smallest determinant in the line, or in the plane."""
    from scipy.optimize import linprog

    named = free = 0
    for _ in range(200):
        mesh = fan(random, apex)
        v = len(mesh.points) - (2 if apex else 1)
        one = alone(sliding(mesh), v)
        if mesh.topology.flipped.any() or not one.movable[v] or one.check()[0] == 0:
            continue
        moves = 2 if apex else 1
        values, gradients = functions(one, v)
        rows = np.column_stack([-gradients[:, :moves], np.ones(len(values))])
        best = -linprog([0] * moves + [-1], rows, values, bounds=[(None, None)] * (moves + 1)).fun
        found = find_obstacles(one)
        blamed = len(found.exclusive) > 0
        assert blamed if best < -1e-6 else not blamed or best < 1e-9
        named, free = named + int(blamed), free + int(best > 1e-6)
        if blamed:  # and these few already exclude each other
            mine = np.isin(np.flatnonzero((one.topology.simplices == v).any(axis=1)), found.exclusive)
            few = linprog([0] * moves + [-1], rows[mine], values[mine], bounds=[(None, None)] * (moves + 1))
            assert few.fun > -1e-9
    assert named > 10
    assert free > 10


def test_what_does_not_depend_on_where_a_vertex_slides_is_named_alone() -> None:
    """A triangle below two vertices of one height, of which the first is behind the other."""
    points = np.array([[1.0, 0], [0.6, 0.5], [0.9, 0.5], [-1, 0], [0, 0]])
    mesh = Mesh.build(points, [(4, 0, 1), (4, 1, 2), (4, 2, 3)])
    found = find_obstacles(alone(sliding(mesh), 4))
    assert found.inverted.tolist() == [1]
    assert found.hopeless(mesh) is not None


def test_nothing_waits_for_a_vertex_that_has_no_place() -> None:
    """A round rim of which one vertex alone slides, with the inner one beyond it."""
    outcome: Outcome | None = None
    random = np.random.default_rng(3)
    for _ in range(40):
        mesh = sliding_on_curves(disc(random, np.array([1.2, 0.0])), feature_angle=75.0)
        outcome = untangle(alone(mesh, int(np.argmax(mesh.points[:-1, 0]))))
        if len(outcome.obstacles.inverted) or len(outcome.obstacles.exclusive):
            break
    assert outcome is not None
    assert not outcome.valid
    assert not [record for record in outcome.records if record.phase.startswith("FF")]
