"""Who may move where: vertices of a flat boundary in its planes and along its edges, the others anywhere or nowhere."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.judged import Judged
from meshfix_cli.mesh.patches import Constraints, Slides, lines_of_plane, of_solid, tolerance_of
from meshfix_cli.mesh.topology import Topology

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Freedom:
    """Where the vertices (k,) of a connectivity may go.

    Attributes
    ----------
    frame : (k,) int32
        The line or plane of each that slides; -1: it may go anywhere, or is held, as `Mesh.movable` tells.
    directions : (f,) uint8
        How many directions each of these has: 1 or 2.
    axes : (f, d, d) float64
        Orthonormal rows, of which the first span these directions; coordinates that none of them changes stay exactly.
    offsets : (k+1,) int32
    neighbours : int32
        Of each vertex that slides those in its line or plane, one vertex behind the other.
    """

    frame: Numbers
    directions: NDArray[np.uint8]
    axes: Array
    offsets: Numbers
    neighbours: Numbers

    @cached_property
    def kernel(self) -> kernels.Freedom:
        """The same for the kernels."""
        return kernels.Freedom(self.frame, self.directions, self.axes, self.offsets, self.neighbours)

    @cached_property
    def degrees(self) -> NDArray[np.uint8]:
        """(k,) uint8: the number of directions of those that slide, 0 for others."""
        return np.append(self.directions, np.uint8(0))[self.frame]

    def of(self, vertices: NDArray[np.integer]) -> kernels.Freedom:
        """Return what some vertices (v,), in their order, may do; without neighbours."""
        none = np.empty(0, dtype=np.int32)
        return kernels.Freedom(self.frame[vertices], self.directions, self.axes, none, none)

    def part(self, vertices: Numbers, own: int) -> Freedom:
        """Return that of a part of the mesh: vertices (v,), of which the first `own` have their neighbours in it."""
        number = np.full(len(self.frame), -1, dtype=np.int32)
        number[vertices] = np.arange(len(vertices), dtype=np.int32)
        counts = np.diff(self.offsets)[vertices]
        counts[own:] = 0
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        places = np.arange(offsets[-1]) + np.repeat(self.offsets[vertices] - offsets[:-1], counts)
        return Freedom(self.frame[vertices], self.directions, self.axes, offsets, number[self.neighbours[places]])

    def onto(self, points: Array, anchors: Array) -> Array:
        """Return points (k, d) with those that slide in their lines and planes through anchors (k, d)."""
        rows = np.flatnonzero(self.frame >= 0)
        count = self.directions[self.frame[rows]]
        some = np.arange(points.shape[1]) < count[:, None]
        axes = np.where(some[:, :, None], self.axes[self.frame[rows]], 0.0)
        way = np.einsum("vik,vk->vi", axes, points[rows] - anchors[rows])
        changed = (axes != 0).any(axis=1)
        aligned = changed.sum(axis=1) == count
        there = np.where(aligned[:, None], points[rows], anchors[rows] + np.einsum("vik,vi->vk", axes, way))
        result = points.copy()
        result[rows] = np.where(changed, there, anchors[rows])
        return result

    def turned(self, before: Array, now: Array) -> Mask:
        """Mark (k,) those that slide beside a vertex which has left their line or plane since: it has others now.

        Positions (k, d): before, when lines and planes were found, and now. These may have moved as a whole.
        """
        first = np.repeat(np.arange(len(self.frame)), np.diff(self.offsets))
        edges, moved = before[first] - before[self.neighbours], now - before
        some = np.arange(before.shape[1]) < self.directions[self.frame[first]][:, None]
        axes = np.where(some[:, :, None], self.axes[self.frame[first]], 0.0)
        apart = moved[first] - moved[self.neighbours]
        apart -= np.einsum("vik,vi->vk", axes, np.einsum("vik,vk->vi", axes, apart))
        length = float(np.linalg.norm(edges, axis=1).mean()) if len(edges) else 0.0
        mask = np.zeros(len(before), dtype=bool)
        mask[first[np.linalg.norm(apart, axis=1) > tolerance_of(now, length) * length]] = True
        return mask


def constraints_of(
    topology: Topology, points: Array, regions: NDArray[np.integer] | None = None, tangled: bool = True
) -> Constraints:
    """Return what of a mesh must keep its shape: the boundary and, between regions, interfaces.

    Parameters
    ----------
    topology : Topology
    points : (k, d) float64
        In the order of the connectivity.
    regions : (m,) int, not negative, optional
    tangled : bool
        Whether elements may be inverted, and the boundary with them.
    """
    facets, owners, across = topology.facets_between(regions)
    labels = np.zeros(len(facets), dtype=np.int64)
    if regions is not None:
        code = np.asarray(regions, dtype=np.int64)[topology.connectivity.rows]
        beyond = np.where(across < 0, 0, code[across] + 1)
        labels = code[owners] * (int(code.max()) + 2) + beyond
    inverted, broken = np.zeros(topology.m, dtype=bool), np.zeros(len(points), dtype=bool)
    if tangled:
        judged = Judged(topology.connectivity)
        inverted[judged.check(points, 1)[0]] = True
        broken[judged.vertices(inverted)] = True
    return Constraints(facets, labels, np.empty((0, 2), dtype=np.int32), inverted[owners], broken)


def freedom_of(points: Array, constraints: Constraints) -> Freedom:
    """Find who may slide where, without a change of the shape.

    Parameters
    ----------
    points : (k, d) float64
        In the order of the connectivity.
    constraints : Constraints
    """
    k, d = points.shape
    ends = constraints.facets[:, :2]
    length = float(np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1).mean())
    tolerance = tolerance_of(points, length)
    found = [lines_of_plane(points, constraints, tolerance)] if d == 2 else of_solid(points, constraints, tolerance)
    frame, known = np.full(k, -1, dtype=np.int32), 0
    for slides in found:
        frame[slides.vertices] = known + slides.frame
        known += len(slides.axes)
    offsets, neighbours = _rows([_pairs(slides, k) for slides in found], k)
    directions = [np.full(len(slides.axes), slides.directions, dtype=np.uint8) for slides in found]
    axes = np.ascontiguousarray(np.concatenate([slides.axes for slides in found]))
    return Freedom(frame, np.concatenate(directions), axes, offsets, neighbours)


def _pairs(slides: Slides, k: int) -> Numbers:
    """Return the pairs (p, 2) of a vertex that slides and a neighbour."""
    mine = np.zeros(k, dtype=bool)
    mine[slides.vertices] = True
    both = np.concatenate([slides.edges, slides.edges[:, ::-1]])
    return both[mine[both[:, 0]]]


def _rows(pairs: list[Numbers], k: int) -> tuple[Numbers, Numbers]:
    """Return compressed rows of pairs, each ascending."""
    first, second = np.concatenate(pairs).T
    offsets = np.concatenate([[0], np.cumsum(np.bincount(first, minlength=k))]).astype(np.int32)
    return offsets, np.ascontiguousarray(second[np.lexsort((second, first))])
