"""Positions of a mesh, how good they are, and the best so far."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.judged import Judged
from meshfix_cli.solve.records import SweepRecord
from meshfix_cli.solve.strategies import Move

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.solve.team import Team

GAIN = 0.01  # degrees: a valid mesh of which "best" makes no more than that is left alone, and it may lose no more
AREA_KEPT = 0.5  # of the smallest area of a surface: where all are as small, none could move else
ANGLE_STEPS = 2.0**32  # of a radian
Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Start = tuple[Array, SweepRecord, tuple[int, float]]


class Positions:
    """Positions, and the best of a run by what can be mended: simplices that have a free vertex.

    All arrays are in the order of `Topology.connectivity`; of what several processes hold, `team` finds one answer.
    """

    def __init__(
        self,
        mesh: Mesh,
        threshold_sine2: float,
        max_move: float,
        hopeless: Mask | None,
        threads: int,
        team: Team,
    ) -> None:
        self.clock = time.perf_counter()
        self.threshold = math.asin(math.sqrt(threshold_sine2))
        self.input, self.threshold_sine2, self.threads, self.team = mesh, threshold_sine2, threads, team
        self.stars, self.max_move = mesh.topology.stars(threads), max_move
        self.points, self.free = mesh.along_curve(mesh.points), mesh.along_curve(mesh.movable)
        self.inside, self.freedom = mesh.along_curve(mesh.anywhere), mesh.freedom
        self.surface = mesh.surface
        if mesh.surface is not None:
            self.inside = self.free
        self.together = self.free if mesh.freedom is None else self.free & ~mesh.freedom.curved
        stuck = mesh.stuck(threads)
        fixed = mesh.judged(stuck)
        inverted = fixed.check(self.points, threads)[0]
        self.stuck = fixed.without(inverted)
        self.mendable, self.own = mesh.judged(), team.own_elements
        lost = int(self.own[stuck[inverted]].sum())
        self.hopeless = np.zeros(len(self.mendable), dtype=bool) if hopeless is None else hopeless
        if len(inverted):
            self.mendable = self.mendable.without(stuck[inverted])
            self.own = np.delete(self.own, stuck[inverted])
            self.hopeless = np.delete(self.hopeless, stuck[inverted])
        smallest = mesh.judged(stuck[inverted]).check(self.points, threads)[1]
        self.beyond_repair = team.total(lost), team.least(smallest)
        self.some_are_hopeless = team.total(int(self.hopeless.any())) > 0
        self.changed = np.zeros(len(self.points), dtype=bool)
        self._check()
        self.record = self._record("input", 0, 0)
        self.first = (self.points, self.record, self._rank())
        self.best: Start | None = self.first
        self.count = self.team.total(int(self.own.sum()))  # of what can be mended, in all processes
        # A valid mesh keeps its smallest measure; in others those of the inverted elements were worse.
        kept = self.measure if mesh.surface is None else AREA_KEPT * self.measure
        self.min_measure = -math.inf if self.record.inverted else kept
        self.floor = self.min_measure

    @property
    def mesh(self) -> Mesh:
        """The mesh at these positions."""
        return self.input if self.points is self.first[0] else self.input.with_vertices(self.points)

    def gained(self) -> bool:
        """Whether the mean or the smallest of the smallest angles is larger than in the input, by more than `GAIN`."""
        before, after = self._angles(self.first[0]), self._angles(self.points)
        mean = self.team.total(self._steps(after) - self._steps(before)) / ANGLE_STEPS / self.count
        rise = self._least(after) - self._least(before)
        return max(mean, rise) > math.radians(GAIN)

    def meets(self, degrees: float) -> bool:
        """Whether no angle is below the threshold, but for those of simplices without a free vertex."""
        free = self.input.judged().without(self.input.stuck(self.threads)).angles(self.points, self.threads)
        return self._least(free) >= math.radians(degrees)

    def had_fewer(self) -> bool:
        """Whether fewer elements were inverted at some positions before."""
        return self.best is not None and self.best[2][0] < self.left

    def go_back(self, untangling: bool) -> bool:
        """Return to the best positions; False: they are the last.

        When untangling is over and left as many inverted elements as there were, nothing was mended, and the best are
        those of the input: what is well in it was moved for nothing.
        """
        assert self.best is not None
        mended = self.best[2][0] < self.first[2][0]
        points, record, _ = self.best if untangling or mended else self.first
        return self._return_to(points, record)

    def _return_to(self, points: Array, record: SweepRecord) -> bool:
        if goes := self._go_to(points):
            self.record = replace(record, phase="best", moved=0, seconds=0.0)
        return goes

    def _go_to(self, points: Array) -> bool:
        if points is self.points:
            return False
        self.points = points
        self._check()
        self.record = replace(self._record("best", self.record.sweep, 0), seconds=0.0)
        return True

    def _check(self) -> None:
        """Find the inverted elements, as positions in `mendable`, how many there are, and the smallest measure.

        `promising` is how many of them are worth the energy.
        """
        self.inverted, smallest = self.mendable.check(self.points, self.threads)
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

    def _count(self, vertices: Mask) -> int:
        return self.team.total(int((vertices & self.team.own_vertices).sum()))

    def _broken(self) -> Mask:
        """(n,) bool: the vertices of inverted elements that can be mended."""
        return self._of(self.inverted)

    def _of(self, elements: NDArray[np.integer] | Mask) -> Mask:
        """(n,) bool: the vertices of some elements that can be mended."""
        mask = np.zeros(len(self.points), dtype=bool)
        mask[self.mendable.vertices(elements)] = True
        return self.team.shared(mask)

    def _grown(self, vertices: Mask, rings: int) -> Mask:
        """(n,) bool: free vertices among these and `rings` rings of neighbours around them."""
        return self.free & self.team.grown(vertices, rings)

    def _relocated(
        self,
        points: Array,
        move: Move,
        states: NDArray[np.uint8],
        threshold_sine2: float | None = None,
        ahead: Array | None = None,
    ) -> Array:
        """Return the points (k, d) after a sweep, which keeps account in `states`; the threshold is the user's.

        On a surface vertices may be given places ahead (k, 3) to which they go as far as that is good.
        """
        threshold_sine2 = self.threshold_sine2 if threshold_sine2 is None else threshold_sine2
        points = points.copy()
        freedom = None if self.freedom is None else self.freedom.kernel
        for blocks in self.team.sweep(points, states):
            given = (
                move, points, states, self.stars, blocks, threshold_sine2, self.floor, self.first[0], self.max_move,
                self.threads,
            )  # fmt: skip
            if self.surface is None:
                kernels.relocate(*given, freedom)
            else:
                assert freedom is not None
                kernels.relocate_on_surface(*given, freedom, self.surface.normals, ahead)
        return points

    def _min_sine2(self, elements: Judged) -> float:
        return self.team.least(elements.min_sine2(self.points, self.threads))

    def _angles(self, points: Array) -> Array:
        """Return the quality of each element that can be mended, an angle in radians."""
        return self.mendable.angles(points, self.threads)

    def _steps(self, angles: Array) -> int:
        """Return the sum of the own elements' angles as an integer, which does not depend on the order."""
        return int((angles * ANGLE_STEPS).astype("i8")[self.own].sum())

    def _least(self, angles: Array) -> float:
        return self.team.least(float(angles.min(initial=math.pi)))

    def _of_whole(self, compute: Callable[..., Iterator[Array]], *values: NDArray[Any]) -> Iterator[Array]:
        """Yield what `Team.of_whole` does, with those that slide where they may be: rounding leads off a plane."""
        for points in self.team.of_whole(compute, *values):
            yield points if self.freedom is None else self.freedom.onto(points, self.first[0])
