"""Towards a reference: elements get the shapes back that they had before the boundary moved."""

from __future__ import annotations

import math

import numpy as np
import pytest
from geometries import airfoil, shell
from layered import body_of, heights, layered, left_behind, turn
from meshes import tangle
from numpy.typing import NDArray
from scipy.linalg import polar

from meshfix_cli import Mesh, summarise, untangle
from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.reference import reference_points
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.quality.relative import worst_and_mean_to
from meshfix_cli.solve.towards import followed

Points = NDArray[np.float64]


def ratio(mesh: Mesh, reference: Mesh) -> tuple[float, float]:
    return worst_and_mean_to(mesh, reference_points(mesh, reference))


def test_a_rigid_motion_of_everything_is_given_back(mesh: Mesh) -> None:
    """But for rounding; what the boundary says of it suffices."""
    d = mesh.dimension
    exact = mesh.points @ turn(100, d).T + 3.0
    tangled = tangle(mesh, 100, 2).points @ turn(100, d).T + 3.0
    moved = mesh.with_points(np.where(mesh.movable[:, None], tangled, exact))
    outcome = untangle(moved, reference=mesh)
    assert outcome.valid
    assert np.abs(outcome.untangled.points - exact).max() < 1e-13
    assert np.abs(outcome.after.points - exact).max() < 1e-13
    assert ratio(outcome.after, mesh) == pytest.approx((1.0, 1.0), abs=1e-10)


def test_where_the_boundary_did_not_move_the_reference_comes_back_bit_by_bit(mesh: Mesh) -> None:
    assert untangle(tangle(mesh), reference=mesh).after.points.tobytes() == mesh.points.tobytes()


@pytest.mark.parametrize(("degrees", "shift"), [(0, 0.01), (0, 0.3), (5, 0.0), (30, 0.1), (60, 0.0)])
def test_layers_around_a_hole_that_moved_come_back(degrees: float, shift: float) -> None:
    reference = layered()
    hole = body_of(reference) @ turn(degrees).T + [shift, 0.0]
    moved = left_behind(reference, hole)
    assert moved.check()[0] > 0
    outcome = untangle(moved, reference=reference)
    assert outcome.valid
    assert heights(outcome.after) == pytest.approx(heights(reference), rel=0.05)
    assert body_of(outcome.after).tobytes() == hole.tobytes()


def test_layers_of_a_thousandth_come_back_around_a_body_that_turned() -> None:
    reference = Mesh.build(*airfoil())
    body = ~reference.movable & (np.linalg.norm(reference.points, axis=1) < 1.1)
    points = np.where(body[:, None], reference.points @ turn(10).T, reference.points)
    outcome = untangle(reference.with_points(points), reference=reference)
    assert outcome.valid
    smallest, mean = ratio(outcome.after, reference)
    assert smallest > 0.9
    assert mean > 0.99
    assert ratio(outcome.before, reference)[0] == 0.0


def test_what_the_start_leaves_inverted_is_mended_towards_the_reference() -> None:
    """A core that turns far within a shell: the smallest ratio rises from there, and the mean does not fall."""
    reference = Mesh.build(*shell())
    core = np.linalg.norm(reference.points, axis=1) < 0.51
    points = np.where(core[:, None], reference.points @ turn(60, 3).T, reference.points)
    moved = reference.with_points(points)
    outcome = untangle(moved, reference=reference)
    assert outcome.valid
    phases = [record.phase for record in outcome.records]
    assert "FF towards the reference" in phases
    assert "Laplacian" not in phases
    assert ratio(outcome.after, reference)[0] > ratio(outcome.untangled, reference)[0]
    assert ratio(outcome.after, reference)[0] > 0.3
    assert outcome.untangled is not outcome.after


def test_the_start_bends_simplices_as_little_as_may_be(random: np.random.Generator) -> None:
    """No small motion of free vertices brings the simplices much nearer to rotations, by scipy's decomposition."""
    reference = layered()
    moved = left_behind(reference, body_of(reference) @ turn(20).T)
    stars, free = reference.topology.stars(), reference.along_curve(reference.movable)
    before = reference.along_curve(reference.points)
    simplices = stars.simplices[free[stars.simplices].any(axis=1)]

    def misfit(points: Points) -> float:
        shapes = [np.swapaxes(p[simplices[:, 1:]] - p[simplices[:, :1]], 1, 2) for p in (points, before)]
        total = 0.0
        for jacobian in shapes[0] @ np.linalg.inv(shapes[1]):
            total += float(((jacobian - polar(jacobian)[0]) ** 2).sum())
        return total

    start = followed(reference.along_curve(moved.points), stars, before, free)
    least = misfit(start)
    for size in (1e-4, 1e-3):
        for _ in range(4):
            step = size * random.normal(size=start.shape) * free[:, None]
            assert misfit(start + step) > 0.99 * least


def test_a_valid_mesh_is_left_alone() -> None:
    """Small angles are what the reference has."""
    mesh = layered()
    outcome = untangle(mesh, reference=mesh)
    assert outcome.after is mesh
    assert summarise(mesh).min_angle < 1


def test_no_vertex_goes_farther_than_it_may() -> None:
    reference = layered()
    moved = left_behind(reference, body_of(reference) + np.array([0.05, 0.0]))
    outcome = untangle(moved, reference=reference, max_move=0.051)
    assert outcome.valid
    way = np.linalg.norm(outcome.after.points - moved.points, axis=1)
    assert 0.04 < way.max() <= 0.051
    assert heights(outcome.after) == pytest.approx(heights(reference), rel=0.05)


def test_any_number_of_threads_gives_the_same_bits(mesh: Mesh) -> None:
    d, h = mesh.dimension, mesh.mean_edge_length()
    away = mesh.points + 0.3 * h * np.sin(mesh.points[:, [1, 0, *range(2, d)]] / h)
    moved = mesh.with_points(np.where(mesh.movable[:, None], tangle(mesh, 100, 1).points, away))
    outcomes = [untangle(moved, reference=mesh, threads=threads) for threads in (1, 2, 3)]
    assert outcomes[0].after is not moved
    assert len({outcome.after.points.tobytes() for outcome in outcomes}) == 1


def test_only_a_valid_mesh_of_the_same_elements_is_a_reference(plate: Mesh, bracket: Mesh) -> None:
    cells = plate.topology.simplices
    other = cells.copy()
    other[[3, 7]] = other[[7, 3]]
    fewer = Mesh.build(plate.points, cells[:-1])
    for reference, said in (
        (bracket, r"it has 1,863 points and 7,968 tetrahedra, and the mesh 207 points and 332 triangles"),
        (fewer, r"it has 207 points and 331 triangles, and the mesh 207 points and 332 triangles"),
        (Mesh.build(plate.points, other), r"its triangle 3 has the vertices \[.*\], and that of the mesh \[.*\]"),
        (tangle(plate), r"\d+ triangles of it are inverted"),
    ):
        with pytest.raises(InvalidMeshError, match=rf"^{said}$"):
            untangle(tangle(plate), reference=reference)
    with pytest.raises(ValueError, match="reference and only_invalid exclude each other"):
        untangle(tangle(plate), reference=plate, only_invalid=True)


def test_an_element_may_be_numbered_otherwise_in_the_reference(plate: Mesh) -> None:
    turned = np.roll(plate.topology.simplices, 1, axis=1)
    assert untangle(tangle(plate), reference=Mesh.build(plate.points, turned)).after.points.tobytes() == (
        plate.points.tobytes()
    )


@pytest.mark.parametrize("d", [2, 3])
def test_the_ratio_to_a_regular_simplex_is_that_of_verdict(random: np.random.Generator, d: int) -> None:
    regular = np.array([[0, 0, 0], [1, 0, 0], [0.5, math.sqrt(0.75), 0], [0.5, math.sqrt(1 / 12), math.sqrt(2 / 3)]])
    reference = Mesh.build(regular[: d + 1, :d], np.arange(d + 1)[None])
    for _ in range(20):
        points = random.normal(size=(d + 1, d))
        simplex = Mesh.build(points, np.arange(d + 1)[None])
        (expected,) = evaluate("mean_ratio", simplex)
        assert ratio(simplex, reference) == pytest.approx((expected, expected), rel=1e-12)
        same = simplex.with_points(3.0 * points @ turn(40, d).T + 5.0)
        assert ratio(same, simplex) == pytest.approx((1.0, 1.0), rel=1e-12)
