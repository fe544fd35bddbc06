"""From which side the elements of a surface in space are seen, and what is known of it by its topology alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.patches import unit_vectors
from meshfix_cli.mesh.topology import Topology

if TYPE_CHECKING:
    from meshfix_cli.mesh.curved import Smooth

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Kept:
    """What of a surface keeps its shape, beside its curvature.

    Attributes
    ----------
    labels : (m,) int64
        Elements, in the order of the connectivity, of different labels belong to different patches.
    lines : (l, 2) int32
        Edges that end patches, too, in the numbers of the connectivity.
    held : (k,) bool
        Vertices of the connectivity that never move.
    smooth : Smooth
        What counts as smooth, and how exactly it is kept.
    slide : {"none", "flat", "curved"}
        Whether vertices move along the straight ones, or all, of features and boundaries.
    """

    labels: NDArray[np.int64]
    lines: Numbers
    held: Mask
    smooth: Smooth
    slide: Literal["none", "flat", "curved"]


@dataclass(frozen=True, eq=False)
class Surface:
    """What is known of a surface beside its topology.

    Attributes
    ----------
    normals : (m, 3) float64
        Of the side from which each element, in the order of the connectivity, is seen: what turns away from it is
        inverted.
    kept : Kept or None
        None: nobody has told yet.
    has_reference : bool
        The normals, and where vertices slide, are those of a reference.
    """

    normals: Array
    kept: Kept | None = None
    has_reference: bool = False


def normals_seen(topology: Topology, points: Array, threads: int) -> Array:
    """Return unit normals (m, 3) of the side to which most of a surface turns, its vertices at points (k, 3).

    An element has its own. Where elements turn by more than a right angle against their neighbours, those that do so
    together are turned over if what is around them tells so: the area of the stars around as a vector, which does not
    depend on where their inner vertices are.
    """
    areas = kernels.area_vectors(points, *rows_of_elements(topology), threads)
    own, pairs = unit_vectors(areas), topology.joined
    turned = kernels.dots_between(own, pairs) < 0
    flat = _are_zero(own)
    if not (turned.any() or flat.any()):
        return own
    by_stars = normals_around(topology, points, threads)[1]
    patch = kernels.joined(np.ascontiguousarray(pairs[~turned]), len(own))
    (x, y, z), (a, b, c) = areas.T, by_stars.T
    along = x * a + y * b + z * c  # as a sum along rows it takes five times as long
    votes = np.bincount(patch, along, len(own))[patch]
    normals = np.where(((votes < 0) | flat)[:, None], by_stars, own)
    normals[_are_zero(normals), 2] = 1.0
    return normals


def _are_zero(vectors: Array) -> Mask:
    """Mark those of some vectors (k, 3) that have no length."""
    x, y, z = vectors.T
    return np.asarray((x == 0) & (y == 0) & (z == 0))


def normals_around(topology: Topology, points: Array, threads: int, edges: Mask | None = None) -> tuple[Array, Array]:
    """Return the unit normals that vertices (k, 3) and elements (m, 3) have by what is around them; 0: it tells none.

    They are those of the area, as a vector, of the stars of a vertex and its neighbours; of an element the sum of its
    vertices'. The stars of vertices on sharp edges (k,) tell nothing of what is beside them.
    """
    edges = np.zeros(len(points), dtype=bool) if edges is None else edges
    return kernels.normals_around(points, *rows_of_elements(topology), topology.stars(threads), edges, threads)


def rows_of_elements(topology: Topology) -> tuple[Numbers, Numbers]:
    """Return the offsets (m+1,) of the elements of a connectivity and their nodes, one behind the other."""
    mesh = topology.connectivity
    if mesh.simplicial:
        return np.arange(0, mesh.simplices.size + 1, 3, dtype=np.int32), mesh.simplices.ravel()
    return mesh.node_offsets, mesh.nodes


def facets_of(topology: Topology) -> Numbers:
    """Return the elements (m, 3 or 4) as facets in space; -1: no more vertices."""
    mesh = topology.connectivity
    if mesh.simplicial:
        return mesh.simplices
    counts = np.diff(mesh.node_offsets)
    facets = np.full((len(counts), int(counts.max())), -1, dtype=np.int32)
    facets[np.arange(facets.shape[1]) < counts[:, None]] = mesh.nodes
    return facets


def is_closed(topology: Topology) -> bool:
    """Whether a surface encloses something: each edge is of two elements, and these are numbered alike."""
    return bool((topology.across()[1] >= 0).all()) and topology.connectivity.orientable


def frames_of(normals: Array) -> Array:
    """Return orthonormal rows (k, 3, 3) of which the last are unit normals (k, 3)."""
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    along = unit_vectors(np.cross(least, normals))
    return np.stack([along, np.cross(normals, along), normals], axis=1)


def crowded_edges(topology: Topology) -> Numbers:
    """Return the edges (e, 2), in the numbers of the connectivity, of more than two elements."""
    edges, count = np.unique(np.sort(topology.facets_between(None)[0], axis=1), axis=0, return_counts=True)
    return edges[count > 2]
