"""Curved faces that their fixed nodes pinch: det J is zero there, wherever other nodes of the element go.

That is so where the derivatives along a face are parallel. Such places are points, and small changes of the nodes move
them but do not mend them: proofs at places of a lattice, as those of the kernels, miss them. Newton's method finds them
as zeros of the derivative in some direction of the face; that there is one is proved by Brouwer's fixed point theorem:
a step of it with the slope of the middle leads from all of a small box into that box.

Source: H. Whitney, "The singularities of a smooth n-manifold in (2n-1)-space", Annals of Mathematics 45 (1944); R. E.
Moore, "A test for existence of solutions to nonlinear systems", SIAM Journal on Numerical Analysis 14 (1977).
"""

from __future__ import annotations

import math
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import Element
from meshfix_cli.mesh.quadratic import Array, Mask, Quadratic
from meshfix_cli.mesh.topology import distinct

NEWTON = 12  # steps
BOX = 1e-6  # of the parameters, half the width
ROUNDED = 1e-13  # relative to the face: what a derivative may be off by
TURNED = 0.3  # of the largest height of a normal over the mean of all: where none is lower, no place is looked for
PER_ITEM = 4096  # problems that are solved at once


class _Face(NamedTuple):
    """A face of a type, its nodes at parameters from 0 to 1, and its position as a sum of monomials in these.

    Attributes
    ----------
    nodes : (k,) int
        Of the element.
    powers : (k, 2) int
    from_nodes : (k, k) float64
        What makes monomials' weights of the nodes.
    choose : (k, k) float64
        For each two monomials the products of the binomials of their powers.
    starts : (s, 2) float64
        Places all over it.
    triangular : bool
    """

    nodes: NDArray[np.intp]
    powers: NDArray[np.intp]
    from_nodes: Array
    choose: Array
    starts: Array
    triangular: bool

    def shifts(self, at: Array) -> Array:
        """Return what makes monomials' weights at places (q, 2) of those at the origin: (q, k, k)."""
        more = np.maximum(self.powers[None] - self.powers[:, None], 0)
        return np.asarray(self.choose * (at[:, None, None] ** more).prod(axis=-1))


@cache
def _faces(element: Element) -> tuple[_Face, ...]:
    order = 2 if element.lattice is None else element.lattice.order
    weights = np.concatenate([np.eye(element.shape.corners), np.array(element.weights)])
    found = []
    for corners in element.shape.facets if element.shape.dimension == 3 and order <= kernels.QUADRATIC_PROVED else ():
        shares = weights[:, list(corners)]
        nodes, triangular = np.flatnonzero(shares.sum(axis=1) > 1 - 1e-9), len(corners) == 3
        at = shares[nodes] @ np.array([[0, 0], [1, 0], [0, 1]] if triangular else [[0, 0], [1, 0], [1, 1], [0, 1]])
        lattice = np.array(list(product(range(2 * order + 1), repeat=2))) / (2 * order)
        powers = np.array(list(product(range(order + 1), repeat=2)))
        if triangular:
            lattice, powers = lattice[lattice.sum(axis=1) <= 1], powers[powers.sum(axis=1) <= order]
        powers = powers[: len(powers) - (len(nodes) < len(powers))]  # serendipity: without the highest
        values = (at[:, None] ** powers).prod(axis=-1)
        choose = [[math.prod(map(math.comb, old, new)) for old in powers.tolist()] for new in powers.tolist()]
        found.append(_Face(nodes, powers, np.linalg.inv(values), np.array(choose, dtype=float), lattice, triangular))
    return tuple(found)


def pinched(mesh: Quadratic, points: Array, free: Mask, asked: Mask) -> Mask:
    """Mark elements (m,) of which a face without a free node is pinched.

    Parameters
    ----------
    mesh : Quadratic
    points : (n, d) float64
    free : (n,) bool
        The nodes that may move.
    asked : (m,) bool
        The elements that are looked at.
    """
    found = np.zeros(len(mesh), dtype=bool)
    for code in distinct(mesh.codes[asked]):
        element = mesh.types[code]
        rows = np.flatnonzero(asked & (mesh.codes == code))
        nodes = mesh.nodes[mesh.offsets[rows][:, None] + np.arange(element.nodes)]
        for face in _faces(element):
            fixed = ~free[nodes[:, face.nodes]].any(axis=1)
            found[rows[fixed]] |= _are_pinched(face, points[nodes[fixed][:, face.nodes]])
    return found


def _are_pinched(face: _Face, places: Array) -> Mask:
    """Tell it of faces with nodes (f, k, 3)."""
    places = places - places.mean(axis=1, keepdims=True)
    size = np.abs(places).max(axis=(1, 2), initial=np.finfo(float).tiny)
    every = face.from_nodes @ (places / size[:, None, None])
    found, some = np.zeros(len(every), dtype=bool), max(PER_ITEM // len(face.starts), 1)
    turned = np.flatnonzero(_turns(face, every))
    sums = every[turned]
    for first in range(0, len(sums), some):
        here = sums[first : first + some]
        of = np.repeat(np.arange(len(here)), len(face.starts))
        proved = _proved(face, here[of], *_zeros(face, here[of], np.tile(face.starts, (len(here), 1))))
        np.logical_or.at(found, turned[first + of], proved)
    return found


def _turns(face: _Face, sums: Array) -> Mask:
    """Tell of faces (f, k, 3) whether normals nearly vanish against their mean, or point backwards; others are well."""
    lower = np.maximum(face.powers - np.eye(2, dtype=int)[:, None], 0)
    slopes = face.powers.T[:, None] * (face.starts[:, None] ** lower[:, None]).prod(axis=-1)
    normals = np.cross(slopes[0] @ sums, slopes[1] @ sums)
    heights = (normals * normals.mean(axis=1, keepdims=True)).sum(axis=2)
    return np.asarray(heights.min(axis=1) < TURNED * heights.max(axis=1))


def _derivatives(face: _Face, weights: Array, direction: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the derivative in a direction (q, 2) of weighted monomials (q, k, 3), as weights, and powers (2 k, 2)."""
    lower = face.powers - np.eye(2, dtype=int)[:, None, :]
    parts = [direction[:, i, None, None] * face.powers[:, i, None] * weights for i in range(2)]
    return np.concatenate(parts, axis=1), np.maximum(lower, 0).reshape(-1, 2)


def _slope(along: Array, across: Array, powers: NDArray[np.intp]) -> tuple[Array, Array]:
    """Return the derivative along a direction (q, 3), and its slope (q, 3, 3) by the place and by the direction."""
    parts = [along[:, (powers == power).all(axis=1)].sum(axis=1) for power in ((0, 0), (1, 0), (0, 1))]
    turned = across[:, (powers == 0).all(axis=1)].sum(axis=1)
    return parts[0], np.stack([*parts[1:], turned], axis=2)


def _turned(direction: Array) -> Array:
    return np.stack([-direction[:, 1], direction[:, 0]], axis=1)


def _zeros(face: _Face, sums: Array, at: Array) -> tuple[Array, Array]:
    """Go by Newton's method from places (q, 2) to where a derivative in some direction (q, 2) is zero."""
    first = _derivatives_at(face, sums, at)
    direction = np.linalg.svd(first.transpose(0, 2, 1))[2][:, 1]  # in which it is shortest
    for _ in range(NEWTON):
        weights = face.shifts(at) @ sums
        along, powers = _derivatives(face, weights, direction)
        value, slope = _slope(along, _derivatives(face, weights, _turned(direction))[0], powers)
        steps = _solved(slope, value)
        at = np.clip(at - steps[:, :2], -1, 2)
        direction = direction - steps[:, 2:] * _turned(direction)
        direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), np.finfo(float).tiny)
    return at, direction


def _derivatives_at(face: _Face, sums: Array, at: Array) -> Array:
    """Return both derivatives (q, 2, 3) at places (q, 2)."""
    weights = face.shifts(at) @ sums
    return np.stack([weights[:, (face.powers == power).all(axis=1)][:, 0] for power in ((1, 0), (0, 1))], axis=1)


def _solved(slope: Array, value: Array) -> Array:
    """Return steps (q, 3), none where the slope has no inverse."""
    singular = ~(np.abs(np.linalg.det(slope)) > np.finfo(float).tiny)
    return np.asarray(np.linalg.solve(np.where(singular[:, None, None], np.eye(3), slope), value[..., None])[..., 0])


def _proved(face: _Face, sums: Array, at: Array, direction: Array) -> Mask:
    """Tell where there is a zero in a box around these, all of which is in the face."""
    inside = ((at > BOX) & (at < 1 - BOX)).all(axis=1)
    if face.triangular:
        inside &= at.sum(axis=1) < 1 - 2 * BOX
    found = np.zeros(len(at), dtype=bool)
    at, direction, weights = at[inside], direction[inside], face.shifts(at[inside]) @ sums[inside]
    along, powers = _derivatives(face, weights, direction)
    across = _derivatives(face, weights, _turned(direction))[0]
    value, slope = _slope(along, across, powers)
    regular = np.abs(np.linalg.det(slope)) > np.finfo(float).tiny
    inverse = np.abs(np.linalg.inv(np.where(regular[:, None, None], slope, np.eye(3))))
    degree = powers.sum(axis=1)[:, None]
    bent = (np.abs(along) * (degree > 1) * BOX**degree).sum(axis=1)
    bent += (np.abs(across) * (degree > 0) * BOX ** (degree + 1)).sum(axis=1)
    step = (inverse @ (np.abs(value) + ROUNDED + bent)[..., None])[..., 0]
    found[inside] = regular & (step < BOX / 2).all(axis=1)
    return found
