"""Even sizes for elements that are not simplices: hard tangles leave some uneven, and sweeps hardly change that."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.quality.held import highest_of_corners
from meshfix_cli.solve.foldover import evened
from meshfix_cli.solve.region import Region
from meshfix_cli.solve.shape import FEW_ITERATIONS, SHARP, SHARP_WEIGHT, Goal, shaped, weights_of

if TYPE_CHECKING:
    from meshfix_cli.mesh.freedom import Freedom

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ITERATIONS, SHARP_ITERATIONS = 100, 50
# There is something to gain where the smallest scaled Jacobian is below such a share of the mean and of the ceiling;
# the second is that where the first percentile of the sizes is below `UNEVEN` of their mean.
POOR, POOR_OF_UNEVEN, UNEVEN = 0.62, 0.7, 0.25
LIFT = 3.0  # degrees by which the smallest should rise where worst corners judge


def evened_where_poor(
    smallest: float,
    mean: float,
    goal: Goal,
    threads: int,
    freedom: Freedom | None,
    stars: kernels.Connectivity,
    points: Array,
    free: Mask,
) -> Iterator[Array]:
    """Yield the points (n, d) with even sizes and then the best shape, where scaled Jacobians are poor.

    From the evened one, first as all corners judge it, then as the worst ones do.

    Parameters
    ----------
    smallest, mean : float
        Scaled Jacobians of the mesh.
    goal : Goal
        Of the shape.
    threads : int
        The points have the same bits for any number.
    freedom : Freedom or None
        Where the free vertices may go.
    stars : Connectivity
    points : (n, d) float64
        Of a valid mesh.
    free : (n,) bool
    """
    if smallest >= max(POOR, POOR_OF_UNEVEN) * mean or not free.any():
        return
    sizes = kernels.measure(points, stars.simplices, threads)[0]
    uneven = np.percentile(sizes, 1, method="lower") < UNEVEN * sizes.mean()
    if smallest < (POOR_OF_UNEVEN if uneven else POOR) * min(mean, ceiling(points, stars, free)):
        even = evened(points, stars, free, threads, ITERATIONS, freedom)
        yield shaped(even, stars, free, goal, threads, FEW_ITERATIONS, freedom)
        held = replace(goal, floor=math.degrees(math.asin(smallest)) + LIFT, stages=SHARP, weight=SHARP_WEIGHT)
        yield shaped(even, stars, free, held, threads, SHARP_ITERATIONS, freedom)


def ceiling(points: Array, mesh: kernels.Connectivity, free: Mask) -> float:
    """Return the largest smallest scaled Jacobian that edges between held vertices (n,) allow at the corners there."""
    region = Region(mesh, free)
    return highest_of_corners(points, region.global_simplices, weights_of(mesh, region), ~free)
