"""The global method: the foldover-free energy, minimised over all free vertices of a region at once.

Source: Garanzha, Kaporin, Kudryavtseva, Protais, Ray, Sokolov, "Foldover-free maps in 50 lines of code", ACM
Transactions on Graphics 40 (2021); "the paper" below. The energy and its minimiser, L-BFGS, are in kernels/moves:
foldover.hpp, foldover_problem.hpp and lbfgs.hpp.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import JUDGED
from meshfix_cli.solve.chords import inverse_lengths
from meshfix_cli.solve.region import Region

if TYPE_CHECKING:
    from meshfix_cli.mesh.freedom import Freedom

Array = NDArray[np.float64]

WEIGHT = 0.5  # of the measure in the energy: large ones make valid sooner, small ones make better shapes
REGION_PATIENCE = 5  # minimisations without fewer inverted elements after which a larger region is tried
MINIMISATIONS = 30  # with one target
ITERATIONS = 300  # of one minimisation
SMALLEST_TARGET = 0.05  # of the median: no target of a simplex that the embedding makes flat is smaller
WITHIN = 1 - 1e-12  # of the distance that vertices may go, whatever is rounded
LAST_EPS = 1e-10  # where all determinants are positive already
DRAWING_EPS = 1e-2  # where vertices are drawn into reach
PULLS = tuple(10 ** (k / 2) for k in range(18))  # on the vertices, one after the other, for each simplex


@dataclass(frozen=True)
class Effort:
    """When a minimisation ends, and how fast eps falls after it.

    Attributes
    ----------
    gain : float
        Share of the energy of the inverted simplices by which an iteration must lower the energy, to go on.
    least_share : float
        The smallest sigma of the paper's rule for eps.
    """

    gain: float
    least_share: float


QUICK = Effort(1e-3, 0.3)
THOROUGH = Effort(0.0, 0.1)  # the paper's


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

    def drawn_in(self, points: Array) -> Array:
        """Return points (n, d) with those that are too far drawn straight back."""
        way = points - self.start
        length = np.linalg.norm(way, axis=1)
        far = length > self.distance
        near = points.copy()
        near[far] = self.start[far] + (self.distance * WITHIN / length[far])[:, None] * way[far]
        return near


def minimisations(
    points: Array,
    mesh: kernels.Connectivity,
    free: NDArray[np.bool_],
    reach: Reach,
    threads: int,
    efforts: tuple[Effort, ...] = (QUICK, THOROUGH),
    freedom: Freedom | None = None,
) -> Iterator[Array]:
    """Yield the points (n, d) after each minimisation over the free vertices, until the targets are used up.

    A minimisation ends where all simplices of the region are valid, at the first such points that it sees. A uniform
    target suits uniform meshes; the sizes that the simplices have in the graph's embedding suit graded ones, and the
    embedding is a third start.

    Parameters
    ----------
    points : (n, d) float64
    mesh : Connectivity
        With its stars.
    free : (n,) bool
        The vertices that move; the region is their stars.
    reach : Reach
    threads : int
        The points have the same bits for any number.
    efforts : tuple of Effort
        All of that is tried with one after the other.
    freedom : Freedom, optional
        Where the free vertices may go.
    """
    if not (free.any() and reach.distance > 0):
        return
    region = FoldoverRegion(mesh, free, reach, threads, freedom)
    for effort in efforts:
        yield from region.minimise(points, region.uniform(points), effort)
        embedded = embedding(points, mesh, free, threads, freedom)
        sizes = region.sizes(embedded)
        yield from region.minimise(points, sizes, effort)
        yield from region.minimise(embedded, sizes, effort)  # its positions are drawn into reach


def around(
    stars: kernels.Connectivity, free: NDArray[np.bool_], broken: NDArray[np.bool_], rings: int | None
) -> NDArray[np.bool_]:
    """Return the free vertices (n,) in so many rings around those of inverted elements; None: all."""
    return free if rings is None else free & stars.grown(broken, rings).view(bool)


def minimisations_in_regions(
    regions: tuple[int | None, ...],
    max_move: float,
    threads: int,
    freedom: Freedom | None,
    stars: kernels.Connectivity,
    points: Array,
    start: Array,
    free: NDArray[np.bool_],
    broken: NDArray[np.bool_],
) -> Iterator[Array]:
    """Yield the points after each minimisation of the energy, in one region after the other; see `Phase.rings`."""
    reach = Reach(start, max_move)
    for rings in regions:
        near = around(stars, free, broken, rings)
        if rings is not None and 2 * near.sum() > free.sum():
            return  # as good as the whole mesh
        efforts = (QUICK, THOROUGH) if rings is None else (QUICK,)
        fewest, waited = len(stars.simplices), 0
        for moved in minimisations(points, stars, near, reach, threads, efforts, freedom):
            points = moved
            yield points
            left = len(kernels.check(points, stars.simplices, threads)[0])
            waited = 0 if left < fewest else waited + 1
            fewest = min(fewest, left)
            if rings is not None and waited == REGION_PATIENCE:
                break
        if rings is None:
            yield from drawn_into_reach(stars, near, reach, threads, freedom)


def drawn_into_reach(
    mesh: kernels.Connectivity,
    free: NDArray[np.bool_],
    reach: Reach,
    threads: int,
    freedom: Freedom | None = None,
) -> Iterator[Array]:
    """Yield the points (n, d) of a valid mesh that was found where vertices may go anywhere, when all are in reach.

    Nothing is yielded where there is no such mesh; where the reach is too small, drawing inverts simplices again, but
    few. The parameters are those of `minimisations`; it begins where the vertices were.
    """
    if not (free.any() and 0 < reach.distance < math.inf):
        return
    region = FoldoverRegion(mesh, free, reach, threads, freedom)
    for points in minimisations(reach.start, mesh, free, Reach(reach.start), threads, freedom=freedom):
        if region.is_valid(points):
            yield from region.draw(points)
            return


def minimisations_to(
    points: Array,
    mesh: kernels.Connectivity,
    free: NDArray[np.bool_],
    inverses: Array,
    reach: Reach,
    threads: int,
    until_valid: bool = True,
    freedom: Freedom | None = None,
) -> Iterator[Array]:
    """Yield the points (n, d) after each minimisation, with a target of its own shape for each simplex.

    Parameters
    ----------
    points, mesh, free, reach, threads
        See `minimisations`.
    inverses : (m, d, d) float64
        Of the matrices whose columns are the edges that lead from the first vertex of each target.
    until_valid : bool
        End where all simplices of the region are valid. Otherwise the points are valid already, and stay so: each
        minimisation goes on from the last.
    freedom : Freedom, optional
        Where the free vertices may go.
    """
    if not (free.any() and reach.distance > 0):
        return
    region = FoldoverRegion(mesh, free, reach, threads, freedom)
    targets = np.ascontiguousarray(inverses[region.rows])
    if until_valid:
        yield from (moved for effort in (QUICK, THOROUGH) for moved in region.minimise(points, targets, effort))
    else:
        yield from region.approach(points, targets)


def evened(
    points: Array,
    mesh: kernels.Connectivity,
    free: NDArray[np.bool_],
    threads: int,
    iterations: int,
    freedom: Freedom | None = None,
) -> Array:
    """Return valid points (n, d) on the way from others to where the energy of the uniform target is smallest.

    The parameters are those of `minimisations`.
    """
    return FoldoverRegion(mesh, free, Reach(points), threads, freedom).even(points, iterations)


def embedding(
    start: Array,
    mesh: kernels.Connectivity,
    free: NDArray[np.bool_],
    threads: int = 1,
    freedom: Freedom | None = None,
) -> Array:
    """Put each free vertex at the mean of its neighbours: the solution of the graph's Laplace equation.

    Where elements are not all simplices, the neighbours are those along edges, with the weights of `inverse_lengths`.
    Vertices that slide come first, each among those in its line, and then in its plane.

    Returns
    -------
    (n, d) float64
        In the plane valid wherever the boundary is convex. Source: W. T. Tutte, "How to draw a graph", Proceedings of
        the London Mathematical Society 13 (1963).
    """
    points = start
    if freedom is not None:
        none = (np.empty(0, dtype=np.int32),) * 2
        for degrees in (1, 2):
            some = free & (freedom.degrees == degrees)
            if some.any():
                points = kernels.embedding(points, mesh, some, none, np.empty(0), threads, freedom.kernel)
        points, free = freedom.onto(points, start), free & (freedom.degrees == 0)
    return kernels.embedding(points, mesh, free, *inverse_lengths(points, mesh, free, threads), threads)


class FoldoverRegion(Region):
    """The stars of the free vertices, and how far these may go."""

    def __init__(
        self,
        mesh: kernels.Connectivity,
        free: NDArray[np.bool_],
        reach: Reach,
        threads: int,
        freedom: Freedom | None = None,
    ) -> None:
        super().__init__(mesh, free)
        self.reach, self.threads = reach, threads
        self.freedom = None if freedom is None else freedom.of(self.moving)
        self.codes = None if mesh.simplicial else mesh.codes[mesh.owners[self.rows]]

    def uniform(self, points: Array) -> Array:
        """Return one target for all (s,): the region's signed measure, which its boundary fixes, in equal parts.

        A target is the size of a regular simplex: the d-th root of its determinant, in model units. Where elements are
        not all simplices, it is the ideal corner of edges of one length.
        """
        return self._targets(np.full(len(self.rows), self.size(points)))

    def size(self, points: Array) -> float:
        """Return the size of the uniform target, in model units."""
        measure = kernels.measure(points, self.global_simplices, self.threads)[0]
        # A region whose own boundary is turned inside out may have no measure, or a negative one.
        mean = max(measure.mean(), 1e-3 * np.abs(measure).mean())
        return float(max(mean / self._unit_measures().mean(), np.finfo(float).tiny) ** (1 / points.shape[1]))

    def sizes(self, points: Array) -> Array:
        """Return targets (s,) of the sizes that the simplices have at positions (n, d), none much smaller than most."""
        measure = kernels.measure(points, self.global_simplices, self.threads)[0]
        sizes = (np.abs(measure) / self._unit_measures()) ** (1 / points.shape[1])
        return self._targets(np.maximum(sizes, max(SMALLEST_TARGET * np.median(sizes), np.finfo(float).tiny)))

    def _unit_measures(self) -> Array:
        """Return the measures of what has size one: (1,) where all are simplices, else (s,)."""
        if self.codes is None:
            return np.ones(1)
        d = self.simplices.shape[1] - 1
        return (1 / math.factorial(d) / np.array([one.shape.weight for one in JUDGED]))[self.codes]

    def _targets(self, sizes: Array) -> Array:
        """Turn sizes (s,), d-th roots of measures or lengths of edges, into targets of the energy."""
        d = self.simplices.shape[1] - 1
        if self.codes is None:
            return sizes * math.factorial(d) ** (1 / d)
        inverses = np.zeros((len(JUDGED), d, d))
        for code, element in enumerate(JUDGED):
            if element.shape.dimension == d:
                inverses[code] = np.linalg.inv(np.array(element.shape.ideal).T)
        return np.ascontiguousarray(inverses[self.codes] / sizes[:, None, None])

    def minimise(self, start: Array, targets: Array, effort: Effort) -> Iterator[Array]:
        """Yield the points after each minimisation; eps falls by the paper's rule in between."""
        problem = self._problem(start, targets)
        eps = max(1.0, -0.2 * problem.min_det)
        for _ in range(MINIMISATIONS):
            before, after = problem.minimise(eps, WEIGHT, ITERATIONS, effort.gain)
            if not (math.isfinite(after) and math.isfinite(problem.min_det)):
                return
            yield self._moved(start, problem)
            if problem.min_det > 0 and abs(before - after) < 1e-5 * abs(after):
                return
            sigma = max(1 - after / before, effort.least_share)
            eps = next_eps(eps, problem.min_det, sigma)

    def even(self, valid: Array, iterations: int) -> Array:
        """Return valid points on the way from others to where the energy of the uniform target is smallest."""
        problem = self._problem(valid, self.uniform(valid))
        problem.minimise(LAST_EPS, WEIGHT, iterations, 0.0, until_valid=False)
        return self.retreated(valid, self._moved(valid, problem), -math.inf, self.threads)

    def draw(self, valid: Array) -> Iterator[Array]:
        """Yield the points of a valid mesh once they are drawn into reach; the pull rises until all of them are."""
        problem = self._problem(valid, self.sizes(valid), drawn=True)
        for pull in PULLS:
            problem.minimise(DRAWING_EPS, WEIGHT, ITERATIONS, 0.0, pull * len(self.simplices))
            points = self._moved(valid, problem)
            way = np.linalg.norm(points[self.moving] - self.reach.start[self.moving], axis=1)
            if way.max() <= self.reach.distance:
                yield points
                return

    def is_valid(self, points: Array) -> bool:
        """Whether no simplex of the region is inverted."""
        return len(kernels.check(points, self.global_simplices, self.threads)[0]) == 0

    def approach(self, start: Array, targets: Array) -> Iterator[Array]:
        """Yield valid points after each minimisation from valid ones; that a simplex is inverted costs too much.

        The energy does not see that an element is invalid inside: its vertices go back, and nothing follows.
        """
        problem, points = self._problem(start, targets), start
        while True:
            before, after = problem.minimise(LAST_EPS, WEIGHT, ITERATIONS, 0.0, until_valid=False)
            moved = self._moved(start, problem)
            if not (after < before and self.is_valid(moved)):
                return
            points = self.retreated(points, moved, -math.inf, self.threads)
            yield points
            if points is not moved:
                return

    def _problem(self, start: Array, targets: Array, drawn: bool = False) -> kernels.Foldover:
        """Make the energy of targets (s,), or of the inverse matrices (s, d, d) of those."""
        return kernels.Foldover(
            start[self.vertices], self.simplices, targets, self.reach.start[self.moving], self.reach.distance, drawn,
            self.threads, self.freedom,
        )  # fmt: skip

    def _moved(self, start: Array, problem: kernels.Foldover) -> Array:
        points = start.copy()
        points[self.moving] = problem.points()
        return points


def next_eps(eps: float, least: float, sigma: float) -> float:
    """Section 3 of the paper: `least` is the smallest determinant, `sigma` the share by which the energy fell."""
    mu = (1 - sigma) * (least + math.hypot(eps, least)) / 2
    return 2 * math.sqrt(mu * (mu - least)) if least < mu else LAST_EPS
