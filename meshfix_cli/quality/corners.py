"""The formulas of the metrics for all types but simplices: for each of `metrics.METRICS` one function of its name.

A formula takes a type and where the nodes of its elements are, (k, nodes, d) float64, in model units and in positive
order, and gives values (k,). Some know quadrilaterals alone, as the table says.

Corners do not decide whether a wedge or a hexahedron is valid: one that is inverted inside may have good values.

Source: SAND2007-1751, the chapters on quadrilaterals and hexahedra; VTK's copy of Verdict for pyramids and wedges.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import ELEMENTS, Element
from meshfix_cli.quality import simplices

Array = NDArray[np.float64]


def _corners(element: Element, nodes: Array) -> Iterator[Array]:
    """Give the edges (k, d, d) of each corner simplex from its node."""
    for first, *others in element.shape.simplices:
        yield nodes[:, others] - nodes[:, [first]]


def _dot(a: Array, b: Array) -> Array:
    result: Array = (a * b).sum(axis=-1)
    return result


def _determinant(edges: Array) -> Array:
    if edges.shape[2] == 2:
        return edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    return _dot(np.cross(edges[:, 0], edges[:, 1]), edges[:, 2])


def _determinants(element: Element, nodes: Array) -> Array:
    """Determinants (corners, k) of the edges at the corners."""
    return np.stack([_determinant(edges) for edges in _corners(element, nodes)])


def _quotient(above: Array, below: Array) -> Array:
    """Return above / below, and 0 where edges have no length: another corner may be worse than that."""
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)


def _scaled(edges: Array) -> Array:
    """Determinants (k,) of the edges (k, d, d), as if these had length 1."""
    return _quotient(_determinant(edges), np.linalg.norm(edges, axis=2).prod(axis=1))


def scaled_jacobian(element: Element, nodes: Array) -> Array:
    """Return the determinant of the unit edges at the worst corner, 1 for the ideal element.

    A hexahedron's centre counts as a corner. A pyramid has the worst scaled Jacobian of its corner tetrahedra: what
    exceeds that of the ideal pyramid counts as what falls as much short of it.
    """
    if element.key == "pyramid":
        tets = [simplices.scaled_jacobian(edges, _determinant(edges) / 6) for edges in _corners(element, nodes)]
        worst = element.shape.weight * np.min(tets, axis=0)
        return np.minimum(worst, 2 - worst)
    values = [_scaled(edges) for edges in _corners(element, nodes)]
    if element.key == "hexahedron":
        values.append(_scaled(_axes(nodes)))
    return element.shape.weight * np.stack(values).min(axis=0)


def _axes(nodes: Array) -> Array:
    """Four times the vectors (k, 3, 3) between the middles of opposite faces of hexahedra."""
    ends = (((1, 2, 5, 6), (0, 3, 4, 7)), ((2, 3, 6, 7), (0, 1, 4, 5)), ((4, 5, 6, 7), (0, 1, 2, 3)))
    return np.stack([(nodes[:, to] - nodes[:, start]).sum(axis=1) for to, start in ends], axis=1)


def shape(element: Element, nodes: Array) -> Array:
    """Return the determinant by the mean square of the edges at the worst corner.

    1 for the ideal element, 0 where a corner is not positive.
    """
    if element.key == "pyramid":
        return _shape_of_pyramids(element, nodes)
    d, values = element.shape.dimension, []
    for edges in _corners(element, nodes):
        positive = np.maximum(element.shape.weight * _determinant(edges), 0.0)
        values.append(_quotient(d * positive ** (2 / d), (edges**2).sum(axis=(1, 2))))
    worst: Array = np.min(values, axis=0)
    return worst


def _shape_of_pyramids(element: Element, nodes: Array) -> Array:
    """Return the product of the shape of the base, the cosine of the axis' lean, and how near the height is to ideal.

    The ideal height is the longest edge by the root of 2. The normal of a base that is warped is that of its diagonals;
    where it is not convex along that, the shape is 0, whatever the corners are.
    """
    base = nodes[:, :4]
    normal = np.cross(base[:, 2] - base[:, 0], base[:, 3] - base[:, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    flat = [
        2 * _dot(np.cross(edges[:, 0], edges[:, 1]), normal) / (edges**2).sum(axis=(1, 2))
        for edges in _corners(ELEMENTS["quad"], base)
    ]
    axis = nodes[:, 4] - base.mean(axis=1)
    height = _dot(axis, normal)
    longest = np.max([np.linalg.norm(edges, axis=2) for edges in _corners(element, nodes)], axis=(0, 2))
    share = height / (np.sqrt(0.5) * longest)
    values = (
        np.maximum(np.min(flat, axis=0), 0.0) * height / np.linalg.norm(axis, axis=1) * np.minimum(share, 1 / share)
    )
    return np.where(_determinants(element, nodes).min(axis=0) > 0, values, 0.0)


mean_ratio = shape  # as it is called for simplices


def min_angle(element: Element, nodes: Array) -> Array:
    """Return the smallest angle between the sides of a quadrilateral, in degrees and without sign."""
    angles = [
        np.arctan2(np.abs(_determinant(edges)), _dot(edges[:, 0], edges[:, 1])) for edges in _corners(element, nodes)
    ]
    return np.degrees(np.min(angles, axis=0))


def min_sine(element: Element, nodes: Array) -> Array:
    """Return the smallest sine of an angle of a quadrilateral, negative where that is reflex."""
    return scaled_jacobian(element, nodes)


def aspect_ratio(element: Element, nodes: Array) -> Array:
    """Return the longest side times the perimeter by 4 areas, 1 for a square and infinite where inverted."""
    sides, determinants = np.sqrt(_squared_sides(nodes)), _determinants(element, nodes)
    ratio = sides.max(axis=1) * sides.sum(axis=1) / determinants.sum(axis=0)
    return np.where(determinants.min(axis=0) > 0, ratio, np.inf)


def radius_ratio(element: Element, nodes: Array) -> Array:
    """Return h sqrt(sum of squared sides) / (smallest corner's determinant sqrt(8)), h the longest side or diagonal.

    1 for a square, infinite where inverted. What stands for the radii there is by extension of the triangle's.
    """
    sides, diagonals = _squared_sides(nodes), ((nodes[:, 2:] - nodes[:, :2]) ** 2).sum(axis=2)
    longest = np.maximum(sides.max(axis=1), diagonals.max(axis=1))
    worst = _determinants(element, nodes).min(axis=0)
    return np.where(worst > 0, np.sqrt(sides.sum(axis=1) * longest / 8) / worst, np.inf)


def _squared_sides(nodes: Array) -> Array:
    """Squares (k, 4) of the lengths of the sides of quadrilaterals."""
    squares: Array = ((nodes - np.roll(nodes, 1, axis=1)) ** 2).sum(axis=2)
    return squares
