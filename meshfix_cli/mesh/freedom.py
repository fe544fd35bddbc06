"""Who may move where: in planes and along edges, on curved surfaces and along curves, others anywhere or nowhere."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.judged import Judged
from meshfix_cli.mesh.patches import Constraints, Joints, Slides, lengths, lines_of_plane, of_solid, tolerance_of
from meshfix_cli.mesh.topology import Topology, rows_of, rows_of_part

if TYPE_CHECKING:
    from meshfix_cli.mesh.curved import Shapes, Smooth

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Freedom:
    """Where the vertices (k,) of a connectivity may go.

    Attributes
    ----------
    frame : (k,) int32
        The line or plane of each that slides and, behind these, its curve or surface; -1: it may go anywhere, or is
        held, as `Mesh.movable` tells.
    directions : (f,) uint8
        How many directions each of these has: 1 or 2.
    axes : (g, d, d) float64
        Of lines and planes: orthonormal rows, of which the first span these directions; coordinates that none of them
        changes stay exactly.
    offsets : (k+1,) int32
    neighbours : int32
        Of each vertex that slides those in what it slides in, one vertex behind the other.
    shapes : Shapes or None
        The curves and surfaces, f - g of them; None: there are none.
    stays : bool
        Vertices on these begin where they are, and not where a reference has them.
    """

    frame: Numbers
    directions: NDArray[np.uint8]
    axes: Array
    offsets: Numbers
    neighbours: Numbers
    shapes: Shapes | None = None
    stays: bool = False

    @cached_property
    def kernel(self) -> kernels.Freedom:
        """The same for the kernels."""
        flat = self.frame, self.directions, self.axes, self.offsets, self.neighbours
        if self.shapes is None:
            return kernels.Freedom(*flat)
        made = kernels.Freedom(*flat, self.shapes.kernel)
        made.keep_near(self.shapes.offsets, self.shapes.around, self.shapes.bound)
        return made

    @cached_property
    def curved(self) -> Mask:
        """(k,) bool: those that slide on curves and surfaces."""
        return self.frame >= len(self.axes)

    @cached_property
    def degrees(self) -> NDArray[np.uint8]:
        """(k,) uint8: the number of directions of those that slide, 0 for others."""
        return np.append(self.directions, np.uint8(0))[self.frame]

    def of(self, vertices: NDArray[np.integer]) -> kernels.Freedom:
        """Return what some vertices (v,), in their order, may do, none of them curved; without neighbours."""
        none = np.empty(0, dtype=np.int32)
        return kernels.Freedom(self.frame[vertices], self.directions, self.axes, none, none)

    def touching(self, vertices: NDArray[np.integer], points: Array, threads: int = 1) -> kernels.Freedom:
        """Return the same of vertices at positions (v, d), those on surfaces and curves in what touches these there.

        Planes and lines, that is.
        """
        frame, curved = self.frame[vertices], self.curved[vertices]
        if self.shapes is None or not curved.any():
            return self.of(vertices)
        known, d = np.int32(len(self.axes)), points.shape[1]
        axes = self.shapes.kernel.axes(points[curved], frame[curved] - known, threads).reshape(-1, d, d)
        directions = np.concatenate([self.directions[:known], self.directions[frame[curved]]])
        frame[curved] = known + np.arange(len(axes), dtype=np.int32)
        none = np.empty(0, dtype=np.int32)
        return kernels.Freedom(frame, directions, np.concatenate([self.axes, axes]), none, none)

    def part(self, vertices: Numbers, own: int) -> Freedom:
        """Return that of a part of the mesh: vertices (v,), of which the first `own` have their neighbours in it."""
        number = np.full(len(self.frame), -1, dtype=np.int32)
        number[vertices] = np.arange(len(vertices), dtype=np.int32)
        offsets, places = rows_of_part(self.offsets, vertices, own)
        neighbours = number[self.neighbours[places]]
        shapes = None if self.shapes is None else self.shapes.part(vertices, number, own)
        return Freedom(self.frame[vertices], self.directions, self.axes, offsets, neighbours, shapes, self.stays)

    def _along(self, vertices: NDArray[np.integer], ways: Array) -> tuple[Array, Array]:
        """Return the axes (v, d, d) of lines and planes, else 0, and the parts of ways (v, d) along them."""
        count = self.directions[self.frame[vertices]]
        some = np.arange(ways.shape[1]) < count[:, None]
        axes = np.where(some[:, :, None], self.axes[self.frame[vertices]], 0.0)
        return axes, np.einsum("vik,vi->vk", axes, np.einsum("vik,vk->vi", axes, ways))

    def onto(self, points: Array, anchors: Array) -> Array:
        """Return points (k, d) with those that slide in their lines and planes through anchors (k, d)."""
        rows = np.flatnonzero((self.frame >= 0) & ~self.curved)
        axes, way = self._along(rows, points[rows] - anchors[rows])
        changed = (axes != 0).any(axis=1)
        aligned = changed.sum(axis=1) == self.directions[self.frame[rows]]
        there = np.where(aligned[:, None], points[rows], anchors[rows] + way)
        result = points.copy()
        result[rows] = np.where(changed, there, anchors[rows])
        return result

    def turned(self, before: Array, now: Array) -> Mask:
        """Mark (k,) those that slide beside a vertex which has left their line or plane since: it has others now.

        Positions (k, d): before, when lines and planes were found, and now. These may have moved as a whole. Vertices
        that slide on a curved surface leave planes beside it.
        """
        first, other = np.repeat(np.arange(len(self.frame)), np.diff(self.offsets)), self.neighbours
        flat = ~(self.curved[first] | self.curved[other])
        first, other = first[flat], other[flat]
        edges, moved = before[first] - before[other], now - before
        apart = moved[first] - moved[other]
        apart -= self._along(first, apart)[1]
        length = float(np.linalg.norm(edges, axis=1).mean()) if len(edges) else 0.0
        mask = np.zeros(len(before), dtype=bool)
        mask[first[np.linalg.norm(apart, axis=1) > tolerance_of(now, length) * length]] = True
        return mask

    def rounded(self, points: Array, threads: int = 1) -> tuple[Array, Array]:
        """Return points (k, d) with those that slide on curves and surfaces there, and how far (k,) they were off.

        That is from the rounded shape or from its pieces, whichever is nearer.
        """
        result, distances = points.copy(), np.zeros(len(points))
        if self.shapes is not None:
            rows, shape = np.flatnonzero(self.curved), self.frame[self.curved] - np.int32(len(self.axes))
            result[rows], far = self.shapes.kernel.nearest(points[rows], shape, threads)
            distances[rows] = np.minimum(far, np.linalg.norm(result[rows] - points[rows], axis=1))
        return result, distances


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


@dataclass(frozen=True, eq=False)
class Flat:
    """Who may slide in lines and planes, and where facets in space meet: it does not depend on given normals."""

    slides: list[Slides]
    joints: Joints | None


def flat_of(points: Array, constraints: Constraints) -> Flat:
    """Find who may slide in lines and planes; see `freedom_of`."""
    start, end = (rows_of(points, np.ascontiguousarray(constraints.facets[:, k])) for k in (0, 1))
    tolerance = tolerance_of(points, float(lengths(start - end).mean()))
    if points.shape[1] == 2:
        return Flat([lines_of_plane(points, constraints, tolerance)], None)
    joints = Joints(constraints.facets, constraints.lines, len(points))
    return Flat(of_solid(points, constraints, tolerance, joints), joints)


def freedom_of(
    points: Array,
    constraints: Constraints,
    smooth: Smooth | None = None,
    flat: Flat | None = None,
    with_shapes: bool = True,
) -> Freedom:
    """Find who may slide where, without a change of the shape.

    Parameters
    ----------
    points : (k, d) float64
        In the order of the connectivity.
    constraints : Constraints
    smooth : Smooth, optional
        Let those on curved surfaces and along curves slide as well.
    flat : Flat, optional
        What `flat_of` gives of the same; default: it is called.
    with_shapes : bool
        False: nobody will slide on curved surfaces and curves, or asks for neighbours; only who might is told.
    """
    k, flat = len(points), flat_of(points, constraints) if flat is None else flat
    found = flat.slides
    frame, known = np.full(k, -1, dtype=np.int32), 0
    for slides in found:
        frame[slides.vertices] = known + slides.frame
        known += len(slides.axes)
    directions = [np.full(len(slides.axes), slides.directions, dtype=np.uint8) for slides in found]
    axes = np.ascontiguousarray(np.concatenate([slides.axes for slides in found]))
    pairs = [_pairs(slides, k) for slides in found]
    if smooth is None:
        return Freedom(frame, np.concatenate(directions), axes, *kernels.rows_of_pairs(np.concatenate(pairs), k))
    from meshfix_cli.mesh.curved import curved_of

    degrees = np.append(np.concatenate(directions), np.uint8(0))
    curved = curved_of(points, constraints, smooth, degrees[frame], flat.joints, with_shapes)
    mine = curved.shape >= 0
    frame[mine] = known + curved.shape[mine]
    if not with_shapes:
        none = np.zeros(k + 1, dtype=np.int32), np.empty(0, dtype=np.int32)
        return Freedom(frame, np.concatenate([*directions, curved.directions]), axes, *none)
    pairs = [*(some[~mine[some[:, 0]]] for some in pairs if len(some)), curved.pairs]
    directions.append(curved.directions)
    shapes = curved.shapes if len(curved.directions) else None
    return Freedom(frame, np.concatenate(directions), axes, *kernels.rows_of_pairs(np.concatenate(pairs), k), shapes)


def _pairs(slides: Slides, k: int) -> Numbers:
    """Return the pairs (p, 2) of a vertex that slides and a neighbour."""
    mine = np.zeros(k, dtype=bool)
    mine[slides.vertices] = True
    return kernels.pairs_from(np.ascontiguousarray(slides.edges), mine)
