"""What makes a valid mesh impossible, wherever the free vertices go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import SIMPLICES
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.topology import distinct

Array = NDArray[np.float64]

# Depths below a facet, relative to the longest edges about, at which parts that share a place overlap.
CONTACT = 0.3  # where facets cross; a chord of an eighth of a circle is a tenth of its length away from it
TOUCHING = 1e-3  # elsewhere
AS_LARGE = 0.4  # as what crosses: smaller simplices in contact may lie within a chord of larger ones


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Simplices, by their rows, that no position of the free vertices mends.

    Attributes
    ----------
    inverted : (k,) int32
        Inverted simplices without a free vertex.
    exclusive : (e,) int32
        Simplices that have one and the same free vertex with some others of these, and no position of it makes all of
        them positive: the dual of the linear programme of section 2 certifies it.
    crossing : (c, 2) int32
        Pairs of simplices of one part that have fixed facets which cross each other: the part overlaps itself, even
        where all of its simplices are positive. Each facet's first 16 crossings are looked for.
    folding : (b, 2) int32
        Pairs of simplices of one part that have fixed facets in one line or plane, which lie upon each other with their
        insides on the same side: the boundary folds back upon itself there. Of each facet the first 16.
    overlapping : (o,) int32
        Simplices at the boundary of a part, below which another part is as well.
    """

    inverted: NDArray[np.int32]
    exclusive: NDArray[np.int32]
    crossing: NDArray[np.int32]
    folding: NDArray[np.int32]
    overlapping: NDArray[np.int32]

    def __bool__(self) -> bool:
        return any(map(len, (self.inverted, self.exclusive, self.crossing, self.folding, self.overlapping)))

    def hopeless(self, mesh: Mesh) -> NDArray[np.bool_] | None:
        """Mark simplices (m,), in the order of the connectivity, that may stay inverted whatever is done.

        Those that are named here and, where facets cross or fold, the neighbours of these. None: there are none.
        """
        if not self:
            return None
        named = np.zeros(mesh.topology.m, dtype=bool)
        named[self.inverted] = named[self.exclusive] = True
        around = np.zeros(mesh.topology.n, dtype=bool)
        for pairs in (self.crossing, self.folding):
            around[mesh.topology.simplices[pairs]] = True
        named |= around[mesh.topology.simplices].any(axis=1)
        return named[mesh.topology.connectivity.rows]


def find_obstacles(mesh: Mesh, threads: int = 1) -> Obstacles:
    """Find what makes a valid mesh impossible.

    Facets that only touch, as at a slit, do not cross. Separate parts may be in contact, and as their facets are flat
    they may interpenetrate there a little.

    Parameters
    ----------
    mesh : Mesh
    threads : int

    Returns
    -------
    Obstacles
        Each simplex, and each pair, once and in ascending order: the same for any number of threads.
    """
    connectivity, points = mesh.topology.connectivity, mesh.along_curve(mesh.points)
    movable = mesh.along_curve(mesh.movable)
    inverted = kernels.check(points, connectivity.simplices, threads)[0]
    free = movable[connectivity.simplices[inverted]].sum(axis=1)
    facets, owners, shared = connectivity.fixed_facets(movable, threads)
    rows = connectivity.rows

    def in_one_part(pairs: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return which simplices have these facets, of pairs of one part."""
        simplices = owners[pairs]
        parts = connectivity.component[simplices]
        within = (parts[:, 0] == parts[:, 1]) & (simplices[:, 0] != simplices[:, 1])
        return _distinct_pairs(rows[simplices[within]])

    return Obstacles(
        np.sort(rows[inverted[free == 0]]),
        distinct(rows[_exclusive(mesh, points, movable, inverted[free == 1], threads)]),
        in_one_part(kernels.crossings(points, facets, threads)),
        in_one_part(kernels.folds(points, facets, shared, threads)),
        np.sort(rows[_overlapping(mesh, points, movable, inverted, threads)]),
    )


def _exclusive(
    mesh: Mesh, points: Array, movable: NDArray[np.bool_], inverted: NDArray[np.int32], threads: int
) -> NDArray[np.int32]:
    """Return rows of the connectivity; some of these inverted simplices, which have one free vertex, are among them."""
    if not len(inverted):
        return inverted
    stars = mesh.topology.stars(threads)
    corners = stars.simplices[inverted]
    return kernels.exclusive(points, stars, movable, distinct(corners[movable[corners]]), threads)


def _distinct_pairs(pairs: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the different pairs (c, 2), each and all of them ascending."""
    first, second = np.sort(pairs, axis=1).astype(np.int64).T
    found = distinct(first << 32 | second)
    return np.stack([found >> 32, found & 0xFFFFFFFF], axis=1).astype(np.int32)


def _overlapping(
    mesh: Mesh, points: Array, movable: NDArray[np.bool_], inverted: NDArray[np.int32], threads: int
) -> NDArray[np.int32]:
    """Return rows of the connectivity: simplices at places of their part that lie in another part as well.

    Below every facet of the boundary is looked and, in parts that cross others, at the centroids of simplices that are
    as large as what crosses; there as deep as flat facets of that size may interpenetrate where curved parts are in
    contact. The centroids of these inverted simplices (i,) say nothing, as those of simplices with a free vertex, which
    may be anywhere.
    """
    connectivity = mesh.topology.connectivity
    component = connectivity.component
    if mesh.apart or not component.any():
        return np.empty(0, dtype=np.int32)
    rows, positions = np.nonzero(connectivity.mates < 0)
    facets = connectivity.simplices[rows[:, None], np.array(SIMPLICES[points.shape[1]].shape.facets)[positions]]
    corners, parts = points[facets], component[rows]
    size = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    length = _crossing_lengths(points, facets, parts, size, movable, threads)
    below = np.where(length[parts] > 0, CONTACT * np.maximum(size, length[parts]), TOUCHING * size)
    places = corners.mean(axis=1) - below[:, None] * _outward(corners)
    largest = np.zeros(len(component))  # facet at the boundary, of each simplex
    np.maximum.at(largest, rows, size)
    rigid = np.setdiff1d(mesh.stuck(threads), inverted)
    inner = rigid[(length[component[rigid]] > 0) & (largest[rigid] > AS_LARGE * length[component[rigid]])]
    owners = np.concatenate([rows, inner]).astype(np.int32)
    places = np.concatenate([places, points[connectivity.simplices[inner]].mean(axis=1)])
    found = kernels.enclosing(points, facets, parts, places, component[owners], threads)
    return np.unique(owners[found >= 0])


def _crossing_lengths(
    points: Array,
    facets: NDArray[np.int32],
    parts: NDArray[np.int32],
    size: Array,
    movable: NDArray[np.bool_],
    threads: int,
) -> Array:
    """Return the size of the largest of the fixed facets (f, d) with which each part (p,) crosses another, or 0."""
    fixed = np.flatnonzero(~movable[facets].any(axis=1))
    pairs = fixed[kernels.crossings(points, np.ascontiguousarray(facets[fixed]), threads)]
    pairs = pairs[parts[pairs[:, 0]] != parts[pairs[:, 1]]]
    length = np.zeros(parts.max() + 1)
    np.maximum.at(length, parts[pairs].ravel(), np.repeat(size[pairs].max(axis=1), 2))
    return length


def _outward(corners: Array) -> Array:
    """Return unit normals (f, d) of facets (f, d, d)."""
    edges = corners[:, 1:] - corners[:, :1]
    if edges.shape[2] == 2:
        normals = np.stack([edges[:, 0, 1], -edges[:, 0, 0]], axis=1)
    else:
        normals = np.cross(edges[:, 0], edges[:, 1])
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
