"""Curved elements: nodes move until no element is invalid, then the worst are raised.

The linear programme runs on the Bezier coefficients of det J, first of the nodes on edges, faces and inside, then of
corners, with which the nodes go that lie between them. What it leaves is solved by an energy of all coefficients of a
region, minimised by L-BFGS. Then scaled Jacobians are raised, see `curved_shape.py`, and last, by the same energy with
a floor, coefficients that are small even so, step by step.

Source: for the linear programme Freitag and Plassmann, as everywhere; for barriers on Bezier coefficients T. Toulorge,
C. Geuzaine, J.-F. Remacle, J. Lambrechts, "Robust untangling of curvilinear meshes", Journal of Computational Physics
254 (2013); the form of the barrier is that of `foldover.py`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshfix_cli import kernels
from meshfix_cli.mesh.judged import VALID
from meshfix_cli.mesh.quadratic import Array, Mask, Quadratic
from meshfix_cli.quality.obstacles import proofs_of_curved
from meshfix_cli.solve.curved_shape import better_shapes
from meshfix_cli.solve.limits import Budget, Limits
from meshfix_cli.solve.records import Clock, SweepRecord
from meshfix_cli.solve.strategies import SMOOTHING

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh

CYCLES = 6  # of the linear programme
CUTS = (3, 3, 3, 6, 6, 6)  # of what is invalid then, into parts half as large, in each cycle
BARELY = 1e-3  # relative to the straight element: up to there the programme raises coefficients
RINGS = (1, 2, 4)  # around invalid elements, in which the energy is minimised
MINIMISATIONS, ITERATIONS = 14, 100  # in one region, and of one of them
MINIMISATIONS_OF_HOPELESS = 4
SHRINK = 0.4  # of eps from one minimisation to the next
POOR, RAISED = 0.2, 0.5  # coefficients below the first are raised, as far as the second
STEP, LEAST_STEP, NEARLY = 0.1, 0.02, 0.999  # of the floor; the last is this share of the highest
RAISING_RINGS = (1, 3)
RAISING_MINIMISATIONS, RAISING_ITERATIONS, RAISING_EPS, RAISING_SHRINK = 8, 60, 0.3, 0.3
RAISING_GAIN = 0.5  # share of what is missing by which a minimisation comes nearer, or the floor is out of reach
RELAXING_RINGS, RELAXING_SWEEPS = (1,), 8  # more of these seldom help where nodes have not given way enough
RELAXED = 0.1  # share of the way to the middle by which held nodes give way at a time
HALVINGS = 5  # that look for a smaller share

PARTS = "LP on coefficients of parts"
PROGRAMMES, ENERGY, RAISING = "LP on coefficients", "energy of coefficients", f"{SMOOTHING} curved elements"
RELAXING = "curved boundary gives way"

Step = tuple[str, Array]
Steps = Iterator[tuple["Mesh", SweepRecord]]


def steps(
    mesh: Quadratic, points: Array, limits: Limits, highest: float | None, budget: Budget | None = None
) -> Iterator[Step]:
    """Yield what is done and the points (n, d) after it; the last are never worse than the first.

    Parameters
    ----------
    mesh : Quadratic
    points : (n, d) float64
    limits : Limits
    highest : float or None
        How far scaled Jacobians are raised, see `better_shapes`; 1: as far as can be; None: no farther than validity
        takes.
    budget : Budget, optional
        Of what untangles.
    """
    run = _Run(mesh, points, limits, budget)
    yield from run.untangle()
    if highest is None or run.left:
        return
    for better in better_shapes(mesh, run.points, limits, run.free, highest, thorough=highest == 1):
        run.take(better)
        yield RAISING, better
    yield from run.raise_coefficients()


class _Seen(NamedTuple):
    """Points and what is judged of them, of each element (m,) and in sum; low: it has a coefficient not above 0."""

    points: Array
    invalid: Mask
    low: Mask
    left: int
    smallest: float
    jacobians: Array  # the smallest scaled one at a node


class _Run:
    def __init__(self, mesh: Quadratic, points: Array, limits: Limits, budget: Budget | None = None) -> None:
        self.mesh, self.limits, self.rest = mesh, limits, points
        self.budget = budget or Budget()
        self.free = limits.free & mesh.used
        self.sizes = mesh.kernel.sizes(points, limits.threads)
        self.now = self._seen(points)

    @property
    def points(self) -> Array:
        return self.now.points

    @property
    def left(self) -> int:
        return self.now.left

    def _seen(self, points: Array) -> _Seen:
        found = self.mesh.judge(points, self.limits.threads)
        invalid, smallest = found.verdicts != VALID, float(found.smallest.min(initial=math.inf))
        return _Seen(points, invalid, found.smallest <= 0, int(invalid.sum()), smallest, found.scaled_jacobians)

    def _rank(self, seen: _Seen) -> tuple[int, float]:
        """Smaller is better: fewer invalid elements, then larger coefficients of those that depend on a free node."""
        return seen.left, -float(self._smallest(seen.points, self.free, of_free=True).min(initial=math.inf))

    def _try(self, name: str, points: Array) -> Iterator[Step]:
        """Take points if they are better."""
        found = self._seen(points)
        if self._rank(found) < self._rank(self.now):
            self.now = found
            yield name, points

    def untangle(self, regions: tuple[int, ...] = RINGS) -> Iterator[Step]:
        """Look for valid positions: of the nodes between corners, and where these do not suffice of corners as well."""
        for free in (self.free & ~self.mesh.corners, self.free):
            if self.left and self.budget.take():
                yield from self._programmes(free)
            for rings in regions:
                if self.left:
                    yield from self.minimise(free & self.mesh.near(self.now.low, rings))

    def _programmes(self, free: Mask) -> Iterator[Step]:
        """Sweeps of the linear programme over the nodes of elements that are not certified; the best ones are kept."""
        corners, points, low = self.mesh.corners, self.points, self.now.low
        best = (int(low.sum()), points)
        for _ in range(CYCLES):
            for some, tied in ((~corners, False), (corners, True)):
                nodes = free & some & self.mesh.of(low)
                if self.left == 0 or not nodes.any():
                    continue
                points = self._relocated(points, nodes, tied)
                low = self.mesh.judge(points, self.limits.threads).smallest <= 0
                best = min(best, (int(low.sum()), points), key=lambda one: one[0])
        if best[1] is not self.points:
            yield from self._try(PROGRAMMES, best[1])

    def of_parts(self) -> Iterator[Step]:
        """The same over the nodes of invalid elements, with coefficients of their parts: those are nearer to det J."""
        corners, points, invalid = self.mesh.corners, self.points, self.now.invalid
        for cuts in CUTS:
            for some, tied in ((~corners, False), (corners, True)):
                nodes = self.free & some & self.mesh.of(invalid)
                if self.left == 0 or not (nodes.any() and self.budget.take()):
                    continue
                points = self._relocated(points, nodes, tied, cuts)
                yield from self._try(PARTS, points)
                invalid = self.mesh.judge(points, self.limits.threads).verdicts != VALID

    def _relocated(self, points: Array, nodes: Mask, tied: bool, halvings: int = 0) -> Array:
        free, rows = self.free.astype(np.uint8), np.flatnonzero(nodes).astype(np.int32)
        start, reach = self.limits.start, self.limits.max_move
        return self.mesh.kernel.relocate(points, self.sizes, free, rows, start, reach, BARELY, tied, halvings)[0]

    def _energy(self, region: Mask) -> kernels.QuadraticEnergy:
        return self.limits.energy(self.mesh, self.points, self.rest, self.sizes, region)

    def minimise(self, region: Mask, most: int = MINIMISATIONS) -> Iterator[Step]:
        """Minimise the energy over the nodes of a region, until no element is invalid, or so many times."""
        if not region.any():
            return
        energy, eps = self._energy(region), 1.0
        for _ in range(most):
            if not self.budget.take():
                return
            least = energy.minimise(eps, 0.0, ITERATIONS)[2]
            yield from self._try(ENERGY, energy.points(self.points.shape[1]))
            if least > 0 or self.left == 0:
                return
            eps *= SHRINK

    def take(self, points: Array) -> None:
        """Go on from points."""
        self.now, self.sizes = self._seen(points), self.mesh.kernel.sizes(points, self.limits.threads)

    def raise_coefficients(self) -> Iterator[Step]:
        """Raise coefficients that are smaller than shapes tell, where held nodes do not keep them, by nodes first."""
        of_free, of_held = (self._smallest(self.points, self.free, of_free) for of_free in (True, False))
        if not ((of_free < np.minimum(self.now.jacobians, POOR)) & (of_held >= POOR)).any():
            return
        sizes = self.sizes
        for free in (self.free & ~self.mesh.corners, self.free):
            if free is self.free and self.now.smallest >= POOR:
                return
            if (yield from self._raise(free, sizes)):
                yield from self._raise(free, sizes, patient=True)

    def _raise(self, free: Mask, sizes: Array, patient: bool = False) -> Generator[Step, None, bool]:
        """Raise coefficients step by step, relative to sizes (m,) at least; return whether any cost too much.

        Elements that held nodes keep low are left out. Patient: what costs too much is not taken, but gone on from.
        """
        step, floor, kept, quality, refused = STEP, STEP, self.now, self._quality(self.now), False
        while floor < RAISED and step >= LEAST_STEP:
            floor = min(floor, NEARLY * RAISED)
            straight = self.mesh.kernel.sizes(self.points, self.limits.threads)
            self.rest, self.sizes = self.points, np.maximum(straight, sizes)
            stuck = self._smallest(self.points, free, of_free=False) <= floor
            if stuck.all():
                break
            low = ~stuck & (self._smallest(self.points, free, of_free=True) <= floor)
            found = None if low.any() else self.now
            region = np.zeros_like(free)
            for rings in RAISING_RINGS:
                smaller, region = region, free & self.mesh.near(low, rings)
                if found is None and (region != smaller).any():
                    found = self._above(region, floor)
            reached = quality if found is None or found is kept else self._quality(found)
            costly = _costs_too_much(quality, reached)
            refused |= costly
            if found is None or (costly and not patient):
                step /= 2
                floor -= step
                continue
            if found is not self.now:
                if self._rank(found) >= self._rank(self.now):
                    break
                self.now = found
                if not costly:
                    kept, quality = found, reached
                    yield RAISING, found.points
            floor += step
        self.now = kept
        return refused

    def _quality(self, seen: _Seen) -> Array:
        """Return the smallest scaled Jacobian (2, m) at the nodes of each element, and there and as a straight one."""
        straight = self.mesh.judge(self.mesh.straight(seen.points), self.limits.threads)
        return np.stack([seen.jacobians, np.minimum(seen.jacobians, straight.scaled_jacobians)])

    def _smallest(self, points: Array, free: Mask, of_free: bool) -> Array:
        return self.mesh.kernel.smallest(points, self.sizes, free.astype(np.uint8), of_free, self.limits.threads)

    def _above(self, region: Mask, floor: float) -> _Seen | None:
        """Return points where all coefficients that depend on a region's nodes are above a floor, if they are found."""
        energy, eps, largest = self._energy(region), RAISING_EPS, -math.inf
        for _ in range(RAISING_MINIMISATIONS):
            least = energy.minimise(eps, floor, RAISING_ITERATIONS)[2]
            if least > floor:
                return self._seen(energy.points(self.points.shape[1]))
            if least - largest < RAISING_GAIN * (floor - least):
                return None
            eps, largest = eps * RAISING_SHRINK, max(largest, least)
        return None


def _costs_too_much(before: Array, after: Array) -> bool:
    """Whether the worst of one of the qualities (2, m) of the elements that change falls.

    Relative to the straight element coefficients rise as well where that becomes thin; and where it is thinner than the
    curved one, that could become so too.
    """
    changed = after != before
    was, now = (one.min(axis=1, where=changed, initial=math.inf) for one in (before, after))
    return bool((now < was).any())


def relaxed(mesh: Quadratic, points: Array, limits: Limits, held: Mask) -> Array | None:
    """Return positions where held nodes give way as little as is found to do, and all elements are valid; None: none.

    Each goes straight towards where the straight element has it, by a share of the way.

    Parameters
    ----------
    mesh : Quadratic
    points : (n, d) float64
        As near to valid as they come with all of them held.
    limits : Limits
    held : (n,) bool
        The nodes, none of them a corner, that may give way.
    """
    share = np.zeros(mesh.n)
    way = mesh.straight(points) - points
    far = np.linalg.norm(way, axis=1)
    most_of = np.minimum(1.0, limits.max_move / np.maximum(far, np.finfo(float).tiny))  # of the way, for each
    held = held & ~limits.free & (far > 0)

    def solved(start: Array, shares: Array) -> tuple[Array, Mask]:
        moved = start.copy()
        moved[held] = points[held] + shares[held, None] * way[held]
        run = _Run(mesh, moved, limits, Budget(RELAXING_SWEEPS))
        proved = run.now.invalid & (proofs_of_curved(mesh, moved, limits.free, run.now.invalid) > 0)
        if proved.any():  # to try would be in vain
            return start, proved
        for _ in run.untangle(RELAXING_RINGS):
            pass
        return run.points, run.now.invalid

    found, invalid = solved(points, share)
    while invalid.any():
        giving = held & mesh.of(invalid) & (share < most_of)
        if not giving.any():
            return None
        share[giving] = np.minimum(share[giving] + RELAXED, most_of[giving])
        found, invalid = solved(found, share)
    least, most = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (least + most) / 2
        trial, invalid = solved(found, middle * share)
        if invalid.any():
            least = middle
        else:
            most, found = middle, trial
    return found


def curved_steps(
    mesh: Mesh,
    straight: Callable[[Mesh], Steps],
    *,
    highest: float | None,
    relax: bool,
    max_move: float,
    threads: int,
    sweeps: int | None = None,
) -> Steps:
    """Yield a mesh of curved elements and a record, as it came and after each step; see `untangle.steps`.

    Where corners are tangled, or all is to be as good as can be, the straight elements are untangled and smoothed
    first, and the other nodes go along.

    Parameters
    ----------
    mesh : Mesh
        With its `quadratic` elements.
    straight : callable
        Untangles the straight elements, in as many sweeps as are allowed, and smooths them.
    highest : float or None
        See `steps`.
    relax : bool
        Let held nodes of the boundary give way where nothing else helps, see `relaxed`.
    max_move : float
        No node goes farther from where it was, in model units.
    threads : int
    sweeps : int, optional
        Limit of those that untangle, these of straight elements among them; that the boundary gives way is one.
    """
    quadratic, budget = mesh.quadratic, Budget(sweeps)
    assert quadratic is not None
    clock, limits = Clock(mesh, threads), _limits(mesh, mesh.points, max_move, threads)
    first = clock.record("input", mesh)
    yield mesh, first
    best, found = mesh, [mesh]
    invalid = quadratic.judge(mesh.points, threads).verdicts != VALID
    hopeless = proofs_of_curved(quadratic, mesh.points, limits.free, invalid) == 1
    if highest == 1 or _is_tangled(mesh, threads):
        for moved, record in straight(replace(mesh, quadratic=None)):
            followed = quadratic.follow(mesh.points, moved.points)
            best = replace(moved, quadratic=quadratic).with_points(followed)
            if record.sweep:
                budget.left -= not record.phase.startswith(SMOOTHING)
                yield best, replace(record, phase=f"straight elements, {record.phase}")
        clock.points = best.points
    enough = (best.points == mesh.points).all() or (highest != 1 and best.check(threads)[0] < first.inverted)
    for start in [best] if enough else [best, mesh]:
        best = start
        for name, best in _mended(start, hopeless, limits, highest, budget):
            yield best, clock.record(name, best)
        found.append(best)
        if highest == 1:
            continue
        left = best.judge_curved(threads)[0]
        if not left.any():
            return
        proofs = proofs_of_curved(quadratic, best.points, limits.free, left[quadratic.rows])
        left[quadratic.rows[proofs > 0]] = False
        if not left.any():
            break
    best = min(found, key=lambda one: _rank(one, limits))
    if relax and best.check(threads)[0] and budget.take():
        given = relaxed(quadratic, best.points, limits, quadratic.giving)
        if given is not None:
            best = best.with_points(given)
            yield best, clock.record(RELAXING, best)
            for name, points in steps(quadratic, given, limits, highest, budget):
                best = best.with_points(points)
                yield best, clock.record(name, best)
    if clock.points is not best.points:
        yield best, clock.record("best", best)


def _mended(
    mesh: Mesh, hopeless: Mask, limits: Limits, highest: float | None, budget: Budget
) -> Iterator[tuple[str, Mesh]]:
    """Yield what is done to curved elements but hopeless ones (k,), and the mesh after it; see `steps`.

    The programme and the energy would try to mend these in vain, and not see what becomes of others: so they come last.
    """
    quadratic, threads = mesh.quadratic, limits.threads
    assert quadratic is not None
    if not hopeless.all():
        others = quadratic.part(~hopeless) if hopeless.any() else quadratic
        for name, points in steps(others, mesh.points, limits, None if hopeless.any() else highest, budget):
            mesh = mesh.with_points(points)
            yield name, mesh
    if hopeless.any():  # what is best for others alone may have been bad for these
        run = _Run(quadratic, mesh.points, limits, budget)
        for name, points in run.minimise(run.free & quadratic.near(hopeless, RINGS[0]), MINIMISATIONS_OF_HOPELESS):
            mesh = mesh.with_points(points)
            yield name, mesh
    invalid = quadratic.judge(mesh.points, threads).verdicts != VALID
    if not (invalid & ~hopeless).any():
        return
    proved = hopeless | (proofs_of_curved(quadratic, mesh.points, limits.free, invalid) > 0)
    if (invalid & ~proved).any():
        run = _Run(quadratic.part(~(hopeless | (invalid & proved))), mesh.points, limits, budget)
        for name, points in run.of_parts():
            mesh = mesh.with_points(points)
            yield name, mesh


def _rank(mesh: Mesh, limits: Limits) -> tuple[int, float, float]:
    """Return how good a mesh is, the smaller the better: where held nodes keep the worst as it is, the mean tells."""
    assert mesh.quadratic is not None
    inverted, judged = mesh.check(limits.threads)[0], mesh.quadratic.judge(mesh.points, limits.threads)
    values = judged.smallest if inverted else judged.scaled_jacobians
    worst = values[mesh.quadratic.with_one(limits.free)].min(initial=math.inf)
    return inverted, -float(worst), -float(values.mean())


def giving_way(mesh: Mesh, start: Array, max_move: float, threads: int) -> tuple[int, float] | None:
    """Return how many nodes of the boundary would give way, and by how much at most; None: that is no use.

    See `relaxed`.

    Parameters
    ----------
    mesh : Mesh
        As near to valid as it comes.
    start : (n, d) float64
    max_move : float
    threads : int
        See `Limits`.
    """
    quadratic = mesh.quadratic
    assert quadratic is not None
    found = relaxed(quadratic, mesh.points, _limits(mesh, start, max_move, threads), quadratic.giving)
    if found is None:
        return None
    ways = np.linalg.norm(found - mesh.points, axis=1)[quadratic.giving]
    return int((ways > 0).sum()), float(ways.max(initial=0.0))


def _is_tangled(mesh: Mesh, threads: int) -> bool:
    """Whether a straight element with a free corner is inverted, and so is what it stands for where that is curved."""
    rows = mesh.topology.connectivity.rows
    straight = np.zeros(mesh.topology.m, dtype=bool)
    straight[rows[mesh.judged().check(mesh.along_curve(mesh.points), threads)[0]]] = True
    straight[rows[mesh.stuck(threads)]] = False
    return bool((straight & mesh.judge_curved(threads)[0]).any())


def _limits(mesh: Mesh, start: Array, max_move: float, threads: int) -> Limits:
    """Let nodes move that may, and corners, but those of other elements, which stay straight."""
    quadratic, others = mesh.quadratic, np.ones(mesh.topology.m, dtype=bool)
    assert quadratic is not None
    others[quadratic.rows] = False
    corners = mesh.anywhere.copy()
    for block in mesh.topology.blocks:
        corners[block.vertices[others[block.rows]]] = False
    return Limits(corners | quadratic.free, start, max_move, threads)
