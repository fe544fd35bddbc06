"""Layers along a wall that moved and left them behind: they follow it, as where a reference tells their shapes.

Without a reference it is made up: thin elements along a wall are thin on purpose, and the layer at the wall, which the
motion has turned inside out or stretched, was as high as the next one.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.quality.relative import mean_ratios
from meshfix_cli.solve import towards
from meshfix_cli.solve.foldover import Reach

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

THIN = 10.0  # longest edge by height
MOVED = 0.5  # heights of the next layer that a vertex may be from where its layers would go on, and count as unmoved
RINGS = (2, 3, 4, 5, 6, 7, 8, 10, 12, 16, 24, 32)  # around what moved, one after the other, in which layers follow
RATIO = 0.5  # to the shapes made up: the smallest mean ratio with which a region is large enough


def follow(
    max_move: float, threads: int, mesh: kernels.Connectivity, points: Array, start: Array, free: Mask
) -> Iterator[Array]:
    """Yield valid points (n, d) where the layers have followed the wall, in the smallest region; or nothing."""
    del points
    found = _region(mesh, start, free, max_move, threads)
    if found is not None:
        yield found[2]


def approach(
    max_move: float, threads: int, mesh: kernels.Connectivity, points: Array, start: Array, free: Mask
) -> Iterator[Array]:
    """Yield valid points after each minimisation of the energy in that region, with the shapes made up as targets."""
    found = _region(mesh, start, free, max_move, threads)
    if found is not None:
        yield from towards.approach(max_move, threads, mesh, points, start, found[0], found[1])


def _region(
    mesh: kernels.Connectivity, start: Array, free: Mask, max_move: float, threads: int
) -> tuple[Array, Mask, Array] | None:
    """Return the reference, the vertices that move, and the points after that."""
    reference = before_the_motion(mesh, start, free, threads)
    if reference is None:
        return None
    moved = (reference != start).any(axis=1)
    for rings in RINGS:
        near = free & mesh.grown(moved, rings).view(bool)
        points = Reach(start, max_move).drawn_in(towards.followed(start, mesh, reference, near))
        if len(kernels.check(points, mesh.simplices, threads)[0]):
            continue
        touched = mesh.simplices[near[mesh.simplices].any(axis=1)]
        if mean_ratios(points, reference, touched).min(initial=1.0) >= RATIO:
            return reference, near, points
    return None


def before_the_motion(mesh: kernels.Connectivity, points: Array, free: Mask, threads: int = 1) -> Array | None:
    """Return the points (n, d) with the walls where the layers beside them would go on; None: that is not the fault.

    It is where all inverted simplices are at a wall, beside thin ones, and none is left when the wall is back.
    """
    simplices = mesh.simplices
    inverted = simplices[kernels.check(points, simplices, threads)[0]]
    held = ~free
    if not len(inverted) or not held[inverted].any(axis=1).all():
        return None
    broken = held & _of(inverted, len(points))
    if not len(_back(mesh, points, broken)[0]):
        return None
    wall = _connected(mesh, held, broken)
    vertices, way = _back(mesh, points, wall)
    votes = np.bincount(vertices, minlength=len(points))
    sums = np.zeros_like(points)
    np.add.at(sums, vertices, way)
    reference = points + _filled(mesh, wall, votes, sums)
    return None if len(kernels.check(reference, simplices, threads)[0]) else reference


def _of(simplices: NDArray[np.int32], n: int) -> Mask:
    mask = np.zeros(n, dtype=bool)
    mask[simplices] = True
    return mask


def _connected(mesh: kernels.Connectivity, held: Mask, some: Mask) -> Mask:
    """(n,) bool: held vertices from which edges between such lead to some of them."""
    from scipy.sparse import csr_matrix  # slow to import, and seldom needed
    from scipy.sparse.csgraph import connected_components

    n = len(held)
    begin = np.repeat(np.arange(n, dtype=np.int32), np.diff(mesh.neighbour_offsets))
    both = held[begin] & held[mesh.neighbours]
    graph = csr_matrix((np.ones(both.sum(), dtype=np.int8), (begin[both], mesh.neighbours[both])), shape=(n, n))
    part = connected_components(graph, directed=False)[1]
    return held & np.isin(part, part[some])


def _back(mesh: kernels.Connectivity, points: Array, wall: Mask) -> tuple[NDArray[np.int32], Array]:
    """Find the way back of the vertices of a wall, from the facets that separate one from a thin simplex.

    A layer is a facet, and over a corner of it the other vertex of that simplex: on the wall's side, the vertex is as
    far from the corner that is nearest to it.

    Returns
    -------
    vertices (k,), ways (k, d)
        A vertex may come more than once.
    """
    simplices, d = mesh.simplices, points.shape[1]
    at_wall = wall[simplices]
    rows = np.flatnonzero(at_wall.sum(axis=1) == 1)
    mates = mesh.mates[rows, at_wall[rows].argmax(axis=1)]
    beyond = (mates >= 0) & ~at_wall[mates // (d + 1)].any(axis=1)
    rows, mates = rows[beyond], mates[beyond]
    facets = points[simplices[rows][~at_wall[rows]].reshape(-1, d)]
    vertices, others = simplices[rows][at_wall[rows]], points[simplices.ravel()[mates]]
    along = facets[:, 1:] - facets[:, :1]
    size = np.abs(np.linalg.det(np.concatenate([along, (others - facets[:, 0])[:, None]], axis=1)))
    area = np.linalg.norm(along[:, 0] if d == 2 else np.cross(along[:, 0], along[:, 1]), axis=1)
    thin = np.linalg.norm(along, axis=2).max(axis=1) * area > THIN * size
    vertices, others, facets = vertices[thin], others[thin], facets[thin]
    layer = others - _nearest(facets, others)
    way = _nearest(facets, points[vertices]) - layer - points[vertices]
    moved = (way**2).sum(axis=1) > MOVED * MOVED * (layer**2).sum(axis=1)
    return vertices, np.where(moved[:, None], way, 0.0)


def _nearest(corners: Array, points: Array) -> Array:
    """Return the corner (k, d) of each facet (k, d, d) that is nearest to a point (k, d)."""
    distances = ((corners - points[:, None]) ** 2).sum(axis=2)
    return corners[np.arange(len(corners)), distances.argmin(axis=1)]


def _filled(mesh: kernels.Connectivity, wall: Mask, votes: NDArray[np.integer], sums: Array) -> Array:
    """Return the way (n, d) of each vertex: the mean of its votes or, without any, of its neighbours on the wall."""
    known = votes > 0
    ways = sums / np.maximum(votes, 1)[:, None]
    begin = np.repeat(np.arange(len(wall), dtype=np.int32), np.diff(mesh.neighbour_offsets))
    from_known = wall[begin] & ~known[begin] & known[mesh.neighbours]
    begin, end = begin[from_known], mesh.neighbours[from_known]
    counts = np.bincount(begin, minlength=len(wall))
    for axis in range(ways.shape[1]):
        ways[:, axis] += np.bincount(begin, ways[end, axis], len(wall)) / np.maximum(counts, 1)
    return ways
