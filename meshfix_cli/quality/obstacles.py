"""What makes a valid mesh impossible, wherever the free vertices go."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.judged import VALID
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.topology import distinct
from meshfix_cli.quality.pinched import pinched

if TYPE_CHECKING:
    from meshfix_cli.mesh.quadratic import Mask, Quadratic

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
        Inverted simplices without a free vertex, or of which the only one slides, and is inverted wherever that goes.
    exclusive : (e,) int32
        Simplices that have one and the same free vertex with some others of these, and no position of it makes all of
        them positive: the dual of the linear programme of section 2 certifies it. Where that vertex slides, no place in
        its line or plane, on its curve or surface does.
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
        named[self.crossing] = named[self.folding] = True
        around = np.zeros(mesh.topology.n, dtype=bool)
        for block in mesh.topology.blocks:
            around[block.vertices[named[block.rows]]] = True
        named[self.inverted] = named[self.exclusive] = True
        for block in mesh.topology.blocks:
            named[block.rows] |= around[block.vertices].any(axis=1)
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
    if mesh.quadratic is not None:
        return _of_curved(mesh, mesh.quadratic, threads)
    if mesh.surface is not None:
        return _of_surface(mesh, threads)
    connectivity, points = mesh.topology.connectivity, mesh.along_curve(mesh.points)
    movable = mesh.along_curve(mesh.movable)
    corners = kernels.check(points, connectivity.simplices, threads)[0]
    free = movable[connectivity.simplices[corners]].sum(axis=1)
    inverted = mesh.topology.owners(corners)
    hopeless, rows = inverted[free == 0], connectivity.rows
    if not mesh.topology.simplicial:
        stuck = mesh.stuck(threads)
        wrong = mesh.judged(stuck).check(points, threads)[0]
        hopeless = np.concatenate([hopeless, stuck[wrong]])
    crossing, folding = _meeting(mesh, points, movable, threads)
    together, alone = _exclusive(mesh, points, movable, corners[free == 1], hopeless, threads)
    return Obstacles(
        distinct(rows[np.concatenate([hopeless, alone])]),
        distinct(rows[together]),
        crossing,
        folding,
        np.sort(rows[_overlapping(mesh, points, movable, inverted, threads)]),
    )


def crossings_of_surface(mesh: Mesh, threads: int = 1) -> int:
    """Count the pairs of elements of a surface that cross each other, of each element the first 16."""
    from meshfix_cli.mesh.sides import facets_of

    facets = facets_of(mesh.topology)
    triangles = facets[:, :3]
    if facets.shape[1] == 4:
        triangles = np.concatenate([triangles, facets[facets[:, 3] >= 0][:, [0, 2, 3]]])
    return len(kernels.crossings(mesh.along_curve(mesh.points), np.ascontiguousarray(triangles), threads))


def _of_surface(mesh: Mesh, threads: int) -> Obstacles:
    """Return the elements of a surface that are turned over and whose vertices are held; it may cross itself."""
    stuck, none = mesh.stuck(threads), np.empty(0, dtype=np.int32)
    wrong = stuck[mesh.judged(stuck).check(mesh.along_curve(mesh.points), threads)[0]]
    surface = mesh.surface
    if surface is not None and surface.kept is not None and not surface.has_reference:
        from meshfix_cli.mesh.sides import facets_of
        from meshfix_cli.mesh.tangle import ends

        # Others that do not move are on features, which a tangle may feign.
        held = np.append(ends(mesh), True)  # -1: no more vertices
        wrong = wrong[held[facets_of(mesh.topology)[wrong]].all(axis=1)]
    pairs = np.empty((0, 2), dtype=np.int32)
    return Obstacles(distinct(mesh.topology.connectivity.rows[wrong]), none, pairs, pairs, none)


def _of_curved(mesh: Mesh, quadratic: Quadratic, threads: int) -> Obstacles:
    """Return what is proved of curved elements, and where straight ones meet: of others that is not known.

    Inverted are those that are so wherever free nodes go; they exclude each other where one free node, or one free edge
    at an end of it, is common to them, and no position or tangent of it makes all of them valid.
    """
    invalid = quadratic.judge(mesh.points, threads).verdicts != VALID
    proofs = proofs_of_curved(quadratic, mesh.points, mesh.movable | quadratic.free, invalid)
    straight = find_obstacles(replace(mesh, quadratic=None), threads)
    curved, bent = np.zeros((2, mesh.topology.m), dtype=bool)
    curved[quadratic.rows] = True
    inverted = straight.inverted[~curved[straight.inverted]]
    alone = distinct(np.concatenate([quadratic.rows[proofs == 1], inverted])).astype(np.int32)
    together = np.sort(quadratic.rows[proofs == 2]).astype(np.int32)
    bent[quadratic.rows] = quadratic.bent(mesh.points)
    crossing, folding = (pairs[~bent[pairs].any(axis=1)] for pairs in (straight.crossing, straight.folding))
    return Obstacles(alone, together, crossing, folding, straight.overlapping[~bent[straight.overlapping]])


def proofs_of_curved(quadratic: Quadratic, points: Array, free: Mask, invalid: Mask) -> NDArray[np.uint8]:
    """Mark invalid curved elements (k,) that are so wherever free nodes go: 1 by themselves, 2 together with others."""
    proofs = quadratic.kernel.impossible(points, free.astype(np.uint8))
    proofs[pinched(quadratic, points, free, invalid & (proofs == 0))] = 1
    return proofs


def _meeting(
    mesh: Mesh, points: Array, movable: NDArray[np.bool_], threads: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return pairs of elements of one part whose fixed facets cross, and such whose facets fold upon each other.

    A quadrilateral need not be flat: its surface is between its triangles by one diagonal and by the other, so both are
    asked.
    """
    connectivity = mesh.topology.connectivity
    found = []
    for other_diagonal in (False,) if mesh.topology.simplicial else (False, True):
        facets, owners, shared = connectivity.fixed_facets(movable, threads, other_diagonal)
        pairs = kernels.crossings_and_folds(points, facets, shared, threads)
        found.append([_in_one_part(mesh, owners[some]) for some in pairs])
    crossing, folding = found[0]
    for others in found[1:]:
        crossing, folding = (_common(*two) for two in zip((crossing, folding), others, strict=True))
    return crossing, folding


def _in_one_part(mesh: Mesh, elements: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the pairs, as rows, of two elements of one part."""
    parts = mesh.topology.connectivity.component[elements]
    within = (parts[:, 0] == parts[:, 1]) & (elements[:, 0] != elements[:, 1])
    return _distinct_pairs(mesh.topology.connectivity.rows[elements[within]])


def _common(one: NDArray[np.int32], other: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the pairs (c, 2) that are in both."""
    both = set(map(tuple, one.tolist())) & set(map(tuple, other.tolist()))
    return np.array(sorted(both), dtype=np.int32).reshape(-1, 2)


def _exclusive(
    mesh: Mesh,
    points: Array,
    movable: NDArray[np.bool_],
    inverted: NDArray[np.int32],
    hopeless: NDArray[np.int32],
    threads: int,
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return rows of the connectivity; some of these inverted corner simplices, of one free vertex, are theirs.

    Those that exclude each other, and those that are inverted for themselves wherever that slides. Those of hopeless
    elements exclude no others.
    """
    if not len(inverted):
        return inverted, inverted
    stars = mesh.topology.stars(threads)
    corners = stars.simplices[inverted]
    freedom = None if mesh.freedom is None else mesh.freedom.kernel
    lost = np.zeros(mesh.topology.m, dtype=bool)
    lost[hopeless] = True
    lost = lost[mesh.topology.owners(np.arange(len(stars.simplices), dtype=np.int32))]
    vertices = distinct(corners[movable[corners]])
    together, alone = kernels.exclusive(points, stars, movable, lost, vertices, threads, freedom)
    wrong, alone = np.zeros(mesh.topology.m, dtype=bool), mesh.topology.owners(alone)
    wrong[mesh.topology.owners(inverted)] = True
    return mesh.topology.owners(together), alone[wrong[alone]]


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
    facets, rows, shared = connectivity.fixed_facets(np.zeros_like(movable), threads)
    facets, rows = np.ascontiguousarray(facets[shared == 0]), rows[shared == 0]
    corners, parts = points[facets], component[rows]
    size = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    count = int(component.max()) + 1  # some have no facet of their own: of two elements, one the other's back
    length = _crossing_lengths(points, facets, parts, count, size, movable, threads)
    below = np.where(length[parts] > 0, CONTACT * np.maximum(size, length[parts]), TOUCHING * size)
    places = corners.mean(axis=1) - below[:, None] * _outward(corners)
    largest = np.zeros(len(component))  # facet at the boundary, of each simplex
    np.maximum.at(largest, rows, size)
    rigid = np.setdiff1d(mesh.stuck(threads), inverted)
    inner = rigid[(length[component[rigid]] > 0) & (largest[rigid] > AS_LARGE * length[component[rigid]])]
    owners = np.concatenate([rows, inner]).astype(np.int32)
    places = np.concatenate([places, mesh.topology.centroids(points, inner)])
    found = kernels.enclosing(points, facets, parts, places, component[owners], threads)
    return np.unique(owners[found >= 0])


def _crossing_lengths(
    points: Array,
    facets: NDArray[np.int32],
    parts: NDArray[np.int32],
    count: int,
    size: Array,
    movable: NDArray[np.bool_],
    threads: int,
) -> Array:
    """Return the size of the largest of the fixed facets (f, d) with which each part (count,) crosses another, or 0."""
    fixed = np.flatnonzero(~movable[facets].any(axis=1))
    pairs = fixed[kernels.crossings(points, np.ascontiguousarray(facets[fixed]), threads)]
    pairs = pairs[parts[pairs[:, 0]] != parts[pairs[:, 1]]]
    length = np.zeros(count)
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
