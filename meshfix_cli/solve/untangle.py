"""The one loop that runs the phases of a strategy."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import cycle, islice
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.quality.obstacles import find_obstacles
from meshfix_cli.solve.records import Outcome, SweepRecord
from meshfix_cli.solve.strategies import SMOOTH, SMOOTHING, SWEEPS, THRESHOLD, Move, Phase, plan
from meshfix_cli.solve.team import Alone

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.solve.team import Team

GAIN = 0.01  # degrees: a valid mesh of which "best" makes no more than that is left alone
ANGLE_STEPS = 2.0**32  # of a radian
FLOOR = 1  # percentile of the smallest angles: the sweeps for the mean angle let no element fall below it
RAISE = 3.0  # degrees above the smallest angle at which the next sweep of "best" optimises
RISE = 0.01  # degrees by which the smallest angle must rise, in `RAISE_PATIENCE` sweeps, to go on
RAISE_PATIENCE = 2
PATIENCE = 3  # turns through the moves of a phase without progress after which it has stalled
PROGRESS = 1e-3  # by which the smallest measure must rise to count as progress, relative
NEAR = 1  # rings around the vertices of inverted elements, and around what FF moved, that `only_invalid` smooths


def steps(
    mesh: Mesh,
    phases: Iterable[Phase],
    *,
    sweeps: int | None = None,
    threshold: float | None = None,
    max_move: float = math.inf,
    only_invalid: bool = False,
    hopeless: NDArray[np.bool_] | None = None,
    threads: int = 1,
    team: Team | None = None,
) -> Iterator[tuple[Mesh, SweepRecord]]:
    """Run the phases; yield the mesh and a record as it came and after each sweep.

    A valid mesh without an angle below the threshold, but for simplices without a free vertex, is left alone, unless a
    phase goes up to the ceiling.

    A phase that starts from the best mesh where that is not the last one begins with a record of phase "best";
    smoothing does. The last mesh is never worse than the first, by (inverted elements, smallest measure); where phases
    that go up to the ceiling gain nothing, it is the first.

    Parameters
    ----------
    sweeps : int, optional
        Limit of the untangling sweeps, all phases together; default: those of each phase alone.
    threshold : float, optional
        Degrees; the active-set method runs on stars with a smaller angle. Default: `THRESHOLD`.
    max_move : float
        No vertex goes farther from where it was, in model units.
    only_invalid : bool
        Move nothing but the stars of inverted elements and the rings around them, as many as it takes.
    hopeless : (m,) bool, optional
        Simplices, in the order of the connectivity, that may be inverted for good: see `Obstacles.hopeless`. Sweeps
        try to mend them, but the energy is not minimised for them.
    threads : int
    team : Team, optional
        The processes of which each has a part of the mesh; the meshes are parts, the records are of the whole.

    Notes
    -----
    Source: section 4; the combined smoothing is that of section 3.3.
    """
    degrees = THRESHOLD[mesh.dimension] if threshold is None else threshold
    if not (0 <= degrees <= 90 and max_move >= 0):
        raise ValueError("the threshold must be from 0 to 90 degrees, and max_move not negative")
    team = Alone(mesh, threads) if team is None else team
    run = _Run(mesh, math.sin(math.radians(degrees)) ** 2, max_move, only_invalid, hopeless, threads, team)
    yield run.mesh, run.record
    phases = tuple(phases)
    to_the_ceiling = any(phase.until == "ceiling" for phase in phases)
    if run.record.inverted == 0 and (only_invalid or (not to_the_ceiling and run.meets(degrees))):
        return
    for phase in phases:
        untangling = not phase.smooths
        if untangling and run.is_done(phase):
            continue
        limit = SWEEPS if phase.max_sweeps is None else phase.max_sweeps
        if untangling and sweeps is not None:
            limit = sweeps if phase.max_sweeps is None else min(sweeps, phase.max_sweeps)
        if limit > 0 and phase.from_best and run.go_back(untangling):
            yield run.mesh, run.record
        waited, run.clock = 0, time.perf_counter()
        for points in islice(run.sweeps(phase), limit):
            waited = 0 if run.add(phase, points) else waited + 1
            yield run.mesh, run.record
            if sweeps is not None and untangling:
                sweeps -= 1
            if untangling and run.is_done(phase):
                break
            if len(phase.moves) == 1 and run.record.moved == 0:
                break
            stalls = phase.until == "stalled" or (run.some_are_hopeless and not phase.moves)
            if stalls and waited == PATIENCE * max(1, len(phase.moves)):
                break
            run.clock = time.perf_counter()
    lost = run.record.rank > run.first[1].rank or (to_the_ceiling and run.first[1].inverted == 0 and not run.gained())
    if lost and run.go_back(untangling=False):
        yield run.mesh, run.record


def _raised(sine2: float, degrees: float) -> float:
    """Return the sine^2 of an angle that is larger by some degrees."""
    return math.sin(min(math.asin(math.sqrt(sine2)) + math.radians(degrees), math.pi / 2)) ** 2


def _due(vertices: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """States for a sweep that visits these vertices (n,)."""
    return vertices.astype("u1") * kernels.DUE


class _Run:
    """The positions between two sweeps, and the best so far by what can be mended: simplices that have a free vertex.

    All arrays are in the order of `Topology.connectivity`; of what several processes hold, `team` finds one answer.
    """

    def __init__(
        self,
        mesh: Mesh,
        threshold_sine2: float,
        max_move: float,
        only_invalid: bool,
        hopeless: NDArray[np.bool_] | None,
        threads: int,
        team: Team,
    ) -> None:
        self.clock = time.perf_counter()
        self.input, self.threshold_sine2, self.threads, self.team = mesh, threshold_sine2, threads, team
        self.stars, self.max_move = mesh.topology.stars(threads), max_move
        self.points, self.free = mesh.along_curve(mesh.points), mesh.along_curve(mesh.movable)
        stuck = mesh.stuck(threads)
        fixed = self.stars.simplices[stuck]
        inverted = kernels.check(self.points, fixed, threads)[0]
        self.stuck = np.delete(fixed, inverted, axis=0)
        self.mendable, self.own = self.stars.simplices, team.own_simplices
        lost = int(self.own[stuck[inverted]].sum())
        self.hopeless = np.zeros(len(self.mendable), dtype=bool) if hopeless is None else hopeless
        if len(inverted):
            self.mendable = np.delete(self.mendable, stuck[inverted], axis=0)
            self.own = np.delete(self.own, stuck[inverted])
            self.hopeless = np.delete(self.hopeless, stuck[inverted])
        self.beyond_repair = team.total(lost), team.least(kernels.check(self.points, fixed[inverted], threads)[1])
        self.some_are_hopeless = team.total(int(self.hopeless.any())) > 0
        self.changed = np.zeros(len(self.points), dtype=bool)
        self._check()
        self.record = self._record("input", 0, 0)
        self.first = self.best = (self.points, self.record, self._rank())
        self.fewest, self.largest = self._rank()[0], self.measure
        self.only_invalid = only_invalid
        self.near = self.free & self._broken() if only_invalid else self.free
        # A valid mesh keeps its smallest measure; in others those of the inverted simplices were worse.
        self.min_measure = -math.inf if self.record.inverted else self.measure
        self.floor = self.min_measure

    @property
    def mesh(self) -> Mesh:
        """The mesh at these positions."""
        return self.input if self.points is self.first[0] else self.input.with_vertices(self.points)

    def sweeps(self, phase: Phase) -> Iterator[NDArray[np.float64]]:
        """Yield the points (k, d) after each sweep; the caller adds them before it asks for the next."""
        self.changed[:] = False
        if not phase.moves:
            return self._minimisations(phase)
        if self.only_invalid and phase.rings:
            rings = phase.rings[0]
            self.near = self.free if rings is None else self._grown(self.near | self._broken(), rings)
            self.fewest, self.largest = self.left, self.measure  # what a smaller region reached is no measure
        near = self._grown(self.near, NEAR) if self.only_invalid and phase.smooths else self.near
        return self._raisings(phase.moves[0], near) if phase.until == "ceiling" else self._relocations(phase, near)

    def add(self, phase: Phase, points: NDArray[np.float64]) -> bool:
        """Take the points (k, d) of a sweep; return whether there was progress.

        Progress is fewer inverted elements than ever in the run, or a smallest measure that is larger by `PROGRESS`.
        """
        self.changed = kernels.moved(self.points, points, self.threads).view(bool)
        if self.only_invalid and not phase.moves:
            self.near = self.near | self.changed
        self.points = points
        self._check()
        sweep = self.record.sweep + 1 if self.record.phase == phase.name else 1
        self.record = self._record(
            phase.name, sweep, self.team.total(int((self.changed & self.team.own_vertices).sum()))
        )
        self.best = min(self.best, (self.points, self.record, self._rank()), key=lambda one: one[2])
        progress = self.left < self.fewest or self.measure > self.largest + PROGRESS * abs(self.largest)
        self.fewest, self.largest = min(self.fewest, self.left), max(self.largest, self.measure)
        return progress

    def is_done(self, phase: Phase) -> bool:
        """Whether nothing is left for a phase of untangling: sweeps are cheap, the energy needs a promise."""
        return (self.left if phase.moves else self.promising) == 0

    def gained(self) -> bool:
        """Whether the mean or the smallest of the smallest angles is larger than in the input, by more than `GAIN`."""
        before, after = self._angles(self.first[0]), self._angles(self.points)
        # As integers, whose sum does not depend on the order.
        steps = [int((angles * ANGLE_STEPS).astype("i8")[self.own].sum()) for angles in (before, after)]
        mean = self.team.total(steps[1] - steps[0]) / ANGLE_STEPS / self.team.total(int(self.own.sum()))
        rise = self._least(after) - self._least(before)
        return max(mean, rise) > math.radians(GAIN)

    def meets(self, degrees: float) -> bool:
        """Whether no angle is below the threshold, but for those of simplices without a free vertex."""
        free = np.delete(self.stars.simplices, self.input.stuck(self.threads), axis=0)
        return self._least(kernels.angles(self.points, free, self.threads)[0]) >= math.radians(degrees)

    def go_back(self, untangling: bool) -> bool:
        """Return to the best positions; False: they are the last.

        When untangling is over and left as many inverted elements as there were, nothing was mended, and the best are
        those of the input: what is well in it was moved for nothing.
        """
        mended = self.best[2][0] < self.first[2][0]
        points, record, _ = self.best if untangling or mended else self.first
        if points is self.points:
            return False
        self.points = points
        self._check()
        self.record = replace(record, phase="best", moved=0, seconds=0.0)
        return True

    def _check(self) -> None:
        """Find the inverted simplices, as rows of `mendable`, how many there are, and the smallest measure.

        `promising` is how many of them are worth the energy.
        """
        self.inverted, smallest = kernels.check(self.points, self.mendable, self.threads)
        self.left = self.promising = self.team.total(int(self.own[self.inverted].sum()))
        if self.some_are_hopeless:
            own = self.own[self.inverted] & ~self.hopeless[self.inverted]
            self.promising = self.team.total(int(own.sum()))
        self.measure = self.team.least(smallest)

    def _rank(self) -> tuple[int, float]:
        return self.left, -self.measure

    def _record(self, phase: str, sweep: int, moved: int) -> SweepRecord:
        inverted, measure = self.left + self.beyond_repair[0], min(self.measure, self.beyond_repair[1])
        return SweepRecord(phase, sweep, inverted, measure, moved, time.perf_counter() - self.clock)

    def _broken(self) -> NDArray[np.bool_]:
        """(n,) bool: the vertices of inverted simplices that can be mended."""
        mask = self.changed & False
        mask[self.mendable[self.inverted]] = True
        return self.team.shared(mask)

    def _grown(self, vertices: NDArray[np.bool_], rings: int) -> NDArray[np.bool_]:
        """(n,) bool: free vertices among these and `rings` rings of neighbours around them."""
        return self.free & self.stars.grown(vertices, rings).view(bool)

    def _relocations(self, phase: Phase, near: NDArray[np.bool_]) -> Iterator[NDArray[np.float64]]:
        near = near & self.team.own_vertices
        threshold, states = self._threshold_sine2(phase), _due(near)
        self.floor = self.measure if Move.COME_BACK in phase.moves else self.min_measure
        for move in cycle(phase.moves):
            if len(phase.moves) > 1:  # what was visited by one move is due for the next
                states = _due(near)
            if phase.only_invalid and move is Move.UNTANGLE_HEIGHTS:
                states = _due(near & (self._broken() | self._grown(self.changed, 1)))
            yield self._relocated(move, states, threshold)

    def _raisings(self, move: Move, near: NDArray[np.bool_]) -> Iterator[NDArray[np.float64]]:
        ceiling = self._min_sine2(self.stuck)
        smallest, waited = self._min_sine2(self.mendable), 0
        while smallest < ceiling and waited < RAISE_PATIENCE:
            yield self._relocated(move, _due(near & self.team.own_vertices), _raised(smallest, RAISE))
            now = self._min_sine2(self.mendable)
            waited = 0 if now > _raised(smallest, RISE) else waited + 1
            smallest = max(smallest, now)

    def _relocated(self, move: Move, states: NDArray[np.uint8], threshold: float) -> NDArray[np.float64]:
        points = self.points.copy()
        for blocks in self.team.sweep(points, states):
            kernels.relocate(
                move, points, states, self.stars, blocks, threshold, self.floor, self.first[0], self.max_move,
                self.threads,
            )  # fmt: skip
        return points

    def _threshold_sine2(self, phase: Phase) -> float:
        """Return that of the user or, for the means, the floor below which nothing may fall, if that is higher."""
        floor = 0.0
        if Move.MEAN_RATIO in phase.moves:
            floor = self._min_sine2(self.mendable)
        elif Move.MEAN_ANGLE in phase.moves:
            floor = math.sin(self.team.ranked(self._angles(self.points)[self.own], FLOOR)) ** 2
        return max(self.threshold_sine2, floor)

    def _min_sine2(self, simplices: NDArray[np.int32]) -> float:
        return self.team.least(kernels.min_sine2(self.points, simplices, self.threads))

    def _angles(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the smallest angle of each simplex that can be mended, in radians."""
        return kernels.angles(points, self.mendable, self.threads)[0]

    def _least(self, angles: NDArray[np.float64]) -> float:
        return self.team.least(float(angles.min(initial=math.pi)))

    def _minimisations(self, phase: Phase) -> Iterator[NDArray[np.float64]]:
        compute = partial(_minimisations, phase.rings, self.max_move, self.threads)
        return self.team.of_whole(compute, self.points, self.first[0], self.free, self._broken())


def _minimisations(
    regions: tuple[int | None, ...],
    max_move: float,
    threads: int,
    stars: kernels.Connectivity,
    points: NDArray[np.float64],
    start: NDArray[np.float64],
    free: NDArray[np.bool_],
    broken: NDArray[np.bool_],
) -> Iterator[NDArray[np.float64]]:
    """Yield the points after each minimisation of the energy, in one region after the other; see `Phase.rings`."""
    from meshfix_cli.solve.foldover import Reach, minimisations

    for rings in regions:
        near = free if rings is None else free & stars.grown(broken, rings).view(bool)
        if rings is not None and 2 * near.sum() > free.sum():
            return  # as good as the whole mesh
        for moved in minimisations(points, stars, near, Reach(start, max_move), threads):
            points = moved
            yield points


def drain(run: Iterable[tuple[Mesh, SweepRecord]]) -> tuple[Mesh, Mesh, Mesh, tuple[SweepRecord, ...]]:
    """Take all steps; return the mesh as it came, untangled and smoothed, and the records."""
    run = iter(run)
    mesh, record = next(run)
    before = untangled = mesh
    records = [record]
    for mesh, record in run:
        if not record.phase.startswith(SMOOTHING):
            untangled = mesh
        records.append(record)
    return before, untangled, mesh, tuple(records)


def untangle(
    mesh: Mesh,
    strategy: str = "auto",
    *,
    sweeps: int | None = None,
    smooth: int | Literal["best"] = SMOOTH,
    threshold: float | None = None,
    max_move: float = math.inf,
    only_invalid: bool = False,
    threads: int = 1,
) -> Outcome:
    """Move interior vertices until no element is inverted, then improve the worst angles.

    Parameters
    ----------
    mesh : Mesh
    strategy : str
        A key of `STRATEGIES`.
    smooth : int or "best"
        Smoothing passes. "best": `SMOOTH` of them, `RATIO_SWEEPS` sweeps for the mean ratios, `ANGLE_SWEEPS` for the
        smallest angles of all simplices, and sweeps that raise the smallest of all until it is that of the simplices
        without a free vertex or rises no more.
    sweeps, threshold, max_move, only_invalid
        See `steps`.
    threads : int
        The result has the same bits for any number.

    Returns
    -------
    Outcome
        `Outcome.valid` tells whether the mesh could be untangled, `Outcome.obstacles` what makes that impossible.

    Raises
    ------
    ValueError
        There is no such strategy, or an argument is out of range.

    Notes
    -----
    Source: section 4 for LS, US, CS and LUS, `foldover.py` for FF. "auto" is Laplacian sweeps until they stall; from
    the best of those meshes cycles of LP sweeps on the stars that are still invalid; then FF, first in the smallest
    region that can be solved.
    """
    phases, obstacles = plan(strategy, smooth, only_invalid), find_obstacles(mesh, threads)
    run = steps(
        mesh, phases, sweeps=sweeps, threshold=threshold, max_move=max_move, only_invalid=only_invalid,
        hopeless=obstacles.hopeless(mesh), threads=threads,
    )  # fmt: skip
    return Outcome(*drain(run), obstacles)
