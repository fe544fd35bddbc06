"""The foldover-free energy where vertices slide on curved surfaces and along curves.

The energy knows planes and lines. So for each short minimisation such vertices have the tangent planes and lines of
where they are, in which they and all others go no farther than a small ball; after it they are put on their surfaces
again, and the next one has other planes. Without an end to these steps the energy falls in planes that have little to
do with the surface any more, and where the whole mesh moves, some places get worse while others get better: so each
cluster of inverted elements is a region of its own, which takes the best that it has seen.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.judged import Judged
from meshfix_cli.solve.foldover import QUICK, WEIGHT, FoldoverRegion, Reach, around, next_eps

if TYPE_CHECKING:
    from meshfix_cli.mesh.freedom import Freedom

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEP = 0.5  # of the size of the elements of a region: the radius of the balls
ROUNDS = 40  # of minimisations in a region
ITERATIONS = 20  # of each
MOST_LOOKS = 20_000_000  # of clusters at simplices: each looks at the whole mesh, and more rings make fewer clusters
MOST_VERTICES = 10_000  # of a cluster: a larger one is no tangle that small steps mend


def minimisations(
    regions: tuple[int | None, ...],
    max_move: float,
    threads: int,
    freedom: Freedom | None,
    stars: kernels.Connectivity,
    points: Array,
    start: Array,
    free: Mask,
    broken: Mask,
) -> Iterator[Array]:
    """Yield the points (n, d) after each pass over the inverted elements, again as long as passes mend some.

    A pass has the clusters of so many rings around inverted elements for its regions, one after the other. The
    parameters are those of `foldover.minimisations_in_regions`.
    """
    assert freedom is not None
    judged, least = Judged(stars).without(stars.stuck(free, threads)), math.inf
    while broken.any() and (left := len(judged.check(points, threads)[0])) < least:
        least = left
        for rings in regions:
            for cluster in _clusters(stars, around(stars, free, broken, rings)):
                region = OnSurfaces(stars, cluster, Reach(start, max_move), threads, freedom)
                points = region.mended(points)
            yield points
            broken = np.zeros_like(free)
            broken[judged.vertices(judged.check(points, threads)[0])] = True


def _clusters(stars: kernels.Connectivity, near: Mask) -> Iterator[Mask]:
    """Yield the parts (n,) of some vertices that are joined through neighbours, in the order of their first ones.

    Too many are none, and those that are too large are left out.
    """
    begin = np.repeat(np.arange(len(near), dtype=np.int32), np.diff(stars.neighbour_offsets))
    both = near[begin] & near[stars.neighbours]
    pairs = np.stack([begin[both], stars.neighbours[both]], axis=1)
    number = np.where(near, kernels.joined(np.ascontiguousarray(pairs), len(near)), -1)
    firsts, counts = np.unique(number[near], return_counts=True)
    if len(firsts) * len(stars.simplices) <= MOST_LOOKS:
        for first in firsts[counts <= MOST_VERTICES]:
            yield number == first


class OnSurfaces(FoldoverRegion):
    """A region of which some vertices slide on surfaces or along curves."""

    def __init__(self, mesh: kernels.Connectivity, free: Mask, reach: Reach, threads: int, freedom: Freedom) -> None:
        super().__init__(mesh, free, reach, threads)
        self.of_all, self.sliding = freedom, self.moving[freedom.curved[self.moving]]

    def mended(self, points: Array) -> Array:
        """Return the points with the fewest inverted elements of those after each minimisation; the first are best."""
        best, least = points, self._inverted(points)
        if least == 0:
            return points
        targets, radius = self.uniform(points), STEP * self.size(points)
        problem = self._in_planes(points, targets, radius)
        eps = max(1.0, -0.2 * problem.min_det)
        for _ in range(ROUNDS):
            before, after = problem.minimise(eps, WEIGHT, ITERATIONS, 0.0, until_valid=False)
            if not math.isfinite(after):
                break
            points = self._on_shapes(points, self._moved(points, problem))
            left = self._inverted(points)
            best, least = (points, left) if left < least else (best, least)
            if least == 0:
                break
            problem = self._in_planes(points, targets, radius)
            after, _ = problem.minimise(eps, WEIGHT, 0, 0.0, until_valid=False)
            eps = next_eps(eps, problem.min_det, max(1 - after / before, QUICK.least_share))
        return best

    def _inverted(self, points: Array) -> int:
        if self.elements is None:
            return len(kernels.check(points, self.global_simplices, self.threads)[0])
        return len(self.elements.check(points, self.threads)[0])

    def _in_planes(self, points: Array, targets: Array, radius: float) -> kernels.Foldover:
        freedom = self.of_all.touching(self.moving, points[self.moving], self.threads)
        return kernels.Foldover(
            points[self.vertices], self.simplices, targets, points[self.moving], radius, False, self.threads, freedom
        )

    def _on_shapes(self, points: Array, moved: Array) -> Array:
        """Put those that slide on their shapes; what is out of reach then stays where it was."""
        shapes = self.of_all.shapes
        if shapes is not None and len(self.sliding):
            which = self.of_all.frame[self.sliding] - np.int32(len(self.of_all.axes))
            moved[self.sliding] = shapes.kernel.nearest(moved[self.sliding], which, self.threads)[0]
        if self.reach.distance < math.inf:
            far = np.linalg.norm(moved - self.reach.start, axis=1) > self.reach.distance
            moved[far] = points[far]
        return moved
