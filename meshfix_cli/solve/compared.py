"""Candidates for the last mesh of "best", where elements are not all simplices: none is worse than the default's.

What one figure gains another may lose: the mean, the smallest, the value at a hexahedron's centre, which nothing else
minds. So all figures of a report are compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.quality.formulas import evaluate

if TYPE_CHECKING:
    from meshfix_cli.mesh.judged import Judged
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.solve.team import Team

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Figures = tuple[float, ...]
STEPS = 2.0**32  # of 1: sums of integers do not depend on their order
HALVINGS = 8  # of the way of what is worse; then it goes all the way back
RETREATS = 20
SHAPE_KEPT = 0.3  # of the smallest shape of the default: scaled Jacobians do not mind edges that shrink to nothing
KEPT = 0.9  # of the first percentile of the default: what others gain may cost it so much
STALL = 0.01  # of the score: candidates that gain no more in their last turns are the last of their kind
MEAN = 5.0  # what the mean counts, and the smallest 1: it is that of all elements, and seldom gains much
SAME = 1e-9  # by which a smallest value may be smaller


class Compared:
    """The best one of some valid meshes, of which no figure is below the first one's, but for `KEPT`.

    Attributes
    ----------
    best : (n, d) float64
        Its points.
    rises : list of float
        By how much each was better than the best before.
    """

    def __init__(self, mesh: Mesh, elements: Judged, own: Mask, team: Team, threads: int) -> None:
        self._mesh, self._elements, self._own, self._team, self._threads = mesh, elements, own, team, threads
        self.best = np.empty(0)
        self.rises: list[float] = []
        self._last = self._values = np.empty(0)
        self._least: Figures = (-math.inf,) * 6
        self._score = -math.inf

    def add(self, points: Array, vertices_of: Callable[[Mask], Mask]) -> Array:
        """Compare one more; return its points with what is too low drawn back to the last.

        Parameters
        ----------
        points : (n, d) float64
        vertices_of : callable
            Gives the vertices (n,) bool of elements, a mask, also where other processes hold these.
        """
        values, figures = self._judged(points)
        if not self._will_do(figures):
            points = self._drawn_back(points, figures, vertices_of)
            values, figures = self._judged(points)
        if not self._will_do(figures):
            self.rises.append(0.0)
            return self._last
        if not self.rises:
            self._least = (*figures[:4], KEPT * figures[4], SHAPE_KEPT * figures[5])
        self._last, self._values = points, values
        score = figures[0] + MEAN * figures[2]
        self.rises.append(score - self._score)
        if score > self._score:
            self.best, self._score = points, score
            self._least = (*map(max, figures[:2], self._least[:2]), *self._least[2:])
        return points

    def take_best(self) -> Array:
        """Return the best one's points, as if it were the last."""
        if self._last is not self.best:
            self._last, self._values = self.best, self._jacobians(self.best)
        return self.best

    def is_better(self, points: Array, others: Array) -> bool:
        """Whether neither the smallest nor the mean of the scaled Jacobians is below that of the others (n, d)."""
        (smallest, _, mean, *_), (its_smallest, _, its_mean, *_) = (self._judged(one)[1] for one in (points, others))
        return smallest >= its_smallest and mean >= its_mean

    def stalls(self, turns: int) -> bool:
        """Whether the last turns, of two each, gained little."""
        return sum(max(rise, 0.0) for rise in self.rises[-2 * turns :]) < STALL

    def _will_do(self, figures: Figures) -> bool:
        return all(one >= least - SAME for one, least in zip(figures, self._least, strict=True))

    def _drawn_back(self, points: Array, figures: Figures, vertices_of: Callable[[Mask], Mask]) -> Array:
        """Return the points with those of elements that are too low on the way back to the last."""
        way, share = points - self._last, np.ones((len(points), 1))
        least = np.full(len(self._values), self._least[0])
        if figures[4] < self._least[4]:  # nothing joins the lowest hundredth, or sinks within it
            least = np.maximum(least, np.minimum(self._values, self._least[4]))
        for _ in range(RETREATS):
            verdicts, _, qualities = self._elements.judge(points, self._threads)
            worse = (verdicts != 0) | (kernels.sin(qualities) < self._least[1] - SAME)
            worse |= self._jacobians(points) < least - SAME
            worse |= self._of_metric("shape", points) < self._least[5] - SAME
            if not self._team.total(int(worse[self._own].sum())):
                return points
            share[vertices_of(worse)] *= 0.5
            share[share < 0.5**HALVINGS] = 0.0
            points = np.where(share < 1, self._last + share * way, points)
            points = self._on_shapes(points, (share > 0) & (share < 1))
        return self._last

    def _on_shapes(self, points: Array, moved: Mask) -> Array:
        """Return points with those moved (n, 1) that slide on surfaces and curves there: the way back is a chord."""
        freedom = self._mesh.freedom
        if freedom is None or freedom.shapes is None:
            return points
        return np.where(moved & freedom.curved[:, None], freedom.rounded(points, self._threads)[0], points)

    def _judged(self, points: Array) -> tuple[Array, Figures]:
        """Return the scaled Jacobians of the elements (m,), and the figures."""
        jacobians = self._jacobians(points)
        corners = kernels.sin(self._elements.angles(points, self._threads))
        return jacobians, self._figures_of(jacobians, corners, self._of_metric("shape", points))

    def _jacobians(self, points: Array) -> Array:
        return self._of_metric("scaled_jacobian", points)

    def _of_metric(self, name: str, points: Array) -> Array:
        """Return the values of a metric (m,)."""
        rows = self._mesh.topology.connectivity.rows
        values: Array = evaluate(name, self._mesh.with_vertices(points))[rows][self._elements.rows]
        return values

    def _figures_of(self, jacobians: Array, corners: Array, shapes: Array) -> Figures:
        """Return the smallest with and without centres, the means of both, the 1st percentile, and the worst shape."""
        own, corners = jacobians[self._own], corners[self._own]
        count = max(1, self._team.total(len(own)))
        means = [self._team.total(int((one * STEPS).astype("i8").sum())) / STEPS / count for one in (own, corners)]
        least = [self._team.least(float(one.min(initial=1.0))) for one in (own, corners)]
        return (*least, *means, self._team.ranked(own, 1), self._team.least(float(shapes[self._own].min(initial=1.0))))
