"""Smooth surfaces and curves of what keeps a mesh's shape, and the vertices that may slide on and along them.

A vertex may slide on the surface of its facets where none of their edges is a feature, and along a curve of two
features that go on in each other. Corners have no place where they might go.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.patches import Constraints, Joints, normals_of, numbered, of_two, unit_vectors
from meshfix_cli.mesh.topology import rows_of, rows_of_part

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int32]
Places = NDArray[np.integer]


@dataclass(frozen=True)
class Smooth:
    """What counts as smooth, and how exactly it is kept.

    Attributes
    ----------
    feature_angle : float
        Degrees between the normals of facets, or the directions of edges, that meet at a feature.
    bound : float
        How far from the shape the middles of edges and triangles may be, in model units.
    """

    feature_angle: float
    bound: float

    @property
    def cosine(self) -> float:
        """That of the feature angle."""
        return math.cos(math.radians(self.feature_angle))


@dataclass(frozen=True, eq=False)
class Shapes:
    """Surfaces and curves as pieces: triangles, and segments between two vertices.

    Attributes
    ----------
    vertices : (p, d) int32
        The corners of each piece, those of a shape one behind the other; of a segment in space the last comes twice.
    corners, ways : (p, d, d) float64
        Where they are in the reference; and unit normals of surfaces, tangents of curves, there.
    first : (s+1,) int32
        Where the pieces of each shape begin, and their number.
    directions : (s,) uint8
        2: a surface; 1: a curve.
    offsets : (k+1,) int32
    around : (r, 4) int32
        Of each vertex that slides, at its offset: the other end of an edge and -1, or the other corners of a triangle,
        their shape, and which of the pieces they are.
    bound : float
        See `Smooth`.
    folds : int
        How often facets of inverted elements are folded back upon their neighbours: a tangled boundary is no reference.
    walks : bool
        Searches go from piece to piece, see kernels/mesh/reference.hpp.
    """

    vertices: Numbers
    corners: Array
    ways: Array
    first: Numbers
    directions: NDArray[np.uint8]
    offsets: Numbers
    around: Numbers
    bound: float
    folds: int
    walks: bool = False

    @cached_property
    def kernel(self) -> kernels.Reference:
        """The same for the kernels; parts that are sent to other processes are made anew."""
        made = kernels.Reference(self.corners, self.ways, self.first, self.directions, self.walks)
        if self.walks:
            made.let_walk(self.vertices)
        return made

    def part(self, vertices: Numbers, number: Numbers, own: int) -> Shapes:
        """Return that of a part of the mesh, see `Freedom.part`, with all pieces; new numbers of vertices (k,)."""
        offsets, places = rows_of_part(self.offsets, vertices, own)
        around = self.around[places]
        around[:, :2] = np.where(around[:, :2] < 0, -1, number[around[:, :2]])
        same = self.vertices, self.corners, self.ways, self.first, self.directions
        return Shapes(*same, offsets, around, self.bound, self.folds, self.walks)

    def distances(self, points: Array, threads: int = 1) -> tuple[float, float]:
        """Return how far the shapes with their corners at points (k, d) are from the reference, at most, both ways.

        That is found at vertices, and at the middles of edges and triangles. With it the largest of `deviations`.
        """
        moved = rows_of(points, self.vertices.ravel()).reshape(self.corners.shape)
        deviation, back = self.kernel.farthest(moved, False, threads), self.kernel.at_corners(moved)
        others = (back.farthest(self.corners, of_corners, threads) for of_corners in (False, True))
        return max(deviation, *others, self.kernel.farthest(moved, True, threads)), deviation

    def deviations(self, points: Array, threads: int = 1) -> Array:
        """Tell how far (p,) the middles of each piece are from the reference, at most; its corners at points (k, d)."""
        pieces = np.arange(len(self.shape), dtype=np.int32)
        near = (np.ascontiguousarray(some) for some in self._middles(points[self.vertices]))
        return np.asarray(np.max([self.kernel.nearest(some, self.shape, threads, pieces)[1] for some in near], axis=0))

    @cached_property
    def shape(self) -> Numbers:
        """(p,) int32: the shape of each piece."""
        return np.repeat(np.arange(len(self.directions), dtype=np.int32), np.diff(self.first))

    def _middles(self, corners: Array) -> list[Array]:
        """Return those of the sides of pieces and of the pieces themselves, (p, d) each."""
        sides = np.swapaxes((corners + np.roll(corners, 1, axis=1)) / 2, 0, 1)
        on_surface = self.directions[self.shape][:, None] == 2
        return [np.where(on_surface, some, sides[1]) for some in (corners.mean(axis=1), *sides)]


@dataclass(frozen=True, eq=False)
class Curved:
    """Vertices that slide on surfaces and curves.

    Attributes
    ----------
    shape : (k,) int32
        That of each vertex of the connectivity; -1: it slides on none.
    pairs : (p, 2) int32
        Each of these and a neighbour on its surface or curve.
    directions : (s,) uint8
        See `Shapes`.
    shapes : Shapes or None
        None: they are not asked for.
    """

    shape: Numbers
    pairs: Numbers
    directions: NDArray[np.uint8]
    shapes: Shapes | None


def curved_of(
    points: Array,
    given: Constraints,
    smooth: Smooth,
    flat: NDArray[np.uint8],
    joints: Joints | None = None,
    with_shapes: bool = True,
) -> Curved:
    """Find the vertices that slide on surfaces and curves.

    Parameters
    ----------
    points : (k, d) float64
        Of the reference, in the order of the connectivity.
    given : Constraints
    smooth : Smooth
    flat : (k,) uint8
        In how many directions vertices slide in lines and planes already. Those in a line that is no feature, such as
        an edge of a prism of many sides, go onto the surface.
    joints : Joints, optional
        Of facets in space; None: they lie in a plane.
    with_shapes : bool
        False: of a surface it is only told who slides on which.
    """
    if joints is None:
        return _Plane(points, given, smooth).found(flat)
    return _Solid(points, given, smooth, joints).found(flat, with_shapes)


class _Shaped:
    """What is found about facets, how smoothly they meet, and curves of edges."""

    def __init__(self, points: Array, given: Constraints, smooth: Smooth) -> None:
        self.points, self.given, self.smooth = points, given, smooth
        self.units = unit_vectors(normals_of(points, given.facets, 0.0)[0]) if given.normals is None else given.normals
        self.folds = 0

    def meet_smoothly(self, pairs: Numbers) -> Mask:
        """(p,) bool: facets (p, 2) that are of one label and turn by less than the feature angle."""
        one, other = pairs.T
        labels, inverted = self.given.labels, self.given.inverted
        cosine, same = kernels.dots_between(self.units, pairs), labels[one] == labels[other]
        self.folds = int((same & (cosine < -abs(self.smooth.cosine)) & (inverted[one] | inverted[other])).sum())
        return np.asarray(same & (cosine >= self.smooth.cosine))

    def tangents(self, edges: Numbers, vertices: Numbers, pairs: Numbers) -> Array:
        """Return the unit tangents (e, 2, d) of curves at the ends of edges (e, 2), which are joined at vertices (v,).

        They are those of a parabola through the three vertices; at the end of a curve as much on the other side of the
        edge as at its other end.
        """
        ways = self.points[edges[:, 1]] - self.points[edges[:, 0]]
        known = np.zeros_like(self.points)
        there = self.points[edges[pairs].sum(axis=2) - vertices[:, None]] - self.points[vertices][:, None]
        length = np.linalg.norm(there, axis=2, keepdims=True)
        unit = unit_vectors(there)
        known[vertices] = unit_vectors(unit[:, 1] * length[:, 0] - unit[:, 0] * length[:, 1])
        along = unit_vectors(ways)
        tangents = known[edges]
        tangents *= np.where((tangents * along[:, None]).sum(axis=2) < 0, -1.0, 1.0)[:, :, None]
        ends = ~(tangents != 0).any(axis=2)
        other = tangents[:, ::-1]
        mirrored = 2 * (other * along[:, None]).sum(axis=2, keepdims=True) * along[:, None] - other
        mirrored = np.where((other != 0).any(axis=2, keepdims=True), mirrored, along[:, None])
        return np.where(ends[:, :, None], mirrored, tangents)


class _Plane(_Shaped):
    """Of a plane mesh: its facets are the edges, and meet at vertices."""

    def found(self, flat: NDArray[np.uint8]) -> Curved:
        facets, k = self.given.facets, len(self.points)
        vertices, pairs = of_two(facets.ravel(), np.repeat(np.arange(len(facets), dtype=np.int32), 2), k)
        good = self.meet_smoothly(pairs)
        vertices, pairs = vertices[good], pairs[good]
        chain = kernels.joined(np.ascontiguousarray(pairs), len(facets))
        shape = np.full(k, -1, dtype=np.int32)
        mine = flat[vertices] == 0
        number, curves = numbered(chain[pairs[mine, 0]], len(facets))
        shape[vertices[mine]] = number[chain[pairs[mine, 0]]]
        tangents = self.tangents(facets, vertices, pairs)
        pieces = _Pieces(facets, tangents, number[chain])
        none = _Pieces(np.empty((0, 3), dtype=np.int32), tangents[:0], number[:0])
        edges = kernels.pairs_from(np.ascontiguousarray(facets), shape >= 0)
        return _curved(shape, edges, none, pieces, np.ones(curves, dtype=np.uint8), self)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Pieces (p, w) of shapes: their ways (p, w, d), and the shape of each, -1: of none that is needed."""

    vertices: Numbers
    ways: Array
    shape: Numbers


class _Solid(_Shaped):
    """Of a solid: facets meet at edges, and those that are features meet at vertices."""

    def __init__(self, points: Array, given: Constraints, smooth: Smooth, joints: Joints) -> None:
        super().__init__(points, given, smooth)
        self.joints = joints
        good = self.meet_smoothly(self.joints.pairs)
        if given.plain is not None:
            one, other = given.labels[self.joints.pairs].T
            good |= (one == other) & given.plain[self.joints.at].any(axis=1)
        self.is_feature, self.around = self.joints.divided(good)
        self.patch = kernels.joined(np.ascontiguousarray(self.joints.pairs[good]), len(given.facets))

    @cached_property
    def curves(self) -> tuple[Numbers, Numbers, Numbers]:
        """The features (e, 2), the vertices (v,) at which two go on in each other, and these (v, 2)."""
        features = self.joints.edges[self.is_feature]
        vertices, pairs, ways = self.around.passed(self.points, features, self.joints.count[self.is_feature])
        unit = unit_vectors(ways)
        good = -(unit[:, 0] * unit[:, 1]).sum(axis=1) >= self.smooth.cosine
        return features, vertices[good], pairs[good]

    def found(self, flat: NDArray[np.uint8], with_shapes: bool = True) -> Curved:
        k, corners, owners = len(self.points), self.around.vertices, self.around.owners
        features, vertices, pairs = self.curves
        on_surface = (self.around.fans(k) == 1) & (flat < 2)
        on_surface[features] = False
        on_curve = np.zeros(k, dtype=bool)
        on_curve[vertices[flat[vertices] == 0]] = True
        needed = self.patch[owners[(on_surface | on_curve)[corners]]]
        number, surfaces = numbered(needed, len(self.given.facets))
        shape = np.full(k, -1, dtype=np.int32)
        mine = on_surface[corners]
        shape[corners[mine]] = number[self.patch[owners[mine]]]
        chain = kernels.joined(np.ascontiguousarray(pairs), len(features))
        there = on_curve[vertices]
        of_curve, curves = numbered(chain[pairs[there, 0]], len(features))
        of_curve = np.where(of_curve < 0, -1, of_curve + surfaces).astype(np.int32)
        shape[vertices[there]] = of_curve[chain[pairs[there, 0]]]
        directions = np.array([2] * surfaces + [1] * curves, dtype=np.uint8)
        if not with_shapes:
            return Curved(shape, np.empty((0, 2), dtype=np.int32), directions, None)
        triangles = self._triangles(number)
        tangents = self.tangents(features, vertices, pairs)
        mine = of_curve[chain] >= 0
        segments = _Pieces(features[mine][:, [0, 1, 1]], tangents[mine][:, [0, 1, 1]], of_curve[chain[mine]])
        sliding = (self.joints.edges, on_surface), (np.ascontiguousarray(features), on_curve)
        edges = np.concatenate([kernels.pairs_from(*one) for one in sliding])
        return _curved(shape, edges, triangles, segments, directions, self)

    def _triangles(self, number: Numbers) -> _Pieces:
        """Return the triangles of facets, those with four corners cut in two, with the normals of their fans."""
        facets, fan = self.given.facets, self.around.fan
        of_fans = kernels.fan_normals(self.points, facets, self.units, fan)
        if facets.shape[1] == 3:
            return _Pieces(facets, rows_of(of_fans, fan).reshape(-1, 3, 3), number[self.patch])
        corner = np.full(facets.shape, -1, dtype=np.int32)
        corner[facets >= 0] = np.arange(len(fan), dtype=np.int32)
        rows, whole = np.arange(len(facets)), np.flatnonzero(facets[:, 3] >= 0)
        row = np.concatenate([rows, whole])[:, None]
        place = np.concatenate([np.tile([0, 1, 2], (len(rows), 1)), np.tile([0, 2, 3], (len(whole), 1))])
        return _Pieces(facets[row, place], of_fans[fan[corner[row, place]]], number[self.patch[row[:, 0]]])


def _joined(arrays: list[NDArray[Any]]) -> NDArray[Any]:
    return np.ascontiguousarray(arrays[0] if len(arrays) == 1 else np.concatenate(arrays))


def _curved(
    shape: Numbers,
    edges: Numbers,
    triangles: _Pieces,
    segments: _Pieces,
    directions: NDArray[np.uint8],
    found: _Shaped,
) -> Curved:
    """Put together what slides: of pieces and what is around their vertices, what is needed."""
    points, of_piece = found.points, np.concatenate([triangles.shape, segments.shape])
    order, first = kernels.counted_order(of_piece + np.int32(1), len(directions) + 1)
    order, first = order[first[1] :], first[1:] - first[1]  # but for those of none
    pieces = [one for one in (triangles, segments) if len(one.shape)] or [segments]
    vertices, ways = (_joined(some) for some in ([one.vertices for one in pieces], [one.ways for one in pieces]))
    if not np.array_equal(order, np.arange(len(of_piece))):  # as of one surface, and curves
        vertices, ways = np.take(vertices, order, axis=0), np.take(ways, order, axis=0)
    bounded = shape >= 0
    if found.given.normals is not None:  # a surface: its flat parts go over into others
        bounded[vertices[np.logical_or.reduce([bounded[corner] for corner in vertices.T])]] = True
    place = np.empty(len(of_piece), dtype=np.int32)
    place[order] = np.arange(len(order), dtype=np.int32)
    some, others = (np.ascontiguousarray(one.vertices) for one in (triangles, segments))
    around = kernels.around_pieces(some, others, of_piece, place, bounded)
    corners = rows_of(points, vertices.ravel()).reshape(ways.shape)
    shapes = Shapes(
        vertices, corners, ways, first, directions, *around, found.smooth.bound, found.folds,
        found.given.normals is not None,
    )  # fmt: skip
    return Curved(shape, edges, directions, shapes)
