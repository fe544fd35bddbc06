"""What the phases of a run do to the positions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.solve.passes import Passes
from meshfix_cli.solve.positions import ANGLE_STEPS, GAIN, Positions, Start
from meshfix_cli.solve.records import SweepRecord
from meshfix_cli.solve.shape import (
    FEW_ITERATIONS,
    FEW_WEIGHT,
    ITERATIONS,
    SHARP,
    SHARP_WEIGHT,
    SHARPEST,
    Goal,
    shaped,
)
from meshfix_cli.solve.strategies import PASSES, Move, Phase

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.solve.compared import Compared
    from meshfix_cli.solve.team import Team

FLOOR, LIFT = 1, 3.0  # percentile of the smallest angles; up to so many degrees above it they are the few worse ones
RAISE = 3.0  # degrees above the smallest angle at which the next sweep of "best" optimises
RAISE_PATIENCE = 2
FEW_LIFT, FEW_RINGS = 1.0, 2  # degrees above the smallest, and rings around what is below that, that rise together
ROUNDING = 1e-9  # of a threshold: elements and stars are measured in different units
PROGRESS = 1e-3  # by which the smallest measure must rise to count as progress, relative
NEAR = 1  # rings around the vertices of inverted elements, and around what FF moved, that `only_invalid` smooths
EASY = 3  # sweeps: a tangle that took more, and of which at least `MANY` of the elements were inverted, was a hard one
MANY = 0.25
MOST = 0.5  # of the elements: where they were inverted, another start is tried in any case
GOAL = {2: 1.3, 3: 1.6}  # times the threshold: up to there, where three passes of smoothing do not suffice
GOAL_RINGS = 4  # around the elements below the goal that are smoothed
GOAL_RISE = 0.1  # degrees by which the smallest angle must rise, in `GOAL_PATIENCE` turns through the moves, to go on
GOAL_PATIENCE = 2
ON_INVALID_STARS = (Move.UNTANGLE_HEIGHTS, Move.UNTANGLE_COEFFICIENTS, Move.UNTANGLE_MOST)
WILL_DO_RISE = 0.2  # degrees in one turn, of a surface that has no angle below the threshold: vertices creep along it
Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
LET_DOWN = 0.8  # of the smallest angle of a surface, to which the first of these may take it
AHEAD = 1.5  # times the way of the last turn through the moves: so far vertices of a surface try to go on
SURFACE_SWEEPS = 20  # for the mean ratios, where a plane or solid mesh has one energy of all elements
CORNER_KEPT = 0.3  # of the smallest that untangling left: scaled Jacobians do not mind edges that shrink to nothing
SAME = 0.1  # degrees: of two starts with the same smallest angle, the one of the larger mean is better


@dataclass(frozen=True)
class Pace:
    """What smoothing must gain to go on.

    Attributes
    ----------
    rise : float
        Degrees by which the smallest angle must rise in `RAISE_PATIENCE` sweeps of "best".
    round_rise : float
        Degrees by which it must rise for another round of these.
    left : float
        Share of the elements below the goal that may still be there after `GOAL_PATIENCE` turns through the moves.
    iterations : int
        Of the energy in another round, at most.
    """

    rise: float
    round_rise: float
    left: float
    iterations: int


# Where the boundary slides there is seldom a ceiling: the smallest angle creeps on, and takes the mean with it.
PACE, SLIDING_PACE = Pace(0.01, 0.05, 1.0, ITERATIONS), Pace(0.03, 0.5, 0.9, 40)


def _is_of_surfaces(phase: Phase) -> bool:
    """Whether a phase works in tangent planes: sweeps, and the shape of elements by their means."""
    if {Move.COME_BACK, Move.UNTANGLE_MOST} & set(phase.moves) or phase.to_reference:
        return False
    if phase.slides and Move.DRAW_BACK not in phase.moves:  # as all do
        return False
    return bool(phase.moves) or phase.shapes in ("first", "lost", "risen")


def _raised(sine2: float, degrees: float) -> float:
    """Return the sine^2 of an angle that is larger by some degrees."""
    return math.sin(min(math.asin(math.sqrt(sine2)) + math.radians(degrees), math.pi / 2)) ** 2


def _due(vertices: Mask) -> NDArray[np.uint8]:
    """States for a sweep that visits these vertices (n,)."""
    return vertices.astype("u1") * kernels.DUE


class Run(Positions):
    """The positions between two sweeps, and what the phases before have left for those to come."""

    def __init__(
        self,
        mesh: Mesh,
        threshold_sine2: float,
        max_move: float,
        only_invalid: bool,
        hopeless: Mask | None,
        threads: int,
        team: Team,
        reference: Array | None = None,
    ) -> None:
        super().__init__(mesh, threshold_sine2, max_move, hopeless, threads, team)
        self.fewest, self.largest = self._rank()[0], self.measure
        self.compared: Compared | None = None
        self.only_invalid = only_invalid
        self.broken = self._broken()
        self.near = self.free & self.broken if only_invalid else self.free
        self.reference, self.targeted = reference, reference is not None
        self.rival: Start | None = None
        self.ahead: Passes | None = None
        self.kept: tuple[Array, SweepRecord, float] | None = None
        self.over: frozenset[str] = frozenset()  # the kinds of turns that have stalled
        self.lost = False  # what the last minimisation of the shape began with
        self.shaped = False  # since the smallest angle was raised
        self.uneven = False  # for no reason, maybe: it was hard to untangle or to smooth
        self.hard = False  # the last Laplacian sweeps were many, or left what the energy could mend
        self.untangling = 0  # sweeps
        share = self.left / max(1, self.count)
        self.pace = SLIDING_PACE if self.freedom is not None and self.mendable.simplicial else PACE
        self.many, self.most = share >= MANY, share >= MOST

    def enter(self, phase: Phase) -> bool:
        """Prepare a phase; False: it has nothing to do, or its region is as good as the whole."""
        if self.surface is not None and not _is_of_surfaces(phase):
            return False
        simplicial = self.mendable.simplicial or self.surface is not None
        if phase.elements is simplicial or (phase.layers and not simplicial):
            return False
        if phase.slides and (self.freedom is None or (phase.slides == "curved" and self.freedom.shapes is None)):
            return False
        if Move.DRAW_BACK in phase.moves:
            tangled = self.surface is None or self.first[1].inverted > 0
            return self.left == 0 and tangled
        if phase.smooths:
            self._hold_corners()
            if self.targeted != bool(phase.to_reference) or (phase.to_reference and self.left):
                return False
            return self._goes_on(phase)
        if Move.LAPLACIAN in phase.moves:
            self.hard = False
        if not self._asks_for_another_start() if phase.embeds else self.is_done(phase):
            return False
        if self.only_invalid or not (phase.moves or phase.embeds):
            return True
        near = self._grown(self.broken, phase.rings[0] or 0) if phase.rings else self.free
        if phase.rings and 2 * self._count(near) > self._count(self.free):
            return False
        self.near = near & self.inside if phase.slides is False else near
        return True

    def _hold_corners(self) -> None:
        """Let smoothing make no corner much smaller than the smallest that untangling left."""
        by_jacobians = self.surface is None and not self.mendable.simplicial
        if by_jacobians and self.left == 0 and self.min_measure == -math.inf:
            self.min_measure = CORNER_KEPT * self.measure

    def _asks_for_another_start(self) -> bool:
        """Whether Laplacian sweeps did not do, and the little that they left was not soon mended either."""
        return self.hard and (self.many or self.left > 0)

    def sweeps(self, phase: Phase) -> Iterator[Array]:
        """Yield the points (k, d) after each sweep; the caller adds them before it asks for the next."""
        self.changed[:] = False
        if phase.to_reference:
            return self._towards_reference(phase)
        if phase.embeds:
            return self._another_start()
        if phase.shapes == "even":
            return self._even()
        if phase.shapes:
            return self._shape(phase)
        if not phase.moves:
            return self._minimisations(phase)
        if self.only_invalid and phase.rings and not phase.smooths:
            rings = phase.rings[0]
            self.near = self.free if rings is None else self._grown(self.near | self._broken(), rings)
            self.fewest, self.largest = self.left, self.measure  # what a smaller region reached is no measure
        near = self._smoothed(phase) if phase.smooths else self.near
        if phase.until in ("threshold", "goal"):
            return self._mendings(phase, near)
        return self._raisings(phase.moves[0], near) if phase.until == "ceiling" else self._relocations(phase, near)

    def _smoothed(self, phase: Phase) -> Mask:
        """(n,) bool: the vertices that a phase of smoothing may move."""
        if self.only_invalid:
            return self._grown(self.near, NEAR)
        if not phase.rings or self.near is self.free or phase.until in ("threshold", "goal"):
            return self.free
        return self._grown(self.near | self._of(self._angles(self.points) < self.threshold), 0)

    def add(self, phase: Phase, points: Array) -> bool:
        """Take the points (k, d) of a sweep; return whether there was progress.

        Progress is fewer inverted elements than ever in the run, or a smallest measure that is larger by `PROGRESS`.
        """
        self.changed = kernels.moved(self.points, points, self.threads).view(bool)
        if self.only_invalid and not (phase.moves or phase.smooths):
            self.near = self.near | self.changed
        moved = self._count(self.changed)
        self.points = points if moved else self.points  # the array itself tells whether a mesh is another one
        self._check()
        sweep = self.record.sweep + 1 if self.record.phase == phase.name else 1
        self.record = self._record(phase.name, sweep, moved)
        self.untangling += not phase.smooths
        self.targeted = self.targeted or (phase.layers and self.left == 0)
        if Move.LAPLACIAN in phase.moves:
            self.hard = self.promising > 0 or self.most or (self.many and sweep > EASY)
        now = (self.points, self.record, self._rank())
        if self.best is None or now[2] < self.best[2] or self._is_meant(phase, self.best[2][0]):
            self.best = now
        progress = self.left < self.fewest or self.measure > self.largest + PROGRESS * abs(self.largest)
        self.fewest, self.largest = min(self.fewest, self.left), max(self.largest, self.measure)
        return progress

    def _is_meant(self, phase: Phase, fewest: int) -> bool:
        """Whether a mesh that is no better by its smallest measure is what the phase is for.

        As flat as a plane wrong elements can share a place, each with a measure of no more than rounding: of these most
        are right and some clearly wrong where fewer are meant to be.
        """
        return Move.DRAW_BACK in phase.moves or (Move.UNTANGLE_MOST in phase.moves and self.left <= fewest)

    def choose(self) -> bool:
        """Go on with the better one of two starts: by what is inverted, else after a few passes; False: it is this."""
        if self.rival is None or self.best is None:
            return False
        one, other, self.rival = self.rival, self.best, None
        self.best = min(one, other, key=lambda start: start[2])
        if one[2][0] == other[2][0] == 0:
            self.floor = self.min_measure
            (smallest, mean, ahead), (its_smallest, its_mean, its_ahead) = map(self._passes_from, (one[0], other[0]))
            same = abs(smallest - its_smallest) < math.radians(SAME)
            first = mean >= its_mean if same else smallest > its_smallest
            self.best, self.ahead = (one, ahead) if first else (other, its_ahead)
        return self._return_to(*self.best[:2])

    def _passes_from(self, start: Array) -> tuple[float, int, Passes]:
        """Return the smallest of the smallest angles after a few passes, in radians, their sum, in steps, and these."""
        near = self.near & self.team.own_vertices
        states, points = _due(near), [start]
        for _ in range(PASSES):
            points.append(self._relocated(points[-1], Move.COMBINED_SMOOTH, states))
        angles = self._angles(points[-1])
        return self._least(angles), self.team.total(self._steps(angles)), Passes(near, points, states)

    def is_done(self, phase: Phase) -> bool:
        """Whether nothing is left for a phase of untangling: sweeps are cheap, the energy needs a promise."""
        return (self.left if phase.moves else self.promising) == 0

    def _relocations(self, phase: Phase, near: Mask) -> Iterator[Array]:
        near = near & self.team.own_vertices
        states = _due(near)
        self.floor = self.measure if Move.COME_BACK in phase.moves else self.min_measure
        ahead, self.ahead = self.ahead, None
        if ahead is not None and ahead.begin(self.points, near, phase):
            yield from ahead.points[1:]
            states = ahead.states
        for move in cycle(phase.moves):
            if len(phase.moves) > 1:  # what was visited by one move is due for the next
                states = _due(near)
            if phase.only_invalid and move in ON_INVALID_STARS:
                states = _due(near & (self._broken() | self._grown(self.changed, 1)))
            floor = self._min_sine2(self.mendable) if move is Move.MEAN_RATIO else None
            yield self._relocated(self.points, move, states, floor)

    def _another_start(self) -> Iterator[Array]:
        """Yield the points with those near by in the graph's embedding, as far as they may go."""
        self.rival, self.best, self.uneven = self.best, None, True
        self.fewest, self.largest = self.count, -math.inf

        def compute(stars: kernels.Connectivity, points: Array, start: Array, near: Mask) -> Iterator[Array]:
            from meshfix_cli.solve.foldover import Reach, embedding

            embedded = embedding(points, stars, near, self.threads, self.team.freedom)
            yield Reach(start, self.max_move).drawn_in(embedded)

        yield from self._of_whole(compute, self.points, self.first[0], self.near & self.together)

    def _shape(self, phase: Phase) -> Iterator[Array]:
        """Yield the points where the shape of all elements is best."""
        if self.max_move < math.inf or self.left:
            return
        if self.surface is not None:
            yield from self._shape_of_surface(phase)
            return
        angles = self._angles(self.points)
        smallest, near = self._least(angles), self._smoothed(phase)
        if phase.shapes == "few":
            near = near & self._grown(self._of(angles < smallest + math.radians(FEW_LIFT)), FEW_RINGS)
        if not self._count(near & self.together):
            return
        self.kept = self.points, self.record, smallest
        most = self.pace.iterations if phase.shapes == "risen" else ITERATIONS
        most = FEW_ITERATIONS if phase.elements and phase.shapes == "first" else most
        aims = self._aims(phase.shapes, angles)

        def compute(stars: kernels.Connectivity, points: Array, free: Mask) -> Iterator[Array]:
            yield shaped(points, stars, free, aims, self.threads, most, self.team.freedom)

        yield from self._of_whole(compute, self.points, near & self.together)

    def _aims(self, shapes: str | None, angles: Array) -> Goal:
        smallest, measure = math.degrees(self._least(angles)), max(self.min_measure, 0.0)
        if shapes == "few":
            target = smallest + FEW_LIFT
            return Goal(target, target, measure, SHARP[-1:], FEW_WEIGHT)
        if shapes == "mean":
            return Goal(0.0, smallest, measure, SHARPEST, SHARP_WEIGHT)
        goal = math.degrees(self.team.ranked(angles[self.own], FLOOR)) + LIFT
        if shapes == "sharp":
            return Goal(goal, smallest, measure, SHARP, SHARP_WEIGHT)
        return Goal(goal, smallest if shapes == "lost" else 0.0, measure)

    def _shape_of_surface(self, phase: Phase) -> Iterator[Array]:
        """Yield the points where sweeps for the mean ratios end."""
        smallest = self._least(self._angles(self.points))
        self.kept = self.points, self.record, smallest
        near, points = self._smoothed(phase) & self.team.own_vertices, self.points
        held = smallest if phase.shapes != "first" else LET_DOWN * smallest  # what is jointly stuck there comes free
        states, floor = _due(near), math.sin(min(held, math.pi / 2)) ** 2
        for _ in range(SURFACE_SWEEPS):
            points = self._relocated(points, Move.MEAN_RATIO, states, floor)
        yield points

    def _even(self) -> Iterator[Array]:
        """Yield the points with even sizes and then the best shape, if smallest and mean are larger."""
        if self.max_move < math.inf or self.left or not self.uneven:
            return
        from meshfix_cli.solve import even

        angles = self._angles(self.points)
        total, smallest = self.team.total(self._steps(kernels.sin(angles))), math.sin(self._least(angles))
        mean = total / ANGLE_STEPS / self.count
        aims = Goal(math.degrees(self.team.ranked(angles[self.own], FLOOR)) + LIFT, 0.0, max(self.min_measure, 0.0))
        compute = partial(even.evened_where_poor, smallest, mean, aims, self.threads, self.team.freedom)
        for points in self._of_whole(compute, self.points, self.together):
            there = self._angles(points)
            now = math.sin(self._least(there)), self.team.total(self._steps(kernels.sin(there)))
            if now[0] > smallest and now[1] > total and self._comparer().is_better(points, self.points):
                smallest, total = now
                yield points

    def compare(self) -> bool:
        """Take the mesh for a candidate for the last one; whether something in it was drawn back."""
        if self.left or self.mendable.simplicial:
            return False
        self.compared = self.compared or self._comparer()
        return self._go_to(self.compared.add(self.points, self._of))

    def _comparer(self) -> Compared:
        from meshfix_cli.solve.compared import Compared  # the formulas of metrics, which others do not need

        return Compared(self.input, self.mendable, self.own, self.team, self.threads)

    def take_compared(self) -> bool:
        """Go to the best candidate; False: it is the last mesh, or there is none."""
        return self.compared is not None and self._go_to(self.compared.take_best())

    def _goes_on(self, phase: Phase) -> bool:
        """Whether a phase of smoothing has something to do after those before."""
        if phase.until == "ceiling":
            goes_on, self.shaped = self.shaped, False
            return goes_on
        if phase.shapes == "lost" and not self.lost:
            return False
        if phase.shapes == "risen" and not self._has_risen():
            return False
        if phase.compares and self.compared is not None and self._is_over(phase, self.compared):
            return False
        self.shaped = self.shaped or phase.shapes is not None
        return True

    def _is_over(self, phase: Phase, compared: Compared) -> bool:
        """Whether turns of its kind are over; sweeps for the mean ratios are part of the sharp ones."""
        kind = phase.shapes or "sharp"
        if phase.patience and compared.stalls(phase.patience):
            self.over = self.over | {kind}
        return kind in self.over

    def _has_risen(self) -> bool:
        """Whether the smallest angle has risen since the last minimisation of the shape, but not to the ceiling."""
        if self.kept is None:
            return False
        smallest = self._least(self._angles(self.points))
        below = math.sin(min(smallest, math.pi / 2)) ** 2 < self._min_sine2(self.stuck)
        return below and smallest > self.kept[2] + math.radians(self.pace.round_rise)

    def take_back(self) -> bool:
        """Return to where the last minimisation of the shape began, if the smallest angle is smaller than there."""
        if self.kept is None:
            return False
        points, record, smallest = self.kept
        self.lost = self._least(self._angles(self.points)) < smallest - math.radians(GAIN)
        return self.lost and self._return_to(points, record)

    def _mendings(self, phase: Phase, near: Mask) -> Iterator[Array]:
        """Yield sweeps around what is below the goal, turn by turn, as long as that becomes less or better."""
        self.floor = self.min_measure
        dimension = self.points.shape[1] - (self.surface is not None)
        goal = min(GOAL[dimension] * self.threshold, math.pi / 2)
        fewest, largest, waited = self.count, -math.inf, 0
        angles = self._angles(self.points)
        well = self._least(angles) >= self.threshold and not (self.many and self.untangling > EASY)
        if well and phase.until == "threshold":
            return
        self.uneven = True
        while True:
            below, smallest = self.team.total(int((angles < goal)[self.own].sum())), self._least(angles)
            will_do = self.surface is not None and phase.until == "threshold" and smallest >= self.threshold
            rise, patience = (WILL_DO_RISE, 1) if will_do else (GOAL_RISE, GOAL_PATIENCE)
            rises = below < self.pace.left * fewest or smallest > largest + math.radians(rise)
            fewest, largest, waited = min(fewest, below), max(largest, smallest), 0 if rises else waited + 1
            if below == 0 or waited >= patience:
                return
            due = near & self._grown(self._of(angles < goal), GOAL_RINGS) & self.team.own_vertices
            states, last, start = _due(due), phase.moves[0], self.points
            for move in phase.moves:
                states, last = states if move is last else _due(due), move
                floor = self._min_sine2(self.mendable) if move is Move.MEAN_RATIO else math.sin(goal) ** 2
                yield self._relocated(self.points, move, states, floor)
            if self.surface is not None:  # vertices creep along it: as far again as they have come, and farther
                ahead = self.points + AHEAD * (self.points - start)
                yield self._relocated(self.points, phase.moves[0], _due(due), math.sin(goal) ** 2, ahead)
            angles = self._angles(self.points)

    def _raisings(self, move: Move, near: Mask) -> Iterator[Array]:
        ceiling = self._min_sine2(self.stuck)
        smallest, waited = self._min_sine2(self.mendable), 0
        held = 0.0 if self.kept is None else math.sin(min(self.kept[2], math.pi / 2)) ** 2
        while smallest < ceiling and waited < RAISE_PATIENCE:
            threshold = _raised(smallest, RAISE)
            yield self._relocated(self.points, move, self._due_below(threshold, near), threshold)
            now = self._min_sine2(self.mendable)
            pace = self.pace if now > held else PACE
            waited = 0 if now > _raised(smallest, pace.rise) else waited + 1
            smallest = max(smallest, now)

    def _due_below(self, sine2: float, near: Mask) -> NDArray[np.uint8]:
        """States for a sweep that visits those `near` at elements below a threshold, and others as they come there."""
        states = (near & self.team.own_vertices).astype("u1") * kernels.DONE
        low = self._of(self.mendable.below(self.points, sine2 * (1 + ROUNDING), self.threads))
        states[low & (states > 0)] = kernels.DUE
        return states

    def _towards_reference(self, phase: Phase) -> Iterator[Array]:
        from meshfix_cli.solve import layers, towards

        compute = partial(getattr(layers if phase.layers else towards, phase.to_reference), self.max_move, self.threads)
        reference = () if self.reference is None or phase.layers else (self.reference,)
        if phase.layers or phase.to_reference == "follow":
            return self._of_whole(compute, self._slid_back(), self.first[0], *reference, self.inside)
        compute = partial(compute, freedom=self.team.freedom)
        return self._of_whole(compute, self.points, self.first[0], *reference, self.together)

    def _slid_back(self) -> Array:
        """Return the points with those on surfaces and curves where they are in the reference, if that is in reach."""
        if self.reference is None or self.freedom is None or self.freedom.stays:
            return self.points
        near = np.linalg.norm(self.reference - self.first[0], axis=1) <= self.max_move
        return np.where((self.free & self.freedom.curved & near)[:, None], self.reference, self.points)

    def _minimisations(self, phase: Phase) -> Iterator[Array]:
        given = phase.rings, self.max_move, self.threads, self.team.freedom
        if phase.slides == "curved":
            from meshfix_cli.solve import on_surfaces

            compute, free = partial(on_surfaces.minimisations, *given), self.free
        else:
            from meshfix_cli.solve.foldover import minimisations_in_regions

            compute, free = partial(minimisations_in_regions, *given), self.together
        return self._of_whole(compute, self.points, self.first[0], free, self._broken())
