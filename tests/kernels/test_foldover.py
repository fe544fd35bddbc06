"""The foldover-free energy, its minimiser, and the graph's embedding against definitions and scipy."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from geometries import grid
from meshes import built_for, tangle, with_an_inverted_fixed_simplex
from numpy.typing import NDArray
from scipy.optimize import fmin_l_bfgs_b
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import spsolve

from meshfix_cli import kernels
from meshfix_cli.mesh.mesh import Mesh

NONE = np.empty(0, dtype=np.int32)
ALIKE = ((NONE, NONE), np.empty(0))  # edges and weights of simplices


@pytest.mark.parametrize("shaped", [False, True])
@pytest.mark.parametrize("d", [2, 3])
def test_gradient_of_the_foldover_free_energy(random: np.random.Generator, d: int, shaped: bool) -> None:
    """Against central differences, with regular and with inverted simplices, for any targets and any threads."""
    n, free = 40, 25
    points = random.normal(size=(n, d))
    simplices = np.array([random.permutation(n)[: d + 1] for _ in range(123)], dtype=np.int32)
    sizes = random.uniform(0.5, 2.0, len(simplices))
    inverses = np.eye(d) + random.uniform(-0.4, 0.4, (len(simplices), d, d))
    targets = inverses if shaped else sizes

    def value(p: NDArray[np.float64]) -> float:
        return kernels.foldover_energy(simplices, p, targets, 0.4, 0.3, free, 1)[0]

    total, gradient, least = kernels.foldover_energy(simplices, points, targets, 0.4, 0.3, free, 1)
    jacobians = np.linalg.det(points[simplices[:, 1:]] - points[simplices[:, :1]])
    jacobians *= np.linalg.det(inverses) if shaped else sizes**-d
    assert least == pytest.approx(jacobians.min(), rel=1e-12)
    expected = np.zeros_like(gradient)
    for vertex, k in np.ndindex(free, d):
        step = np.zeros_like(points)
        step[vertex, k] = 1e-5
        expected[vertex, k] = (value(points + step) - value(points - step)) / 2e-5
    np.testing.assert_allclose(gradient, expected, rtol=1e-5, atol=1e-7 * np.abs(expected).max())
    again = kernels.foldover_energy(simplices, points, targets, 0.4, 0.3, free, 3)
    assert (again[0], again[1].tobytes()) == (total, gradient.tobytes())


@pytest.mark.parametrize("d", [2, 3])
def test_the_energy_is_that_of_the_publication(random: np.random.Generator, d: int) -> None:
    """Written out with matrices; 1 + weight * 2 for each regular simplex of its target's size, times d."""
    regular = np.array([[0, 0], [1, 0], [0.5, math.sqrt(0.75)]])
    if d == 3:
        regular = np.array(
            [[0, 0, 0], [1, 0, 0], [0.5, math.sqrt(0.75), 0], [0.5, math.sqrt(1 / 12), math.sqrt(2 / 3)]]
        )
    reference = (regular[1:] - regular[0]).T
    reference /= np.linalg.det(reference) ** (1 / d)
    simplex = np.arange(d + 1, dtype=np.int32)[None]
    for eps in (0.0, 0.7):
        points = random.normal(size=(d + 1, d))
        points = points if np.linalg.det(points[1:] - points[0]) > 0 or eps > 0 else points[:, ::-1].copy()
        jacobian = (points[1:] - points[0]).T @ np.linalg.inv(reference) / 1.7
        det = np.linalg.det(jacobian)
        chi = (det + math.hypot(det, eps)) / 2
        expected = np.trace(jacobian.T @ jacobian) / chi ** (2 / d) + 0.3 * (1 + det**2) / chi
        for targets in (np.array([1.7]), np.linalg.inv(reference)[None] / 1.7):
            actual = kernels.foldover_energy(simplex, points, targets, eps, 0.3, d + 1, 1)[0]
            assert actual == pytest.approx(expected, rel=1e-12)


def problem(
    mesh: Mesh,
    radius: float = math.inf,
    threads: int = 1,
    build: Any = kernels,
    *,
    shaped: bool = False,
    drawn: bool = False,
) -> Any:
    """All vertices of a mesh, the free ones first; balls are around where they are.

    Targets have one size: regular ones, or half a cube of it.
    """
    free = mesh.movable
    order = np.concatenate([np.flatnonzero(free), np.flatnonzero(~free)])
    number = np.argsort(order).astype(np.int32)
    points, simplices = mesh.points[order], np.ascontiguousarray(number[mesh.topology.simplices])
    targets = np.full(len(simplices), mesh.mean_edge_length())
    if shaped:
        targets = np.eye(mesh.dimension) / targets[:, None, None]
    return build.Foldover(points, simplices, targets, points[: free.sum()].copy(), radius, drawn, threads)


def with_free(mesh: Mesh, positions: NDArray[np.float64]) -> Mesh:
    points = mesh.points.copy()
    points[mesh.movable] = positions
    return mesh.with_points(points)


def hard(mesh: Mesh) -> Mesh:
    return tangle(mesh, 100, 2)


@pytest.mark.parametrize("radius", [math.inf, 4.0])
def test_the_minimiser_stops_at_the_first_valid_points(mesh: Mesh, radius: float) -> None:
    """Also where more iterations were allowed; with fewer the points are not valid yet."""
    start = hard(mesh)
    reach = radius * start.mean_edge_length()
    at_once = problem(start, reach)
    at_once.minimise(1.0, 0.5, 300, 0.0)
    evaluations = at_once.evaluations
    assert not with_free(start, at_once.points()).check()[0]
    assert np.linalg.norm(at_once.points() - start.points[start.movable], axis=1).max() <= reach
    at_once.minimise(1.0, 0.5, 300, 0.0)
    assert at_once.evaluations == evaluations + 1
    for iterations in range(300):
        one = problem(start, reach)
        one.minimise(1.0, 0.5, iterations, 0.0)
        left = with_free(start, one.points()).check()[0]
        if one.points().tobytes() == at_once.points().tobytes():
            assert not left
            break
        assert left
    assert iterations > 3


def test_the_minimum_is_that_of_another_minimiser(mesh: Mesh) -> None:
    """Where a fixed simplex is inverted it never stops early; scipy's L-BFGS goes on from its end and gains little."""
    start = with_an_inverted_fixed_simplex(mesh)
    ours = problem(start)
    before, after = ours.minimise(1.0, 0.5, 3000, 0.0)
    free = start.movable
    order = np.concatenate([np.flatnonzero(free), np.flatnonzero(~free)])
    simplices = np.argsort(order).astype(np.int32)[start.topology.simplices]
    unit, points = start.mean_edge_length(), start.points[order]
    points[: free.sum()] = ours.points()

    def energy(x: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        here = points / unit
        here[: free.sum()] = x.reshape(-1, points.shape[1])
        value, gradient, _ = kernels.foldover_energy(simplices, here, np.ones(len(simplices)), 1.0, 0.5, free.sum(), 1)
        return value, gradient.ravel()

    reached = (points[: free.sum()] / unit).ravel()
    assert energy(reached)[0] == pytest.approx(after, rel=1e-9)
    least = fmin_l_bfgs_b(energy, reached, maxiter=3000, maxfun=6000)[1]
    assert before - after > 0.98 * (before - least)
    assert ours.min_det < 0


@pytest.mark.parametrize(("radius", "drawn"), [(math.inf, False), (4.0, False), (0.7, True)])
def test_the_gradient_of_the_problem(mesh: Mesh, random: np.random.Generator, radius: float, drawn: bool) -> None:
    """By the variables, against central differences along random directions; what draws adds what it is said to."""
    start = hard(mesh)
    unit, count = start.mean_edge_length(), int(start.movable.sum())
    one = problem(start, radius * unit, drawn=drawn)
    centres = (start.points[start.movable] - start.points.mean(axis=0)) / unit
    u = random.normal(size=centres.shape) + (0.0 if radius == 4.0 else centres)
    value, gradient = one.evaluate(u, 1.0, 0.5, 7.0)
    tolerance = 1e-7 * float(np.linalg.norm(gradient))
    for _ in range(20):
        way = random.normal(size=u.shape)
        way /= np.linalg.norm(way)
        values = [one.evaluate(u + step * way, 1.0, 0.5, 7.0)[0] for step in (1e-5, -1e-5)]
        assert (values[0] - values[1]) / 2e-5 == pytest.approx((gradient * way).sum(), rel=1e-4, abs=tolerance)
    excess = np.maximum(np.linalg.norm(u - centres, axis=1) / (0.9999 * radius) - 1, 0) * drawn
    assert value - one.evaluate(u, 1.0, 0.5, 0.0)[0] == pytest.approx(7 * (excess**2).sum(), abs=1e-9 * value)
    assert 0 < (excess > 0).sum() < count or not drawn


def test_what_draws_has_the_same_bits_for_any_threads(random: np.random.Generator) -> None:
    """Of more vertices than one thread takes at a time."""
    axis = np.linspace(0, 1, 140)
    large = Mesh.build(*grid(axis, axis))
    u = random.normal(size=(int(large.movable.sum()), 2))
    seen = [problem(large, 1e-3, threads, drawn=True).evaluate(u, 1.0, 0.5, 1e3) for threads in (1, 2, 3)]
    assert len({(value, gradient.tobytes()) for value, gradient in seen}) == 1
    assert len(u) > 16384


def test_vertices_are_drawn_until_all_is_valid_and_inside(mesh: Mesh) -> None:
    """Of a tangle around where the vertices were, from a valid mesh, whose vertices are outside."""
    tangled, unit = tangle(mesh, 100, 0.5), mesh.mean_edge_length()
    order = np.concatenate([np.flatnonzero(mesh.movable), np.flatnonzero(~mesh.movable)])
    simplices = np.ascontiguousarray(np.argsort(order).astype(np.int32)[mesh.topology.simplices])
    centres, sizes = tangled.points[mesh.movable], np.full(len(simplices), unit)
    one = kernels.Foldover(mesh.points[order], simplices, sizes, centres, 0.499 * unit, True, 1)

    def outside() -> int:
        return int((np.linalg.norm(one.points() - centres, axis=1) > 0.499 * unit).sum())

    assert outside() == mesh.movable.sum()
    one.minimise(1e-2, 0.5, 300, 0.0, 1e3 * len(simplices))
    assert outside() == 0
    assert not with_free(mesh, one.points()).check()[0]


@pytest.mark.parametrize("radius", [math.inf, 0.5])
def test_where_valid_points_are_not_enough_the_minimiser_goes_on_to_the_targets(mesh: Mesh, radius: float) -> None:
    """From vertices a little beside where all elements have the shapes of their targets, which is the minimum."""
    exact, free = mesh.points, mesh.movable
    order = np.concatenate([np.flatnonzero(free), np.flatnonzero(~free)])
    simplices = np.ascontiguousarray(np.argsort(order)[mesh.topology.simplices].astype(np.int32))
    points, start = exact[order], tangle(mesh, 100, 0.1).points[order]
    edges = points[simplices[:, 1:]] - points[simplices[:, :1]]
    inverses = np.ascontiguousarray(np.linalg.inv(np.swapaxes(edges, 1, 2)))
    reach = radius * mesh.mean_edge_length()
    one = kernels.Foldover(start, simplices, inverses, start[: free.sum()].copy(), reach, False, 1)
    one.minimise(1e-10, 0.5, 0, 0.0)
    assert one.points() == pytest.approx(start[: free.sum()], abs=1e-12)
    before, after = one.minimise(1e-10, 0.5, 500, 0.0, until_valid=False)
    d = mesh.dimension
    assert before > after == pytest.approx((d + 1) * len(simplices), rel=1e-6)
    assert np.abs(one.points() - points[: free.sum()]).max() < 1e-3 * mesh.mean_edge_length()


@pytest.mark.parametrize("shaped", [False, True])
@pytest.mark.parametrize(("radius", "drawn"), [(math.inf, False), (4.0, False), (0.1, True)])
def test_the_minimiser_has_the_same_bits_for_any_threads_and_any_build(
    fine: Mesh, radius: float, drawn: bool, shaped: bool
) -> None:
    """Of more simplices and vertices than one thread takes at a time."""
    start = hard(fine)
    results = set()
    for threads, build in ((1, kernels), (2, kernels), (3, kernels), (1, built_for("_any")), (1, built_for("_avx2"))):
        one = problem(start, radius * start.mean_edge_length(), threads, build, shaped=shaped, drawn=drawn)
        results.add((one.minimise(1.0, 0.5, 12, 0.0, 1e5), one.points().tobytes(), one.min_det, one.evaluations))
    assert len(results) == 1
    assert len(fine.topology.simplices) > 8192


@pytest.mark.parametrize("part", [1.0, 0.6])
def test_the_embedding_is_the_solution_of_the_sparse_system(
    fine: Mesh, random: np.random.Generator, part: float
) -> None:
    """Against scipy's direct solver; what is held keeps its bits, and so does everything for any threads."""
    mesh, stars = tangle(fine, 100, 2), fine.topology.stars()
    points = mesh.along_curve(mesh.points)
    free = fine.along_curve(fine.movable) & (random.uniform(size=len(points)) < part)
    counts = np.diff(stars.neighbour_offsets)
    rows = np.repeat(np.arange(len(points)), counts)
    laplacian = diags(counts.astype(float)) - csr_matrix((np.ones(len(rows)), (rows, stars.neighbours)))
    expected = points.copy()
    held = laplacian[free][:, ~free] @ points[~free]
    expected[free] = spsolve(laplacian[free][:, free].tocsc(), -held)
    embedded = kernels.embedding(points, stars, free, *ALIKE, 1)
    assert np.abs(embedded - expected).max() < 1e-3 * mesh.mean_edge_length()
    assert embedded[~free].tobytes() == points[~free].tobytes()
    for threads in (2, 3):
        assert kernels.embedding(points, stars, free, *ALIKE, threads).tobytes() == embedded.tobytes()


@pytest.mark.parametrize("sizes", [1e6, 1e12])
def test_the_embedding_does_not_depend_on_where_its_vertices_come_from(fine: Mesh, sizes: float) -> None:
    stars, free = fine.topology.stars(), fine.along_curve(fine.movable)
    points = fine.along_curve(fine.points)
    far = points.copy()
    far[np.flatnonzero(free)[::7]] += sizes
    near, back = (kernels.embedding(start, stars, free, *ALIKE, 1) for start in (points, far))
    assert near.tobytes() == back.tobytes()
