"""How good a mesh is, in a few numbers and element by element."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.formulas import worst_and_mean
from meshfix_cli.quality.relative import worst_and_mean_to

Array = NDArray[np.float64]
BIN_WIDTH = 5.0  # degrees, of the histogram of smallest angles

# The smallest angle of a triangle is at most 60 degrees, of a tetrahedron at most acos(1/3) = 70.5.
BINS = {2: 12, 3: 15}


@dataclass(frozen=True, eq=False)
class Summary:
    """Quality of a mesh; angles in degrees (dihedral for tetrahedra), measures in model units.

    Angles are those of the shape, without sign; `inverted` counts the elements that are not valid. Where there is a
    reference, `to_reference` are the smallest and the mean of `relative.mean_ratios`.
    """

    elements: int
    inverted: int
    folded: int
    min_measure: float
    min_angle: float
    max_angle: float
    mean_min_angle: float
    percentile_1: float
    histogram: tuple[int, ...]
    metrics: dict[str, tuple[float, float]]
    inverted_elements: NDArray[np.int32]
    to_reference: tuple[float, float] | None = None


def summarise(mesh: Mesh, metrics: Sequence[str] = (), threads: int = 1, reference: Array | None = None) -> Summary:
    """Evaluate a mesh.

    Parameters
    ----------
    mesh : Mesh
    metrics : sequence of str
        Keys of `METRICS`; the summary holds the worst and the mean value of each, among the elements that have it.
    threads : int
    reference : (k, d) float64, optional
        Where the vertices, in the order of the connectivity, were before the boundary moved.

    Returns
    -------
    Summary
        `folded` counts interior facets with both simplices on one side; `percentile_1` is that of the elements'
        smallest angles; `histogram` counts those in bins of `BIN_WIDTH` degrees.
    """
    connectivity, bins = mesh.topology.connectivity, BINS[mesh.dimension]
    smallest, histogram, total, inverted, folded, min_measure, largest = kernels.summarise(
        mesh.along_curve(mesh.points), connectivity, bins, math.radians(BIN_WIDTH), threads
    )
    return Summary(
        elements=len(smallest),
        inverted=len(inverted),
        folded=folded,
        min_measure=min_measure,
        min_angle=math.degrees(smallest.min()),
        max_angle=math.degrees(largest),
        mean_min_angle=math.degrees(total / len(smallest)),
        percentile_1=math.degrees(_percentile(smallest, 1, histogram)),
        histogram=tuple(histogram.tolist()),
        metrics={name: worst_and_mean(name, mesh) for name in metrics},
        inverted_elements=np.sort(connectivity.rows[inverted]),
        to_reference=None if reference is None else worst_and_mean_to(mesh, reference),
    )


def _percentile(angles: Array, percent: float, histogram: NDArray[np.int64]) -> float:
    """Return a percentile as numpy does, of the bins that it can be in."""
    rank = percent / 100 * (len(angles) - 1)
    here, behind = int(rank), min(int(rank) + 1, len(angles) - 1)
    bins = np.searchsorted(np.cumsum(histogram), behind, side="right") + 2  # one more, for rounding at its edge
    low = np.partition(angles[angles < math.radians(float(bins) * BIN_WIDTH)], (here, behind))
    return float(low[here] + (low[behind] - low[here]) * (rank - here))


def by_element(mesh: Mesh, threads: int = 1) -> dict[str, NDArray[np.generic]]:
    """Return arrays (m,): the signed measure in model units, the smallest angle in degrees, 1 where inverted."""
    measure, valid = kernels.measure(mesh.points, mesh.topology.simplices, threads)
    smallest, _ = kernels.angles(mesh.points, mesh.topology.simplices, threads)
    wrong = (valid == 0) | mesh.topology.misnumbered
    return {"measure": measure, "min_angle": np.degrees(smallest), "inverted": wrong.astype(np.int32)}


def worst_first(mesh: Mesh, inverted: NDArray[np.int32], count: int, threads: int = 1) -> NDArray[np.int64]:
    """Return the rows (at most count,) of the worst simplices: inverted ones, then those of the smallest angles.

    Parameters
    ----------
    mesh : Mesh
    inverted : (k,) int32
        Rows of the inverted simplices, as in `Summary.inverted_elements`.
    count, threads : int
    """
    badness = -kernels.angles(mesh.points, mesh.topology.simplices, threads)[0]
    badness[inverted] += 2 * math.pi
    return np.argsort(-badness, kind="stable")[:count]


def distances(before: Mesh, after: Mesh) -> Array:
    """Measure how far each vertex moved.

    Parameters
    ----------
    before, after : Mesh
        Of one topology.

    Returns
    -------
    (n,) float64
        In model units; 0 for points that belong to no element.
    """
    with np.errstate(invalid="ignore"):  # of points that are of no element
        first, *others = (along * along for along in (after.points - before.points).T)
        return np.where(before.topology.used, np.sqrt(sum(others, first)), 0.0)


def displacement(before: Mesh, after: Mesh) -> dict[str, float]:
    """Summarise `distances`.

    Returns
    -------
    dict
        "mean", over the vertices that moved, and "largest", in model units; "vertices": how many moved.
    """
    far = distances(before, after)
    moved = far[far > 0]
    return {"mean": float(moved.mean()) if len(moved) else 0.0, "largest": float(far.max()), "vertices": len(moved)}


def ceiling(mesh: Mesh, threads: int = 1) -> float | None:
    """Find what no method can raise: the smallest angle among the simplices that have no free vertex.

    Parameters
    ----------
    mesh : Mesh
    threads : int

    Returns
    -------
    float or None
        Degrees, dihedral for tetrahedra; None: each simplex has a free vertex.
    """
    stuck = mesh.topology.connectivity.simplices[mesh.stuck(threads)]
    if len(stuck) == 0:
        return None
    return float(np.degrees(kernels.angles(mesh.along_curve(mesh.points), stuck, threads)[0].min()))
