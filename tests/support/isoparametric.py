"""Elements as the maps that they are, from their shape functions alone: what the kernels are compared with."""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import JUDGED

Array = NDArray[np.float64]
Verdicts = tuple[NDArray[np.uint8], Array, Array]

# Regular elements, in gmsh's order; a pyramid whose corners at the base have edges like those of a cube's corner.
REGULAR: dict[str, list[tuple[float, ...]]] = {
    "line": [(0,), (1,)],
    "triangle": [(0, 0), (1, 0), (0.5, sqrt(3) / 2)],
    "quad": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "tetra": [(0, 0, 0), (1, 1, 0), (0, 1, 1), (1, 0, 1)],
    "pyramid": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, sqrt(0.5))],
    "wedge": [(0, 0, 0), (1, 0, 0), (0.5, sqrt(3) / 2, 0), (0, 0, 1), (1, 0, 1), (0.5, sqrt(3) / 2, 1)],
    "hexahedron": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
}
CODES = {element.key: code for code, element in enumerate(JUDGED)}


def regular(key: str) -> Array:
    """Nodes (n, d)."""
    return np.array(REGULAR[key], dtype=float)


def perturbed(random: np.random.Generator, key: str, count: int, spread: tuple[float, float] = (0.1, 0.5)) -> Array:
    """Regular elements (count, n, d) with nodes moved by normal numbers, more or less."""
    nodes = regular(key)
    moves = random.standard_normal((count, *nodes.shape))
    return nodes + moves * random.uniform(*spread, (count, 1, 1))


def judged(nodes: Array, key: str, threads: int = 1) -> Verdicts:
    """What the kernels say of elements (m, n, d) of one type that share no nodes."""
    m, n, d = nodes.shape
    points = np.ascontiguousarray(nodes.reshape(m * n, d))
    offsets = np.arange(0, m * n + 1, n, dtype=np.int32)
    codes = np.full(m, CODES[key], dtype=np.uint8)
    return kernels.judge(points, codes, offsets, np.arange(m * n, dtype=np.int32), threads)


def shape_functions(key: str, at: Array) -> Array:
    """Weights (k, n) of the nodes at parameters (k, d), each affine in each parameter; a pyramid's base is at t = 0."""
    r, s = at[:, 0], at[:, 1]
    t = at[:, 2] if at.shape[1] == 3 else np.zeros(len(at))
    triangle = np.stack([1 - r - s, r, s], axis=1)
    quad = np.stack([(1 - r) * (1 - s), r * (1 - s), r * s, (1 - r) * s], axis=1)
    below, above = (1 - t)[:, None], t[:, None]
    if key == "tetra":
        return np.stack([1 - r - s - t, r, s, t], axis=1)
    if key in ("triangle", "quad"):
        return triangle if key == "triangle" else quad
    if key == "pyramid":
        return np.concatenate([quad * below, above], axis=1)
    base = triangle if key == "wedge" else quad
    return np.concatenate([base * below, base * above], axis=1)


def jacobians(key: str, nodes: Array, at: Array) -> Array:
    """det J (..., k) of elements (..., n, d) at parameters (k, d); a derivative is the difference of two values."""
    columns = []
    for axis in range(at.shape[1]):
        first, last = at.copy(), at.copy()
        first[:, axis], last[:, axis] = 0, 1
        difference = shape_functions(key, last) - shape_functions(key, first)
        columns.append(np.einsum("kn,...nd->...kd", difference, nodes))
    if len(columns) == 2:
        return columns[0][..., 0] * columns[1][..., 1] - columns[0][..., 1] * columns[1][..., 0]
    return np.einsum("...d,...d->...", columns[0], np.cross(columns[1], columns[2]))


def grid(key: str, numbers: Array) -> Array:
    """The parameters (k, d) with coordinates of these numbers, of 0 to 1, that are in the element.

    Below the apex of a pyramid, where all is 0.
    """
    d = len(REGULAR[key][0])
    at = np.stack(np.meshgrid(*[numbers] * d, indexing="ij"), axis=-1).reshape(-1, d)
    if key == "pyramid":
        at[:, 2] *= 0.9
    barycentric = {"triangle": 2, "wedge": 2, "tetra": 3}.get(key, 0)
    return at[at[:, :barycentric].sum(axis=1) <= 1 + 1e-12]


def smallest_jacobian(key: str, nodes: Array, zooms: int = 5) -> float:
    """The smallest det J that is found by sampling one hexahedron or wedge (n, d), closer and closer around it."""
    at = grid(key, np.linspace(0, 1, 9))
    step, smallest = 1 / 8, np.inf
    for _ in range(zooms):
        values = jacobians(key, nodes, at)
        smallest = min(smallest, float(values.min()))
        around = np.stack(np.meshgrid(*[np.linspace(-step, step, 9)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
        at = np.clip(at[values.argmin()] + around, 0, 1)
        at = at[at[:, :2].sum(axis=1) <= 1] if key == "wedge" else at
        step /= 4
    return smallest


def quadrature(key: str) -> tuple[Array, Array]:
    """Parameters (k, d) and weights (k,) that integrate polynomials of a high degree over the element's parameters."""
    points, weights = np.polynomial.legendre.leggauss(6)
    points, weights = (points + 1) / 2, weights / 2
    d = len(REGULAR[key][0])
    at = np.stack(np.meshgrid(*[points] * d, indexing="ij"), axis=-1).reshape(-1, d)
    w = np.stack(np.meshgrid(*[weights] * d, indexing="ij"), axis=-1).reshape(-1, d).prod(axis=1)
    if key in ("triangle", "wedge", "tetra"):  # the square or cube, collapsed
        left = 1 - at[:, 0]
        w, at[:, 1] = w * left, at[:, 1] * left
        if key == "tetra":
            rest = left - at[:, 1]
            w, at[:, 2] = w * rest, at[:, 2] * rest
    return at, w
