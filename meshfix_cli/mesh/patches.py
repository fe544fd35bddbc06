"""Flat patches and straight edges of what keeps a mesh's shape, and the vertices that may slide in and along them.

A vertex may slide in the plane of all facets around it, or along the straight edge between facets that are flat on each
side. Corners, ends of edges, ends of slits and what is curved have no place where they might go.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.topology import distinct, rows_of

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int32]
Places = NDArray[np.integer]

# Sines up to which facets are of one plane, and edges of one line; the larger one for files of few digits.
FLAT, FLAT_OF_FEW_DIGITS = 3e-5, 1e-2
DIGITS = 10.0  # times the sine by which the last digit of a file turns an edge
FOLDED = 0.99  # of the sum of areas: around a vertex, or on its side of an edge, less in the sum of normals is a fold
SLIT = 0.05  # of it: a patch of less is a slit, whether or not elements are inverted


@dataclass(frozen=True, eq=False)
class Constraints:
    """What must keep its shape, in the numbers of a connectivity with k vertices.

    Attributes
    ----------
    facets : (f, w) int32
        Of the boundary and of interfaces, those of a surface on the same side of it; -1: no more vertices.
    labels : (f,) int
        Facets of different labels belong to different patches.
    lines : (l, 2) int32
        Edges in space that end patches, too.
    inverted : (f,) bool
        The element that the facet is of is inverted.
    broken : (k,) bool
        The vertices of inverted elements.
    normals : (f, 3) float64, optional
        Unit normals that facets of a surface should have: the facets may be turned over.
    plain : (k,) bool, optional
        Vertices of a surface that are on no feature, whatever the facets there say.
    """

    facets: Numbers
    labels: Places
    lines: Numbers
    inverted: Mask
    broken: Mask
    normals: Array | None = None
    plain: Mask | None = None


@dataclass(frozen=True, eq=False)
class Slides:
    """Vertices that slide in lines, or in planes.

    Attributes
    ----------
    vertices : (v,) int32
    frame : (v,) int32
        The line or plane of each.
    axes : (g, d, d) float64
        Orthonormal rows for each line or plane, its directions first.
    directions : int
        How many these are.
    edges : (e, 2) int32
        Among them all that lead from a vertex to another one in its line or plane.
    """

    vertices: Numbers
    frame: Numbers
    axes: Array
    directions: int
    edges: Numbers


def tolerance_of(points: Array, length: float) -> float:
    """Return the sine that tells planes apart, by the digits that coordinates (n, d) have; `length` of their edges."""
    values = points.ravel()
    sample = values[:: max(1, len(values) // 300)]
    digits = next((k for k in range(5, 16) if all(float(f"{x:.{k}g}") == x for x in sample.tolist())), 16)
    step = 0.5 * 10.0 ** (1 - digits)
    if (sample.astype(np.float32) == sample).all():
        step = max(step, 2.0**-24)
    size = float(np.abs(values).max(initial=0.0))
    return min(max(FLAT, DIGITS * step * size / max(length, np.finfo(float).tiny)), FLAT_OF_FEW_DIGITS)


def lines_of_plane(points: Array, given: Constraints, tolerance: float) -> Slides:
    """Find the vertices of a plane mesh that slide; facets are edges there, and meet at vertices."""
    surface = _Surface(points, given, tolerance)
    corners, owners = given.facets.ravel(), np.repeat(np.arange(len(given.facets), dtype=np.int32), 2)
    vertices, pairs = of_two(corners, owners, len(points))
    smooth, patch = surface.patches(pairs)
    vertices, pairs = vertices[smooth], pairs[smooth]
    both = np.repeat(vertices, 2)
    good = surface.unfolded(both, pairs.ravel(), both, patch)[vertices]
    line = _lines(points, given.facets, patch, patch[pairs[good, 0]], tolerance)
    return Slides(vertices[good][line.kept], line.frame, line.axes, 1, given.facets)


def of_solid(points: Array, given: Constraints, tolerance: float, joints: Joints) -> list[Slides]:
    """Find the vertices of a solid mesh that slide along edges, and in planes."""
    surface = _Surface(points, given, tolerance)
    smooth, patch = surface.patches(joints.pairs)
    is_crease, around = joints.divided(smooth)
    creases = joints.edges[is_crease]
    return [
        _along_edges(surface, around, patch, creases, joints.count[is_crease]),
        _in_planes(surface, around, patch, creases, joints.edges),
    ]


def _in_planes(surface: _Surface, around: Around, patch: Numbers, creases: Numbers, edges: Numbers) -> Slides:
    n = len(surface.points)
    good = np.zeros(n, dtype=bool)
    good[around.vertices] = True
    good[creases] = False
    good &= around.fans(n) == 1
    mine = good[around.vertices]
    vertices, owners = around.vertices[mine], around.owners[mine]
    good &= surface.unfolded(vertices, owners, vertices, patch)
    of_vertex = np.zeros(n, dtype=np.int32)
    of_vertex[vertices] = patch[owners]
    here = np.flatnonzero(good).astype(np.int32)
    plane = _planes(surface, patch, of_vertex[here])
    return Slides(here[plane.kept], plane.frame, plane.axes, 2, edges)


def _along_edges(surface: _Surface, around: Around, patch: Numbers, creases: Numbers, facets: Places) -> Slides:
    points, tolerance = surface.points, surface.tolerance
    vertices, pairs, ways = around.passed(points, creases, facets)
    both = np.arange(2 * len(ways), dtype=np.int32).reshape(-1, 2)
    good = kernels.sines_between(ways.reshape(-1, ways.shape[2]), both) <= tolerance
    good &= ((ways[:, 0] * ways[:, 1]).sum(axis=1) < 0) | surface.given.broken[vertices]
    vertices, pairs = vertices[good], pairs[good]
    good = _flat_sides(surface, around, patch, vertices)
    vertices, pairs = vertices[good], pairs[good]
    chain = kernels.joined(np.ascontiguousarray(pairs), len(creases))
    line = _lines(points, creases, chain, chain[pairs[:, 0]], tolerance)
    return Slides(vertices[line.kept], line.frame, line.axes, 1, creases)


def _flat_sides(surface: _Surface, around: Around, patch: Numbers, vertices: Numbers) -> Mask:
    """Whether the facets on each side of a crease, at some vertices (v,) of it, are flat and not folded."""
    mine = np.zeros(len(surface.points), dtype=bool)
    mine[vertices] = True
    mine = mine[around.vertices]
    corners, owners, fan = around.vertices[mine], around.owners[mine], around.fan[mine]
    number, _ = numbered(fan, len(around.fan))
    place = number[fan]
    normals = surface.normals[owners]
    spread, _ = _common_direction(normals, place, int(place.max(initial=-1)) + 1)
    good = surface.unfolded(fan, owners, corners, patch)[fan] & (spread[place] <= surface.tolerance)
    bad = np.zeros(len(surface.points), dtype=bool)
    bad[corners[~good]] = True
    return ~bad[vertices]


class _Surface:
    """Facets, how they lie to each other, and where they are folded."""

    def __init__(self, points: Array, given: Constraints, tolerance: float) -> None:
        self.points, self.given, self.tolerance = points, given, tolerance
        self.normals, self.bent = normals_of(points, given.facets, tolerance)
        self.areas = lengths(self.normals)
        self._last: tuple[Numbers, Mask] | None = None

    def patches(self, pairs: Numbers) -> tuple[Mask, Numbers]:
        """Return which pairs (p, 2) of facets that meet are of one patch, and a number (f,) for the patch of each.

        That goes by labels and by the angle between them, without its sign while the boundary is tangled: elsewhere
        what is folded back is the other side of a slit.
        """
        one, other = pairs.T
        labels = self.given.labels
        smooth = (labels[one] == labels[other]) & ~(self.bent[one] | self.bent[other])
        smooth &= kernels.sines_between(self.normals, pairs) <= self.tolerance
        patch = kernels.joined(np.ascontiguousarray(pairs[smooth]), len(labels))
        smooth &= (kernels.dots_between(self.normals, pairs) >= 0) | self._tangled(patch)[patch[one]]
        return smooth, kernels.joined(np.ascontiguousarray(pairs[smooth]), len(labels))

    def unfolded(self, group: Numbers, facets: Numbers, vertices: Numbers, patch: Numbers) -> Mask:
        """(g,) bool, by numbers of groups of facets (x,) at vertices (x,): none is turned over, but by a tangle."""
        count = int(group.max(initial=-1)) + 1
        ratio = self._ratio(group, facets, max(count, len(self.points)))
        excused = np.zeros(len(ratio), dtype=bool)
        excused[group] = self._tangled(patch)[patch[facets]] & self.given.broken[vertices]
        return (ratio >= FOLDED) | excused

    def _ratio(self, group: Numbers, facets: Numbers, count: int) -> Array:
        """Return |sum of normals| / sum of areas of groups (count,) of facets; 1 where there is no area."""
        sums = kernels.summed(group, self.normals, count, facets)
        total = np.bincount(group, self.areas[facets], count)
        return np.divide(lengths(sums), total, out=np.ones(count), where=total > 0)

    def _tangled(self, patch: Numbers) -> Mask:
        """(f,) bool, by the number of a patch: facets are turned over in it, and only such of inverted elements."""
        if self._last is None or self._last[0] is not patch:
            count = len(patch)
            sums = kernels.summed(patch, self.normals, count)
            over = dots(self.normals, rows_of(sums, patch)) < 0
            by_itself = np.zeros(count, dtype=bool)
            by_itself[patch[over & ~self.given.inverted]] = True
            tangled = ~by_itself & (lengths(sums) > SLIT * np.bincount(patch, self.areas, count))
            self._last = patch, tangled
        return self._last[1]


def dots(one: Array, other: Array) -> Array:
    """Return the products (k,) of vectors (k, d), column by column: along rows it takes five times as long."""
    product = one[:, 0] * other[:, 0]
    for k in range(1, one.shape[1]):
        product += one[:, k] * other[:, k]
    return np.asarray(product)


def lengths(vectors: Array) -> Array:
    """Return those (k,) of vectors (k, d)."""
    return np.sqrt(dots(vectors, vectors))


def normals_of(points: Array, facets: Numbers, tolerance: float) -> tuple[Array, Mask]:
    """Return normals (f, d), as long as the facets are large, and which facets are not flat."""
    if points.shape[1] == 3 and facets.shape[1] == 3:
        offsets = np.arange(0, facets.size + 1, 3, dtype=np.int32)
        return kernels.area_vectors(points, offsets, facets.ravel(), 1), np.zeros(len(facets), dtype=bool)
    p = points[facets]
    if points.shape[1] == 2:
        edges = p[:, 1] - p[:, 0]
        return np.stack([edges[:, 1], -edges[:, 0]], axis=1), np.zeros(len(facets), dtype=bool)
    p[:, 3] = np.where(facets[:, 3:] < 0, p[:, 0], p[:, 3])
    one, other = p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]
    normals = np.cross(one, other) / 2
    # How far the diagonals pass each other, by the size of the facet.
    gap = np.abs((normals * (p[:, 1] - p[:, 0])).sum(axis=1))
    size = np.maximum((one**2).sum(axis=1), (other**2).sum(axis=1)) ** 1.5
    return normals, gap > tolerance * size


def unit_vectors(vectors: Array) -> Array:
    """Return vectors (..., d) of the length 1; those without a length stay."""
    rows = np.ascontiguousarray(vectors).reshape(-1, vectors.shape[-1])
    return kernels.unit_vectors(rows).reshape(vectors.shape)


class Joints:
    """Where facets in space meet.

    Attributes
    ----------
    edges : (e, 2) int32
        Of the facets, and the lines beside them.
    count : (e,) int
        How many facets each is of.
    pairs, at : (p, 2) int32
        Facets that meet at an edge of theirs alone, which is no line, and the ends of that.
    """

    def __init__(self, facets: Numbers, lines: Numbers, n: int) -> None:
        """Take facets (f, 3 or 4) and lines (l, 2) of n vertices."""
        self._ends, self._owners, self.edges, here, self.count, is_line = kernels.joints(facets, lines, n)
        self._vertices = facets.ravel() if facets.shape[1] == 3 else facets[facets >= 0]
        self._between = np.flatnonzero((self.count == 2) & (is_line == 0))
        first = np.concatenate([[0], np.cumsum(self.count)])[self._between]
        self._two = np.stack([here[first], here[first + 1]], axis=1)  # sides
        self.pairs = self._owners[self._two]

    @property
    def at(self) -> Numbers:
        """(p, 2) int32: see above."""
        return self.edges[self._between]

    def divided(self, smooth: Mask) -> tuple[Mask, Around]:
        """Return at which edges (e,) facets do not go on in each other, as some pairs (p,) do, and their fans."""
        ends = np.ones(len(self.edges), dtype=bool)
        ends[self._between[smooth]] = False
        joined = self._ends[self._two[smooth]]  # corners, at the smaller vertex and at the larger one
        fan = kernels.joined(np.concatenate([joined[:, :, 0], joined[:, :, 1]]), len(self._vertices))
        return ends, Around(self._vertices, self._owners, fan)  # a facet has as many corners as sides


@dataclass(frozen=True, eq=False)
class Around:
    """The corners (c,) of facets: their vertices, their facets, and a number for the fan of each.

    A fan are the facets around a vertex that go on in each other.
    """

    vertices: Numbers
    owners: Numbers
    fan: Numbers

    def fans(self, n: int) -> NDArray[np.int64]:
        """Return how many there are at each vertex (n,)."""
        return np.bincount(self.vertices[self.fan == np.arange(len(self.fan))], minlength=n)

    def passed(self, points: Array, edges: Numbers, facets: Places) -> tuple[Numbers, Numbers, Array]:
        """Return the vertices (v,) at which two edges (e, 2) between fans meet, these (v, 2), and their ways (v, 2, d).

        `facets` (e,): how many facets each edge is of. Each fan reaches from one edge to the other; a vertex with one
        that does not, a cone of its own, is left out.
        """
        which = np.repeat(np.arange(len(edges), dtype=np.int32), 2)
        vertices, pairs = of_two(edges.ravel(), which, len(points))
        whole = 2 * self.fans(len(points))[vertices] == facets[pairs].sum(axis=1)
        vertices, pairs = vertices[whole], pairs[whole]
        return vertices, pairs, points[edges[pairs].sum(axis=2) - vertices[:, None]] - points[vertices][:, None]


def of_two(vertices: Numbers, things: Numbers, n: int) -> tuple[Numbers, Numbers]:
    """Return the vertices (v,) that two of some things (x,) are at, at vertices (x,), and these (v, 2)."""
    order, offsets = kernels.counted_order(vertices, n)
    two = np.flatnonzero(np.diff(offsets) == 2)
    first = offsets[two]
    return two.astype(np.int32), np.stack([things[order[first]], things[order[first + 1]]], axis=1)


@dataclass(frozen=True, eq=False)
class _Frames:
    """Of vertices (v,), which are kept, and the frames of those that are."""

    kept: Mask
    frame: Numbers
    axes: Array


def _lines(points: Array, ends: Numbers, group: Numbers, wanted: Numbers, tolerance: float) -> _Frames:
    """Return the lines in which the groups (v,) wanted lie, of edges between ends (x, 2)."""
    number, mine = numbered(wanted, len(group))
    rows = np.flatnonzero(number[group] >= 0)
    place = number[group[rows]]
    ends = ends[rows]
    spread, axes = _common_direction(points[ends[:, 1]] - points[ends[:, 0]], place, mine)
    axes[:, 0][_constant(points, ends, place, mine)] = 0.0
    axes[:, 0] /= np.maximum(np.linalg.norm(axes[:, 0], axis=1, keepdims=True), np.finfo(float).tiny)
    return _kept(spread <= tolerance, axes, number[wanted])


def _planes(surface: _Surface, patch: Numbers, wanted: Numbers) -> _Frames:
    """Return the planes that patches lie in, those of the patches wanted (v,)."""
    number, mine = numbered(wanted, len(patch))
    rows = np.flatnonzero(number[patch] >= 0)
    place = number[patch[rows]]
    spread, axes = _common_direction(surface.normals[rows], place, mine)
    axes = axes[:, [1, 2, 0]]
    constant = _constant(surface.points, surface.given.facets[rows], place, mine)
    for k in range(3):
        axes[constant[:, k]] = np.roll(np.eye(3), -k - 1, axis=0)
    return _kept(spread <= surface.tolerance, axes, number[wanted])


def _kept(good: Mask, axes: Array, frame: Numbers) -> _Frames:
    number = np.cumsum(good, dtype=np.int32) - 1
    kept = good[frame]
    return _Frames(kept, number[frame[kept]], axes[good])


def numbered(values: Numbers, most: int) -> tuple[Numbers, int]:
    """Return a number (most,) for each different value, -1 for others, and how many there are."""
    found = distinct(values)
    number = np.full(most, -1, dtype=np.int32)
    number[found] = np.arange(len(found), dtype=np.int32)
    return number, len(found)


def _common_direction(vectors: Array, group: Numbers, count: int) -> tuple[Array, Array]:
    """Find the line that vectors (x, d) of each group (x,) are nearest to, each by its length.

    Returns
    -------
    spread : (count,) float64
        The sine by which they differ from it, in the mean; 1 where there is no vector.
    axes : (count, d, d) float64
        Orthonormal rows, that line first.
    """
    d = vectors.shape[1]
    length = np.linalg.norm(vectors, axis=1)
    scaled = vectors / np.sqrt(np.where(length > 0, length, 1.0))[:, None]
    products = np.empty((count, d, d))
    for i in range(d):
        for j in range(d):
            products[:, i, j] = np.bincount(group, scaled[:, i] * scaled[:, j], count)
    values, axes = np.linalg.eigh(products)
    largest = values[:, -1]
    ratio = np.divide(np.maximum(values[:, -2], 0.0), largest, out=np.ones(count), where=largest > 0)
    return np.sqrt(ratio), np.swapaxes(axes, 1, 2)[:, ::-1].copy()


def _constant(points: Array, vertices: Numbers, group: Numbers, count: int) -> Mask:
    """(count, d) bool: the coordinates that all vertices (x, w) of a group (x,) have in common, to the last bit."""
    there = vertices >= 0
    number = np.broadcast_to(group[:, None], vertices.shape)[there]
    values = points[vertices[there]]
    low, high = np.full((count, points.shape[1]), np.inf), np.full((count, points.shape[1]), -np.inf)
    np.minimum.at(low, number, values)
    np.maximum.at(high, number, values)
    return np.asarray(low == high)
