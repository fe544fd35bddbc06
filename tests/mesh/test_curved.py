"""Which vertices slide on surfaces and curves, and where these are."""

from __future__ import annotations

from itertools import combinations, product

import generate
import numpy as np
import pytest
from geometries import circle, polygon, rings, shell
from meshes import sliding_on_curves
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.curved import Shapes
from meshfix_cli.mesh.freedom import Freedom
from meshfix_cli.mesh.mesh import Mesh

Points = NDArray[np.float64]


def freedom(mesh: Mesh, feature_angle: float = 40.0) -> Freedom:
    found = sliding_on_curves(mesh, feature_angle=feature_angle).freedom
    assert found is not None
    return found


def curved(mesh: Mesh, feature_angle: float = 40.0) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """(n,) how many directions each vertex slides in, and whether that is on a surface or curve."""
    found = freedom(mesh, feature_angle)
    return mesh.topology.of_vertices(found.degrees).astype(np.int64), mesh.topology.of_vertices(found.curved)


def shapes_of(mesh: Mesh) -> Shapes:
    shapes = freedom(mesh).shapes
    assert shapes is not None
    return shapes


def disc(count: int, corner: bool = False) -> tuple[Points, NDArray[np.int32]]:
    """A disc, or half of one, and a height."""
    loop = circle(0, 0, 1.0, count)
    return polygon(0.2, loop[loop[:, 1] > -1e-9] if corner else loop)


@pytest.mark.parametrize("directions", [1, 2])
@pytest.mark.parametrize("d", [2, 3])
def test_the_nearest_piece_is_that_of_a_search_among_all(d: int, directions: int) -> None:
    if directions == 2 and d == 2:
        return
    random = np.random.default_rng(d + directions)
    corners = random.random((200, 1, d)) + 0.1 * random.standard_normal((200, d, d))
    if directions == 1:
        corners[:, -1] = corners[:, 1]
    first = np.array([0, 70, 200], dtype=np.int32)
    kinds = np.full(2, directions, dtype=np.uint8)
    reference = kernels.Reference(corners, np.zeros_like(corners), first, kinds)
    steps = 60
    weights = np.array([w for w in product(range(steps + 1), repeat=directions) if sum(w) <= steps]) / steps
    weights = np.column_stack([1 - weights.sum(axis=1), weights])
    places = 1.5 * random.random((40, d)) - 0.25
    for shape, (begin, end) in enumerate([(0, 70), (70, 200)]):
        _, far = reference.nearest(places, np.full(40, shape, dtype=np.int32), 2)
        dense = np.einsum("wi,pid->pwd", weights, corners[begin:end, : directions + 1]).reshape(-1, d)
        seen = np.linalg.norm(places[:, None] - dense, axis=2).min(axis=1)
        assert (far <= seen + 1e-15).all()
        assert (seen - far <= 0.6 / steps).all()


@pytest.mark.parametrize("walks", [False, True])
@pytest.mark.parametrize(("d", "directions"), [(2, 1), (3, 1), (3, 2)])
def test_the_farthest_of_moved_pieces_is_the_largest_distance_of_all(d: int, directions: int, walks: bool) -> None:
    if walks and directions == 1:
        return
    random = np.random.default_rng(d + directions)
    places = random.random((120, d))
    vertices = random.integers(0, 120, (200, d)).astype(np.int32)
    if directions == 1:
        vertices[:, -1] = vertices[:, 1]
    first, kinds = np.array([0, 70, 200], dtype=np.int32), np.full(2, directions, dtype=np.uint8)
    number = np.repeat(np.arange(2, dtype=np.int32), np.diff(first))

    def made(places: NDArray[np.float64]) -> kernels.Reference:
        corners = places[vertices]
        reference = kernels.Reference(corners, np.zeros_like(corners), first, kinds)
        if walks:
            reference.let_walk(vertices)
        return reference

    moved = places + 0.05 * random.standard_normal(places.shape)
    before, after = places[vertices], moved[vertices]
    for one, reference, other in ((after, made(places), before), (before, made(places).at_corners(after), after)):
        some = [one[:, k] for k in range(directions + 1)]
        ends = list(combinations(some, 2))
        middles = [(a + b) / 2 for a, b in ends] + ([sum(some) / 3] if directions == 2 else [])
        plain = kernels.Reference(other, np.zeros_like(other), first, kinds)
        for of_corners, all_places in ((True, some), (False, middles)):
            far = max(plain.nearest(np.ascontiguousarray(at), number, 1)[1].max() for at in all_places)
            for threads in (1, 2):
                assert reference.farthest(one, of_corners, threads) == pytest.approx(far, rel=1e-12)


def sphere_error(mesh: Mesh) -> tuple[float, float]:
    """How far the middles of the outer sphere's triangles are from it: as they are, and rounded."""
    shapes = shapes_of(mesh)
    middles = shapes.corners.mean(axis=1)
    outer = np.linalg.norm(shapes.corners[:, 0], axis=1) > 0.75
    number = np.repeat(np.arange(len(shapes.directions), dtype=np.int32), np.diff(shapes.first))
    there, far = shapes.kernel.nearest(middles, number, 1)
    assert far.max() < 1e-15
    flat, rounded = (np.abs(np.linalg.norm(one[outer], axis=1) - 1).max() for one in (middles, there))
    return float(flat), float(rounded)


def test_rounded_triangles_of_a_sphere_are_near_it() -> None:
    flat, rounded = sphere_error(Mesh.build(*shell()))
    assert flat > 0.01
    assert rounded < 0.1 * flat


@pytest.mark.parametrize("count", [16, 32, 64])
def test_rounded_polygons_are_near_their_circle(count: int) -> None:
    shapes = shapes_of(Mesh.build(*rings(1.0, 2.0, count)))
    middles = shapes.corners.mean(axis=1)
    number = np.repeat(np.arange(len(shapes.directions), dtype=np.int32), np.diff(shapes.first))
    there, _ = shapes.kernel.nearest(middles, number, 1)
    radius = np.round(np.linalg.norm(shapes.corners[:, 0], axis=1))
    flat, rounded = (np.abs(np.linalg.norm(one, axis=1) - radius).max() for one in (middles, there))
    # The sagitta is of the second order, what is left of it of the fourth.
    assert rounded < 1.1 * 0.375 * (np.pi / count) ** 4 * 2
    assert rounded < 2 * (np.pi / count) ** 2 * flat


def test_corners_stay_as_they_are() -> None:
    shapes = shapes_of(Mesh.build(*generate.bracket(0.22, 7)))
    number = np.repeat(np.arange(len(shapes.directions), dtype=np.int32), np.diff(shapes.first))
    for k in range(2):
        corners = np.ascontiguousarray(shapes.corners[:, k])
        there, far = shapes.kernel.nearest(corners, number, 1)
        assert np.array_equal(there, corners)
        assert not far.any()


def test_a_cylinder_slides_on_its_side_along_its_rims_and_in_its_ends() -> None:
    mesh = Mesh.build(*generate.extruded(*disc(24), np.linspace(0, 1, 5)))
    degrees, on_curves = curved(mesh)
    p = mesh.points
    round_, ends = np.abs(np.linalg.norm(p[:, :2], axis=1) - 1) < 0.02, np.isin(p[:, 2], (0, 1))
    assert (degrees[round_ & ~ends] == 2).all()
    assert (degrees[round_ & ends] == 1).all()
    assert on_curves[round_].all()
    assert (degrees[ends & ~round_] == 2).all()
    assert not on_curves[~round_].any()
    degrees, _ = curved(mesh, feature_angle=10)  # the sides of the polygon meet at 15 degrees
    assert not (degrees[round_ & ends] == 2).any()
    corner = np.isin(np.round(np.degrees(np.arctan2(p[:, 1], p[:, 0])) * 1e6), np.round(np.arange(-180, 181, 15) * 1e6))
    assert (degrees[round_ & ends & corner] == 0).all()


def test_what_meets_at_more_than_the_feature_angle_is_a_corner() -> None:
    mesh = Mesh.build(*disc(24, corner=True))
    degrees, on_curves = curved(mesh)
    ends = np.abs(np.abs(mesh.points[:, 0]) - 1) < 1e-9
    assert ends.sum() == 2
    assert not degrees[ends].any()
    straight = (np.abs(mesh.points[:, 1]) < 1e-9) & ~ends
    assert (degrees[straight] == 1).all()
    assert not on_curves[straight].any()
    assert on_curves.sum() > 10


def test_walls_that_are_near_are_different_shapes() -> None:
    mesh = Mesh.build(*shell())
    found = freedom(mesh)
    points = mesh.along_curve(mesh.points)
    radius = np.linalg.norm(points, axis=1)
    inner = found.curved & (radius < 0.75)
    across = points.copy()
    across[inner] *= 1.0 / radius[inner, None]  # to the other sphere
    back, far = found.rounded(across)
    assert np.allclose(np.linalg.norm(back[inner], axis=1), 0.5, atol=2e-3)
    assert np.allclose(far[inner], 0.5, atol=1e-2)


def test_parts_have_the_shapes_of_the_whole() -> None:
    whole = freedom(Mesh.build(*generate.bracket(0.22, 7)))
    vertices = np.random.default_rng(1).permutation(len(whole.frame)).astype(np.int32)
    part = whole.part(vertices, len(vertices))
    assert whole.shapes is not None
    assert part.shapes is not None
    for new, old in enumerate(vertices):
        mine = part.shapes.around[part.shapes.offsets[new] : part.shapes.offsets[new + 1]]
        rows = whole.shapes.around[whole.shapes.offsets[old] : whole.shapes.offsets[old + 1]]
        assert np.array_equal(vertices[mine[:, 0]], rows[:, 0])
        assert np.array_equal(np.where(mine[:, 1] < 0, -1, vertices[mine[:, 1]]), rows[:, 1])
        assert np.array_equal(mine[:, 2], rows[:, 2])
