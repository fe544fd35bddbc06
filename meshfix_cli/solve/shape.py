"""The shape of all elements of a valid mesh at once; the energy is in kernels/moves/shape.hpp."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.quality.held import corner_weights
from meshfix_cli.solve.region import Region

if TYPE_CHECKING:
    from meshfix_cli.mesh.freedom import Freedom

Array = NDArray[np.float64]

ITERATIONS = 100  # of "best"
FEW_ITERATIONS = 20  # of the default
ANGLE_OF_SLIDING = 1.0  # what a degree is worth where the boundary slides: its elements gain more in angles
WEIGHT = 1.0  # of an element a degree below the goal, where a mean ratio of one is worth 100
SHARP_WEIGHT = 3.0  # of a corner, where elements are judged by their worst ones
FEW_WEIGHT = 1000.0  # of one of the few that are raised, beside which nothing else counts
PLAIN = (0.0, 0.0)
# Sharpness and evenness of minimisations, one after the other: how much more worst corners count, and what their mean
# ratios are worth where scaled Jacobians are worth 1; see kernels/moves/shape.hpp. Without these are many valleys.
SHARP = tuple((15.0, evenness) for evenness in (8.0, 2.4, 0.8, 0.24, 0.0))
SHARPEST = ((30.0, 0.02), (100.0, 0.0))  # from where these lead: the mean of the smallest scaled Jacobians, nearly


@dataclass(frozen=True)
class Goal:
    """What counts beside the mean ratios and the smallest angles of all elements.

    Attributes
    ----------
    angle : float
        Degrees; smaller angles count more, by the square of what they lack.
    floor : float
        Degrees; smaller angles count much more.
    measure : float
        Model units; no measure gets smaller.
    stages : tuple of (float, float)
        Sharpness and evenness of minimisations, one after the other, that judge elements by their worst corners; none:
        one, for which all corners of an element count the same.
    weight : float
        Of what is below the angle and the floor.
    """

    angle: float
    floor: float = 0.0
    measure: float = 0.0
    stages: tuple[tuple[float, float], ...] = ()
    weight: float = WEIGHT


def shaped(
    points: Array,
    mesh: kernels.Connectivity,
    free: NDArray[np.bool_],
    goal: Goal,
    threads: int,
    iterations: int = ITERATIONS,
    freedom: Freedom | None = None,
) -> Array:
    """Return the points (n, d) with the free ones (n,) where mean ratios and smallest angles are best together.

    Parameters
    ----------
    points : (n, d) float64
        Of a valid mesh, which stays valid.
    mesh : Connectivity
        With its stars.
    free : (n,) bool
    goal : Goal
    threads : int
        The points have the same bits for any number.
    iterations : int
        At most.
    freedom : Freedom, optional
        Where the free vertices may go.
    """
    region = Region(mesh, free)
    weights, owners = weights_of(mesh, region), _owners(mesh, region)
    vertices, hexahedra = region.hexahedra() if goal.stages else (region.vertices, np.empty((0, 8), dtype=np.int32))
    sliding = () if freedom is None else (freedom.of(region.moving), ANGLE_OF_SLIDING)
    for sharpness, evenness in goal.stages or (PLAIN,):
        moved = points.copy()
        moved[region.moving] = kernels.shaped(
            points[vertices], region.simplices, weights, owners, hexahedra, len(region.moving), goal.angle, goal.floor,
            goal.measure, goal.weight, sharpness, evenness, iterations, threads, *sliding,
        )  # fmt: skip
        points = region.retreated(points, moved, goal.measure, threads)
    return points


def weights_of(mesh: kernels.Connectivity, region: Region) -> Array:
    """Return the weights (s,) of scaled Jacobians, 0 for whole simplices; (0,) where all are."""
    return np.empty(0) if mesh.simplicial else corner_weights(mesh, mesh.owners[region.rows])


def _owners(mesh: kernels.Connectivity, region: Region) -> NDArray[np.int32]:
    """Return the elements (s,) of the simplices; (0,) where they are these."""
    return np.empty(0, dtype=np.int32) if mesh.simplicial else np.ascontiguousarray(mesh.owners[region.rows])
