"""Curved elements by their spaces of monomials: an oracle that knows nothing of Bezier coefficients."""

from __future__ import annotations

from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import Element, element_of
from meshfix_cli.mesh.quadratic import SECOND_ORDER, Quadratic

Array = NDArray[np.float64]
CODES = {element.key: code for code, element in enumerate(SECOND_ORDER)}
# Of higher order: those of an l have nodes at the points of Gauss and Lobatto.
HIGHER = ("triangle10", "triangle15l", "quad16", "quad25l", "tetra20", "tetra35l", "wedge40", "hexahedron64")
_QUAD = [(0, 0), (1, 0), (1, 1), (0, 1)]
_TRIANGLE = [(0, 0), (1, 0), (0, 1)]
_CORNERS = {
    "triangle": _TRIANGLE,
    "quadrilateral": _QUAD,
    "tetrahedron": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "wedge": [(*p, z) for z in (0, 1) for p in _TRIANGLE],
    "hexahedron": [(*p, z) for z in (0, 1) for p in _QUAD],
}


def type_of(key: str) -> Element:
    """Return a type by its name."""
    element = element_of(key)
    assert element is not None
    return element


def order_of(key: str) -> int:
    """Return the order of a type."""
    lattice = type_of(key).lattice
    return 2 if lattice is None else lattice.order


def mesh_of(key: str) -> kernels.QuadraticMesh:
    """Return one element of a type, as the kernels take it."""
    count = type_of(key).nodes
    return Quadratic([(key, np.arange(count)[None])], count).kernel


def coefficients(key: str, nodes: Array) -> Array:
    """Return the Bezier coefficients of an element with nodes (n, d)."""
    return mesh_of(key).coefficients(nodes)


def _belongs(key: str, e: tuple[int, ...]) -> bool:
    """Whether a monomial of these exponents, none above the order, is in the space of a type."""
    if key not in CODES:
        simplex = {"triangle": 2, "wedge": 2, "tetrahedron": 3}.get(type_of(key).shape.name, 0)
        return sum(e[:simplex]) <= order_of(key)
    if key in ("triangle6", "tetra10"):
        return sum(e) <= 2
    if key in ("wedge15", "wedge18"):
        return e[0] + e[1] <= 2 and not (key == "wedge15" and e[0] + e[1] == 2 and e[2] == 2)
    return key in ("quad9", "hexahedron27") or e.count(2) <= 1  # serendipity


def exponents(key: str) -> list[tuple[int, ...]]:
    """Return the exponents of the monomials that span the space of a type."""
    return [e for e in product(range(order_of(key) + 1), repeat=type_of(key).shape.dimension) if _belongs(key, e)]


def positions(key: str) -> Array:
    """Return the nodes (k, d) of the straight element at the corners of the parameters."""
    corners = np.array(_CORNERS[type_of(key).shape.name], dtype=float)
    if key not in CODES:
        return np.concatenate([corners, np.array(type_of(key).weights) @ corners])
    return np.array([corners[mean].mean(axis=0) for mean in kernels.QUADRATIC_SHAPES[CODES[key]][1]])


def inside(random: np.random.Generator, key: str, count: int) -> Array:
    """Return parameters (count, d) inside a type."""
    d, name = type_of(key).shape.dimension, type_of(key).shape.name
    at = random.random((4 * count + 40, d)) if name != "triangle" else random.random((4 * count + 40, 2))
    if name == "tetrahedron":
        at = random.dirichlet(np.ones(4), len(at))[:, :3]
    if name in ("triangle", "wedge"):
        at[:, :2] = random.dirichlet(np.ones(3), len(at))[:, :2]
    return at[:count]


def mapped(key: str, nodes: Array, at: Array) -> Array:
    """Return the positions (k, d) in an element with nodes (n, d) at parameters (k, d)."""
    values = np.stack([np.prod(at ** np.array(e), axis=1) for e in exponents(key)], axis=1)
    return np.asarray(values @ _from_nodes(key) @ nodes)


def jacobians(key: str, nodes: Array, at: Array) -> Array:
    """Return det J (k,) of an element with nodes (n, d) at parameters (k, d)."""
    return np.asarray(np.linalg.det(derivatives(key, nodes, at)))


@cache
def _from_nodes(key: str) -> Array:
    """Return what makes values at the nodes weights of the monomials."""
    return np.linalg.inv(np.stack([np.prod(positions(key) ** np.array(e), axis=1) for e in exponents(key)], axis=1))


def derivatives(key: str, nodes: Array, at: Array) -> Array:
    """Return the derivatives (k, directions, d) of the position; see `jacobians`."""
    powers, weights = exponents(key), _from_nodes(key) @ nodes  # of the monomials
    columns = []
    for axis in range(at.shape[1]):
        slopes = []
        for e in powers:
            lower = np.array(e)
            lower[axis] = max(lower[axis] - 1, 0)
            slopes.append(e[axis] * np.prod(at**lower, axis=1))
        columns.append(np.stack(slopes, axis=1) @ weights)
    return np.stack(columns, axis=1)


def perturbed(random: np.random.Generator, key: str, size: float) -> Array:
    """Return the nodes of an element, each moved by a random step, which is the smaller the closer they are."""
    nodes = positions(key)
    return nodes + size * (2 / order_of(key)) ** 2 * random.normal(size=nodes.shape)
