"""How good a mesh is: the table of metrics and the summary of a mesh."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import _kernels
from meshfix_cli.mesh import Mesh

Array = NDArray[np.float64]

BIN_WIDTH = 5.0  # degrees, of the histogram of smallest angles
# The smallest angle of a triangle is at most 60 degrees, of a tetrahedron at most acos(1/3) = 70.5.
BINS = {2: 12, 3: 15}


RELATIONS: dict[str, Callable[[float, float], bool]] = {
    ">=": operator.ge, "<=": operator.le, "==": operator.eq, ">": operator.gt, "<": operator.lt,
}  # fmt: skip


@dataclass(frozen=True)
class Metric:
    """A measure of the shape of one simplex.

    Attributes
    ----------
    evaluate : callable
        (edges (m, d, d), signed measure (m,)) -> (m,); edges[:, k] leads from vertex 0 to vertex k+1.
    worst : {"min", "max"}
        Which end of its range is bad.
    """

    evaluate: Callable[[Array, Array], Array]
    worst: Literal["min", "max"]


@dataclass(frozen=True, eq=False)
class Summary:
    """Quality of a mesh; angles in degrees (dihedral for tetrahedra), measures in model units.

    Angles are those of the shape, without sign; `inverted` counts the elements that are not valid.
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


# What a requirement can name beside the metrics: what the report prints of a mesh.
NUMBERS = tuple(field.name for field in fields(Summary) if field.type in ("int", "float"))


def summarise(mesh: Mesh, metrics: Sequence[str] = (), threads: int = 1) -> Summary:
    """Evaluate a mesh.

    Parameters
    ----------
    mesh : Mesh
    metrics : sequence of str
        Keys of `METRICS`; the summary holds the worst and the mean value of each.
    threads : int

    Returns
    -------
    Summary
        `folded` counts interior facets with both simplices on one side; `percentile_1` is that of the elements'
        smallest angles; `histogram` counts those in bins of `BIN_WIDTH` degrees.
    """
    connectivity, bins = mesh.topology.connectivity, BINS[mesh.dimension]
    smallest, histogram, total, inverted, folded, min_measure, largest = connectivity.summarise(
        mesh.along_curve(mesh.points), bins, math.radians(BIN_WIDTH), threads
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
        metrics={name: _worst_and_mean(name, mesh) for name in metrics},
        inverted_elements=np.sort(connectivity.rows[inverted]),
    )


def _percentile(angles: Array, percent: float, histogram: NDArray[np.int64]) -> float:
    """Return a percentile as numpy does, of the bins that it can be in."""
    rank = percent / 100 * (len(angles) - 1)
    here, behind = int(rank), min(int(rank) + 1, len(angles) - 1)
    bins = np.searchsorted(np.cumsum(histogram), behind, side="right") + 2  # one more, for rounding at its edge
    low = np.partition(angles[angles < math.radians(float(bins) * BIN_WIDTH)], (here, behind))
    return float(low[here] + (low[behind] - low[here]) * (rank - here))


@dataclass(frozen=True)
class Requirement:
    """A condition on the summary of a mesh, such as `min_angle >= 5`.

    Attributes
    ----------
    name : str
        A number of `Summary`, or a key of `METRICS`, of which the worst value counts.
    relation : str
        A key of `RELATIONS`.
    bound : float
    """

    name: str
    relation: str
    bound: float

    @classmethod
    def parse(cls, text: str) -> Requirement:
        """Read `NAME RELATION NUMBER`; ValueError, in one sentence, for anything else."""
        match = re.fullmatch(r"\s*(\w+)\s*(>=|<=|==|>|<)\s*(\S+)\s*", text)
        if match is None:
            raise ValueError(f"{text!r} is not a condition such as 'min_angle >= 5'")
        name, relation, bound = match.groups()
        if name not in NUMBERS and name not in METRICS:
            raise ValueError(f"{name!r} is none of {', '.join(dict.fromkeys((*NUMBERS, *METRICS)))}")
        try:
            number = float(bound)
        except ValueError:
            number = float("nan")
        if number != number:
            raise ValueError(f"{bound!r} is not a number")
        return cls(name, relation, number)

    @property
    def is_metric(self) -> bool:
        """Whether it is a metric that `summarise` must be asked for."""
        return self.name not in NUMBERS

    def value(self, summary: Summary) -> float:
        """Return the number that is compared."""
        return float(summary.metrics[self.name][0] if self.is_metric else getattr(summary, self.name))

    def holds(self, summary: Summary) -> bool:
        """Whether a mesh meets it."""
        return bool(RELATIONS[self.relation](self.value(summary), self.bound))

    def __str__(self) -> str:
        return f"{self.name} {self.relation} {self.bound:g}"


def by_element(mesh: Mesh, threads: int = 1) -> dict[str, NDArray[np.generic]]:
    """Return arrays (m,): the signed measure in model units, the smallest angle in degrees, 1 where inverted."""
    measure, valid = _kernels.measure(mesh.points, mesh.topology.simplices, threads)
    smallest, _ = _kernels.angles(mesh.points, mesh.topology.simplices, threads)
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
    badness = -_kernels.angles(mesh.points, mesh.topology.simplices, threads)[0]
    badness[inverted] += 2 * math.pi
    return np.argsort(-badness, kind="stable")[:count]


def distances(before: Mesh, after: Mesh) -> Array:
    """Return how far each vertex moved (n,), in model units; 0 for points that belong to no element."""
    used = before.topology.used
    moved = np.zeros(len(used))
    moved[used] = np.linalg.norm(after.points[used] - before.points[used], axis=1)
    return moved


def displacement(before: Mesh, after: Mesh) -> dict[str, float]:
    """Return the mean over the vertices that moved and the largest distance, in model units, and their number."""
    far = distances(before, after)
    moved = far[far > 0]
    return {"mean": float(moved.mean()) if len(moved) else 0.0, "largest": float(far.max()), "vertices": len(moved)}


def ceiling(mesh: Mesh, threads: int = 1) -> float | None:
    """Return the smallest angle among simplices with no free vertex: no method can raise it. None: there are none."""
    stuck = mesh.topology.connectivity.simplices[mesh.stuck(threads)]
    if len(stuck) == 0:
        return None
    return float(np.degrees(_kernels.angles(mesh.along_curve(mesh.points), stuck, threads)[0].min()))


def evaluate(name: str, mesh: Mesh) -> Array:
    """Return the values (m,) of a metric of `METRICS`."""
    p = mesh.points[mesh.topology.simplices]
    measure = _kernels.measure(mesh.points, mesh.topology.simplices, 1)[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        values = METRICS[name].evaluate(p[:, 1:] - p[:, :1], measure)
    # 0 / 0: nothing is left of the simplex.
    return np.where(np.isnan(values), 0.0 if METRICS[name].worst == "min" else np.inf, values)


def _worst_and_mean(name: str, mesh: Mesh) -> tuple[float, float]:
    values = evaluate(name, mesh)
    return float(values.min() if METRICS[name].worst == "min" else values.max()), float(values.mean())


def _lengths(edges: Array) -> Array:
    """Lengths (m, d+1, d+1) of the edges between all pairs of vertices."""
    vertices = np.concatenate([np.zeros_like(edges[:, :1]), edges], axis=1)
    return np.linalg.norm(vertices[:, :, None] - vertices[:, None], axis=3)


def _facets(edges: Array) -> Array:
    """Lengths or areas (m, d+1) of the facets opposite the vertices."""
    lengths = _lengths(edges)
    if edges.shape[2] == 2:
        return np.stack([lengths[:, 1, 2], lengths[:, 0, 2], lengths[:, 0, 1]], axis=1)
    a, b, c = edges[:, 0], edges[:, 1], edges[:, 2]
    normals = [np.cross(b - a, c - a), np.cross(b, c), np.cross(a, c), np.cross(a, b)]
    return np.stack([np.linalg.norm(normal, axis=1) / 2 for normal in normals], axis=1)


def _longest(edges: Array) -> Array:
    return _lengths(edges).max(axis=(1, 2))


def _inradius(edges: Array, measure: Array) -> Array:
    """Radius of the inscribed sphere; 0 where the simplex is inverted."""
    return np.maximum(measure, 0.0) * edges.shape[2] / _facets(edges).sum(axis=1)


def _circumradius(edges: Array, measure: Array) -> Array:
    lengths = _lengths(edges)
    if edges.shape[2] == 2:
        return lengths[:, 0, 1] * lengths[:, 0, 2] * lengths[:, 1, 2] / (4 * measure)
    products = [lengths[:, 0, i] * lengths[:, j, k] for i, j, k in ((1, 2, 3), (2, 1, 3), (3, 1, 2))]
    a, b, c = products
    return np.sqrt((a + b + c) * (a + b - c) * (a - b + c) * (b + c - a)) / (24 * measure)


def _min_angle(edges: Array, measure: Array) -> Array:
    del measure
    m, d = edges.shape[:2]
    points = np.concatenate([np.zeros_like(edges[:, :1]), edges], axis=1).reshape(-1, d)
    return np.degrees(_kernels.angles(points, np.arange(m * (d + 1), dtype=np.int32).reshape(m, d + 1), 1)[0])


def _min_sine(edges: Array, measure: Array) -> Array:
    lengths, facets, d = _lengths(edges), _facets(edges), edges.shape[2]
    if d == 2:
        pairs = [lengths[:, i, j] * lengths[:, i, k] for i, j, k in ((0, 1, 2), (1, 0, 2), (2, 0, 1))]
        return 2 * measure / np.max(pairs, axis=0)
    # Faces i and j meet in the edge between the other two vertices.
    shares = []
    for i, j in combinations(range(4), 2):
        k, m = {0, 1, 2, 3} - {i, j}
        shares.append(lengths[:, k, m] / (facets[:, i] * facets[:, j]))
    return 1.5 * measure * np.min(shares, axis=0)


def _aspect_ratio(edges: Array, measure: Array) -> Array:
    factor = 2 * (np.sqrt(3) if edges.shape[2] == 2 else np.sqrt(6))
    return _longest(edges) / (factor * _inradius(edges, measure))


def _scaled_jacobian(edges: Array, measure: Array) -> Array:
    lengths, d = _lengths(edges), edges.shape[2]
    corners = [np.prod([lengths[:, i, j] for j in range(d + 1) if j != i], axis=0) for i in range(d + 1)]
    unit, factorial = (2 / np.sqrt(3), 2) if d == 2 else (np.sqrt(2), 6)
    return unit * factorial * measure / np.max(corners, axis=0)


def _mean_ratio(edges: Array, measure: Array) -> Array:
    squares, positive = (_lengths(edges) ** 2).sum(axis=(1, 2)) / 2, np.maximum(measure, 0.0)
    if edges.shape[2] == 2:
        return 4 * np.sqrt(3) * positive / squares
    return 12 * (3 * positive) ** (2 / 3) / squares


def _radius_ratio(edges: Array, measure: Array) -> Array:
    ratio = _circumradius(edges, measure) / (edges.shape[2] * _inradius(edges, measure))
    return np.where(measure > 0, ratio, np.inf)


# Source of all but the sine: Stimpson, Ernst, Knupp, Pebay, Thompson, "The Verdict Geometric Quality Library",
# SAND2007-1751. A regular simplex has 1, but for the first two.
METRICS: dict[str, Metric] = {
    "min_angle": Metric(_min_angle, "min"),  # degrees, without sign; dihedral for tetrahedra
    "min_sine": Metric(_min_sine, "min"),  # equation (3.2), with the sign of the measure
    "aspect_ratio": Metric(_aspect_ratio, "max"),  # longest edge / inradius
    "scaled_jacobian": Metric(_scaled_jacobian, "min"),  # Jacobian / edges at the worst corner
    "mean_ratio": Metric(_mean_ratio, "min"),  # Verdict's shape; 0 where inverted
    "radius_ratio": Metric(_radius_ratio, "max"),  # circumradius / (d inradius)
}
