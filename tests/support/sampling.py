"""The Jacobian determinants of elements of every type at many of their points, by their shape functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

Weights = list[Any]


def _line(t: Any) -> Weights:
    return [1 - t, t]


def _triangle(r: Any, s: Any) -> Weights:
    return [1 - r - s, r, s]


def _quad(r: Any, s: Any) -> Weights:
    return [(1 - r) * (1 - s), r * (1 - s), r * s, (1 - r) * s]


def _over(base: Weights, t: Any) -> Weights:
    return [weight * end for end in _line(t) for weight in base]


# The weight of each node at a point of VTK's parametric coordinates.
WEIGHTS: dict[str, Callable[..., Weights]] = {
    "triangle": _triangle,
    "quad": _quad,
    "tetra": lambda r, s, t: [1 - r - s - t, r, s, t],
    "pyramid": lambda r, s, t: [*(weight * (1 - t) for weight in _quad(r, s)), t],
    "wedge": lambda r, s, t: _over(_triangle(r, s), t),
    "hexahedron": lambda r, s, t: _over(_quad(r, s), t),
}
# Those in which r + s, or r + s + t, is at most 1.
_SLANTED = {"triangle": 2, "tetra": 3, "wedge": 2}
STEP = 1e-30


def places(key: str, steps: int) -> list[tuple[float, ...]]:
    """A lattice in the element; but for the tip of a pyramid, where its map has no derivative."""
    dimension = 2 if key in ("triangle", "quad") else 3
    lattice = product(range(steps + 1), repeat=dimension)
    slanted = _SLANTED.get(key, 0)
    inside = [p for p in lattice if sum(p[:slanted]) <= steps and not (key == "pyramid" and p[2] == steps)]
    return [tuple(k / steps for k in p) for p in inside]


def derivatives(key: str, place: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
    """Return those (d, nodes) of the weights, exact but for rounding: by a step along the imaginary axis."""
    steps = np.asarray(place) + 1j * STEP * np.eye(len(place))
    return np.array([np.broadcast_to(WEIGHTS[key](*at), len(WEIGHTS[key](*at))).imag / STEP for at in steps])


def jacobians(points: NDArray[np.float64], key: str, rows: NDArray[np.int32], steps: int = 4) -> NDArray[np.float64]:
    """Return the determinants (m, k) at k points of each element."""
    nodes = points[rows]
    return np.column_stack([np.linalg.det(derivatives(key, place) @ nodes) for place in places(key, steps)])


def measure(points: NDArray[np.float64], key: str, rows: NDArray[np.int32]) -> float:
    """Return the area or volume of all elements together, by Gauss's rule in a square or cube that is folded up."""
    nodes, weights = np.polynomial.legendre.leggauss(4)
    nodes, weights = (nodes + 1) / 2, weights / 2
    corners, total = points[rows], 0.0
    for index in product(range(4), repeat=points.shape[1]):
        place, weight = nodes[list(index)], float(weights[list(index)].prod())
        for k in range(1, _SLANTED.get(key, 0)):  # each further coordinate is a share of what the earlier ones left
            left = 1 - place[:k].sum()
            place[k] *= left
            weight *= left
        total += weight * float(np.linalg.det(derivatives(key, place) @ corners).sum())
    return total
