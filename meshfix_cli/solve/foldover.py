"""The global method: the foldover-free energy, minimised over all free vertices of a region at once.

Source: Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov, "Foldover-free maps in 50 lines of code", ACM
Transactions on Graphics 40 (2021); "the paper" below. The energy itself is in kernels/moves/foldover.hpp.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels

Array = NDArray[np.float64]

WEIGHT = 0.5  # of the measure in the energy: large ones make valid sooner, small ones make better shapes
MINIMISATIONS = 30  # with one target
ITERATIONS = 300  # of one minimisation
MEMORY = 8  # pairs of vectors that L-BFGS keeps
SMALLEST_TARGET = 0.05  # of the median: no target of a simplex that the embedding makes flat is smaller
LAST_EPS = 1e-10  # where all determinants are positive already


@dataclass(frozen=True, eq=False)
class Reach:
    """How far vertices may go.

    Attributes
    ----------
    start : (n, d) float64
        Where they were.
    distance : float
        Model units; infinite: anywhere.
    """

    start: Array
    distance: float = math.inf


def minimisations(
    points: Array, mesh: kernels.Connectivity, free: NDArray[np.bool_], reach: Reach, threads: int
) -> Iterator[Array]:
    """Yield the points (n, d) after each minimisation over the free vertices, until the targets are used up.

    A minimisation ends early where all simplices of the region are valid. A uniform target suits uniform meshes; the
    sizes that the simplices have in the graph's embedding suit graded ones, and the embedding is a third start.

    Parameters
    ----------
    points : (n, d) float64
    mesh : Connectivity
        With its stars.
    free : (n,) bool
        The vertices that move; the region is their stars.
    reach : Reach
    threads : int
        The energy and its gradient have the same bits for any number; those of the minimiser's sums depend on the
        threads of BLAS where there are more than some thousand vertices, so the command line allows it one.
    """
    if not (free.any() and reach.distance > 0):
        return
    region = _Region(mesh, free, reach, threads)
    yield from region.minimise(points, region.uniform(points))
    embedded = _embedding(points, mesh, free)
    sizes = region.sizes(embedded)
    yield from region.minimise(points, sizes)
    yield from region.minimise(embedded, sizes)  # its positions are drawn into reach


def _embedding(start: Array, mesh: kernels.Connectivity, free: NDArray[np.bool_]) -> Array:
    """Put each free vertex at the mean of its neighbours: the solution of the graph's Laplace equation.

    Returns
    -------
    (n, d) float64
        In the plane valid wherever the boundary is convex. Source: W. T. Tutte, "How to draw a graph", Proceedings of
        the London Mathematical Society 13 (1963).
    """
    from scipy.sparse import csr_matrix, identity
    from scipy.sparse.linalg import cg

    points, inner = start.copy(), np.flatnonzero(free)
    counts = np.diff(mesh.neighbour_offsets)
    rows = np.repeat(np.arange(len(free)), counts)
    kept = free[rows]
    number = np.cumsum(free) - 1
    begin, end = number[rows[kept]], mesh.neighbours[kept]
    inside = free[end]
    pairs = (begin[inside], number[end[inside]])
    # Divided by sqrt(number of neighbours) on both sides, so that the diagonal is one and the matrix symmetric.
    scale = 1 / np.sqrt(counts[inner])
    weights = scale[pairs[0]] * scale[pairs[1]]
    operator = identity(len(inner), format="csr") - csr_matrix((weights, pairs), (len(inner), len(inner)))
    middle = points[inner].mean(axis=0)
    for k in range(points.shape[1]):
        held = np.bincount(begin[~inside], weights=points[end[~inside], k] - middle[k], minlength=len(inner))
        solution, _ = cg(operator, scale * held, maxiter=1000)
        points[inner, k] = middle[k] + scale * solution
    return points


class _Region:
    """The stars of the free vertices.

    Attributes
    ----------
    moving : (f,) int
        The free vertices, in the numbers of the mesh.
    vertices : (k,) int
        These, then the others of the stars.
    global_simplices : (s, d+1) int32
        The simplices of the stars, in the numbers of the mesh.
    energy : kernels.Foldover
        The energy of these simplices, with the vertices numbered as in `vertices`.
    """

    def __init__(self, mesh: kernels.Connectivity, free: NDArray[np.bool_], reach: Reach, threads: int) -> None:
        simplices = mesh.simplices[free[mesh.simplices].any(axis=1)]
        rim = np.zeros(len(free), dtype=bool)
        rim[simplices] = True
        self.moving = np.flatnonzero(free)
        self.vertices = np.concatenate([self.moving, np.flatnonzero(rim & ~free)])
        number = np.full(len(free), -1, dtype=np.int32)
        number[self.vertices] = np.arange(len(self.vertices), dtype=np.int32)
        self.global_simplices = np.ascontiguousarray(simplices)
        self.energy = kernels.Foldover(np.ascontiguousarray(number[simplices]), len(self.vertices))
        self.reach, self.threads = reach, threads

    def uniform(self, points: Array) -> Array:
        """Return one target size for all (s,): the region's signed measure, which its boundary fixes, in equal parts.

        A size is the d-th root of a measure, in model units.
        """
        measure = kernels.measure(points, self.global_simplices, self.threads)[0]
        # A region whose own boundary is turned inside out may have no measure, or a negative one.
        mean = max(measure.mean(), 1e-3 * np.abs(measure).mean())
        return np.full(len(measure), max(mean, np.finfo(float).tiny) ** (1 / points.shape[1]))

    def sizes(self, points: Array) -> Array:
        """Return the sizes (s,) that the simplices have at positions (n, d), none much smaller than the others."""
        measure = kernels.measure(points, self.global_simplices, self.threads)[0]
        sizes = np.abs(measure) ** (1 / points.shape[1])
        return np.maximum(sizes, max(SMALLEST_TARGET * np.median(sizes), np.finfo(float).tiny))

    def valid(self, points: Array) -> bool:
        """Whether all simplices of the region are."""
        return len(kernels.check(points, self.global_simplices, self.threads)[0]) == 0

    def minimise(self, start: Array, sizes: Array) -> Iterator[Array]:
        """Yield the points after each minimisation; eps falls by the paper's rule in between."""
        problem = _Problem(self, start, sizes * math.factorial(start.shape[1]) ** (1 / start.shape[1]))
        x = problem.start
        problem.evaluate(x, 1.0)
        eps = max(1.0, -0.2 * problem.least)
        for _ in range(MINIMISATIONS):
            before, _ = problem.evaluate(x, eps)
            x = problem.minimise(x, eps)
            after, _ = problem.evaluate(x, eps)
            if not (math.isfinite(after) and math.isfinite(problem.least)):
                return
            yield problem.points(x)
            if problem.least > 0 and abs(before - after) < 1e-5 * abs(after):
                return
            eps = _next_eps(eps, problem.least, before, after)


def _next_eps(eps: float, least: float, before: float, after: float) -> float:
    """Section 3 of the paper: `least` is the smallest determinant, `before` and `after` are energies."""
    sigma = max(1 - after / before, 0.1)
    mu = (1 - sigma) * (least + math.hypot(eps, least)) / 2
    return 2 * math.sqrt(mu * (mu - least)) if least < mu else LAST_EPS


class _Valid(Exception):
    """Raised in the minimiser's callback, where a release of scipy before 1.11 knows no other way out."""


class _Problem:
    """The energy as a function of a vector x (f * d,): the free vertices in the coordinates of the region.

    Attributes
    ----------
    origin : (d,) float64
    unit : float
        Positions are origin + unit * x in model units; the unit is the mean target size.
    sizes : (s,) float64
        Targets, in that unit.
    least : float
        The smallest determinant where the energy was last asked for.
    """

    def __init__(self, region: _Region, points: Array, sizes: Array) -> None:
        self.region, self.all = region, points
        self.unit, self.origin = sizes.mean(), points[region.vertices].mean(axis=0)
        self.sizes = sizes / self.unit
        self.local = np.ascontiguousarray((points[region.vertices] - self.origin) / self.unit)
        self.least = -math.inf
        start, distance = region.reach.start[region.moving], region.reach.distance
        self.ball = _Ball((start - self.origin) / self.unit, distance / self.unit)
        self.start = self.ball.parameters(self.local[: len(start)]).ravel()

    def evaluate(self, x: Array, eps: float) -> tuple[float, Array]:
        """Return the energy and its gradient."""
        u = x.reshape(-1, self.local.shape[1])
        self.local[: len(u)] = self.ball.positions(u)
        energy, gradient, self.least = self.region.energy.evaluate(
            self.local, self.sizes, eps, WEIGHT, len(u), self.region.threads
        )
        return energy, self.ball.pulled_back(u, gradient).ravel()

    def points(self, x: Array) -> Array:
        """Return all points of the mesh (n, d)."""
        points = self.all.copy()
        moved = self.origin + self.unit * self.ball.positions(x.reshape(-1, points.shape[1]))
        start = self.region.reach.start[self.region.moving]
        outside = np.linalg.norm(moved - start, axis=1) > self.region.reach.distance  # by rounding
        points[self.region.moving] = np.where(outside[:, None], start, moved)
        return points

    def minimise(self, x: Array, eps: float) -> Array:
        """Run L-BFGS; it ends as soon as the region is valid."""
        from scipy.optimize import fmin_l_bfgs_b

        valid: list[Array] = []

        def stop_where_valid(x: Array) -> None:
            # The minimiser's last evaluation was at x: without a positive minimum there is nothing to look at.
            if self.least > 0 and self.region.valid(self.points(x)):
                valid.append(x.copy())
                raise _Valid

        try:
            return fmin_l_bfgs_b(
                self.evaluate, x, args=(eps,), m=MEMORY, maxiter=ITERATIONS, maxfun=2 * ITERATIONS, factr=1e7,
                pgtol=1e-8, callback=stop_where_valid,
            )[0]  # fmt: skip
        except _Valid:
            return valid[0]


@dataclass(frozen=True, eq=False)
class _Ball:
    """All of space as the parameters u of a ball: x = centre + radius u / sqrt(1 + u^2). No ball: x = u."""

    centres: Array
    radius: float

    def positions(self, u: Array) -> Array:
        if self.radius == math.inf:
            return u
        return self.centres + self.radius * u / np.sqrt(1 + (u * u).sum(axis=1, keepdims=True))

    def parameters(self, x: Array) -> Array:
        if self.radius == math.inf:
            return x.copy()
        share = (x - self.centres) / self.radius
        length = np.sqrt((share * share).sum(axis=1, keepdims=True))
        share *= np.minimum(1.0, 0.99 / np.maximum(length, 0.99))  # on the rim u would be infinite
        return share / np.sqrt(1 - (share * share).sum(axis=1, keepdims=True))

    def pulled_back(self, u: Array, gradient: Array) -> Array:
        if self.radius == math.inf:
            return gradient
        square = 1 + (u * u).sum(axis=1, keepdims=True)
        along = (u * gradient).sum(axis=1, keepdims=True)
        return self.radius / np.sqrt(square) * (gradient - along / square * u)
