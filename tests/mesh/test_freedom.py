"""Which vertices may slide, and along what."""

from __future__ import annotations

import numpy as np
import pytest
from boxes import may_move, union
from geometries import grid
from numpy.typing import NDArray

from meshfix_cli.mesh.freedom import Freedom, constraints_of, freedom_of
from meshfix_cli.mesh.mesh import Mesh


def freedom(mesh: Mesh, regions: NDArray[np.int64] | None = None) -> Freedom:
    points = mesh.along_curve(mesh.points)
    return freedom_of(points, constraints_of(mesh.topology, points, regions))


def degrees(mesh: Mesh, regions: NDArray[np.int64] | None = None) -> NDArray[np.int64]:
    """(n,): the number of directions of each vertex, d inside."""
    found = freedom(mesh, regions)
    known = mesh.topology.of_vertices(found.degrees).astype(np.int64)
    return np.where(mesh.movable & (known == 0), mesh.dimension, known)


@pytest.mark.parametrize("seed", range(40))
def test_unions_of_boxes_slide_as_the_boxes_around_each_vertex_tell(seed: int) -> None:
    random = np.random.default_rng(seed)
    solid = random.random((3, 2) if seed % 2 else (2, 3, 2)) < 0.7
    solid.flat[0] = True
    points, simplices, _ = union(solid)
    mesh = Mesh.build(points, simplices)
    found, most = degrees(mesh), may_move(points, solid)
    assert (found <= most).all()
    # Where boxes touch at an edge or a corner alone, what is on the other side counts for the coordinates only.
    assert (found == most).mean() > 0.9
    rounded = random.choice(["six digits", "single", "turned"])
    if rounded == "six digits":
        moved = np.array([[float(f"{x:.6g}") for x in row] for row in points * 0.7 + 1234.0])
    elif rounded == "single":
        moved = (points * 0.3 + 57.0).astype(np.float32).astype(np.float64)
    else:
        q, _ = np.linalg.qr(random.standard_normal((points.shape[1],) * 2))
        moved = points @ q.T
    assert np.array_equal(degrees(Mesh.build(moved, simplices)), found)


def test_axes_are_exact_where_coordinates_are() -> None:
    mesh = Mesh.build(*grid(*[np.linspace(0.1, 0.7, 4)] * 3))
    found = freedom(mesh)
    rows = found.frame >= 0
    for frame in found.frame[rows]:
        axes = found.axes[frame][: found.directions[frame]]
        assert np.isin(axes, (0.0, 1.0, -1.0)).all()
        assert (np.abs(axes).sum(axis=1) == 1).all()
    assert (found.degrees == 2).sum() == 6 * 2 * 2
    assert (found.degrees == 1).sum() == 12 * 2


def test_neighbours_are_those_in_the_line_or_plane() -> None:
    mesh = Mesh.build(*grid(*[np.linspace(0, 1, 5)] * 3))
    found, points = freedom(mesh), mesh.along_curve(mesh.points)
    for v in np.flatnonzero(found.frame >= 0):
        axes = found.axes[found.frame[v]][: found.directions[found.frame[v]]]
        ways = points[found.neighbours[found.offsets[v] : found.offsets[v + 1]]] - points[v]
        assert np.allclose(ways @ axes.T @ axes, ways, atol=1e-15)
        assert len(ways) == 2 if len(axes) == 1 else len(ways) >= 4


def test_round_holes_are_held() -> None:
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    rings = [r * np.stack([np.cos(angles), np.sin(angles)], axis=1) for r in (1.0, 1.5, 2.0)]
    points, k = np.concatenate(rings), np.arange(24)
    triangles = []
    for ring in (0, 24):
        a, b = ring + k, ring + (k + 1) % 24
        triangles += [np.stack([a, a + 24, b], axis=1), np.stack([b, a + 24, b + 24], axis=1)]
    found = degrees(Mesh.build(points, np.concatenate(triangles)))
    assert (found[24:48] == 2).all()
    assert (found[:24] == 0).all()
    assert (found[48:] == 0).all()


def test_interfaces_slide_and_their_ends_do_so_along_them() -> None:
    points, simplices, boxes = union(np.ones((2, 1, 1), dtype=bool), 3)
    mesh = Mesh.build(points, simplices)
    found = degrees(mesh, boxes)
    between = points[:, 0] == 3
    rim = between & np.isin(points[:, 1:], (0, 3)).any(axis=1)
    corner = between & np.isin(points[:, 1:], (0, 3)).all(axis=1)
    assert (found[between & ~rim] == 2).all()
    assert (found[rim & ~corner] == 1).all()
    assert (found[corner] == 0).all()
    assert (degrees(mesh)[between & ~rim] == 3).all()


@pytest.mark.parametrize("width", [0.0, 1e-4])
def test_the_front_of_a_slit_goes_along_itself_at_most(width: float) -> None:
    points, simplices = grid(np.linspace(0, 1, 5), np.linspace(0, 1, 5), np.linspace(0, 1, 5))
    right = points[simplices].mean(axis=1)[:, 0] > 0.5
    cut = (points[:, 0] == 0.5) & (points[:, 1] < 0.75)
    twin = np.arange(len(points))
    twin[cut] = len(points) + np.arange(cut.sum())
    simplices[right] = twin[simplices[right]]
    both = np.concatenate([points, points[cut]])
    opened = width * (1 - both[:, 1] / 0.75)
    both[: len(points), 0] -= np.where(cut, opened[: len(points)], 0.0)
    both[len(points) :, 0] += opened[len(points) :]
    mesh = Mesh.build(both, simplices)
    assert mesh.check()[0] == 0
    found = freedom(mesh)
    front = np.flatnonzero((points[:, 0] == 0.5) & (points[:, 1] == 0.75))
    here = found.frame[mesh.topology.number[front]]
    for frame in here[here >= 0]:
        assert found.directions[frame] == 1
        assert np.array_equal(np.abs(found.axes[frame][0]), [0, 0, 1])


def test_where_boxes_touch_in_an_edge_that_is_kept() -> None:
    points, simplices, _ = union(np.array([[[True], [False]], [[False], [True]]]))
    found = degrees(Mesh.build(points, simplices))
    edge = np.flatnonzero((points[:, :2] == 2).all(axis=1))
    assert found[edge].tolist() == [0, 1, 0]


def test_a_vertex_of_two_bodies_is_held() -> None:
    points, simplices = grid(*[np.linspace(0, 1, 5)] * 3)
    tip = int(np.argmin(np.linalg.norm(points - [0.5, 0.5, 1.0], axis=1)))
    assert degrees(Mesh.build(points, simplices))[tip] == 2
    above = np.array([[0.4, 0.4, 1.5], [0.6, 0.4, 1.5], [0.5, 0.6, 1.5]])
    n = len(points)
    both = Mesh.build(np.concatenate([points, above]), np.concatenate([simplices, [[tip, n, n + 1, n + 2]]]))
    assert degrees(both)[tip] == 0


def test_a_tangled_boundary_is_flat_all_the_same() -> None:
    valid = Mesh.build(*grid(*[np.linspace(0, 1, 6)] * 3))
    before = degrees(valid)
    points = valid.points.copy()
    vertex = int(np.argmin(np.linalg.norm(points - [0.4, 0.4, 0.0], axis=1)))
    points[vertex, :2] += 0.35
    tangled = valid.with_points(points)
    assert tangled.check()[0] > 0
    assert (degrees(tangled) == before).mean() > 0.97
    assert degrees(tangled)[vertex] == 2


def test_parts_have_the_freedom_of_the_whole() -> None:
    mesh = Mesh.build(*grid(*[np.linspace(0, 1, 5)] * 3))
    whole = freedom(mesh)
    vertices = np.sort(np.random.default_rng(1).permutation(len(whole.frame))).astype(np.int32)
    part = whole.part(vertices, len(vertices))
    for name in ("frame", "offsets", "neighbours"):
        assert np.array_equal(getattr(part, name), getattr(whole, name))
    start = mesh.along_curve(mesh.points)
    moved = start + np.random.default_rng(2).standard_normal(start.shape)
    there = whole.onto(moved, start)
    assert np.array_equal(there[whole.frame < 0], moved[whole.frame < 0])
    assert np.array_equal(whole.onto(there, start), there)
