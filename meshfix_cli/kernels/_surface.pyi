"""Surfaces in space; see kernels/surface."""

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.kernels import Connectivity, Freedom

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]

class Reference:
    """Surfaces and curves, see mesh/reference.hpp; they keep the arrays of corners and ways, which stay as they are."""

    def __init__(
        self, corners: Float64, ways: Float64, first: Int32, directions: NDArray[np.uint8], in_order: bool = False
    ) -> None:
        """Take the corners (p, d, d) of pieces, normals or tangents there, and of each shape the first and directions.

        `first` (s + 1,) ends with the number of pieces; `directions` (s,) is 2 for a surface and 1 for a curve.
        `in_order`: the pieces of a shape that are near in memory are so in space.
        """

    def let_walk(self, vertices: Int32) -> None:
        """Let searches go from piece to piece: which corners (p, 3) are one."""

    def at_corners(self, corners: Float64) -> Reference:
        """Return the same shapes with their corners (p, d, d) elsewhere."""

    def nearest(self, points: Float64, shapes: Int32, threads: int, near: Int32 = ...) -> tuple[Float64, Float64]:
        """Put points (q, d) on their shapes (q,), which are rounded between corners.

        The distances (q,) are those from the pieces as they are; searches begin at pieces `near` (q,) if there are any.
        """

    def axes(self, points: Float64, shapes: Int32, threads: int) -> Float64:
        """Return the directions (q d, d) of shapes (q,) where they are nearest to points (q, d).

        Of each d rows the first are orthonormal, one of a curve, two of a surface; the others are 0.
        """

    def farthest(self, corners: Float64, of_corners: bool, threads: int) -> float:
        """Tell how far its pieces are from it at most, with corners (p, d, d) elsewhere: these, or middles."""

def unfold(points: Float64, offsets: Int32, nodes: Int32, normals: Float64, threads: int) -> Float64:
    """Where the nodes of elements are in their own planes (sum of nodes, 2), seen from their normals (m, 3)."""

def check_unfolded(
    points: Float64, offsets: Int32, nodes: Int32, normals: Float64, threads: int
) -> tuple[Int32, float]:
    """What `check` finds of triangles where `unfold` lays them."""

def area_vectors(points: Float64, offsets: Int32, nodes: Int32, threads: int) -> Float64:
    """The areas (m, 3) of elements as vectors."""

def relocate_on_surface(
    move: int,
    points: Float64,
    states: NDArray[np.uint8],
    mesh: Connectivity,
    blocks: Int32,
    threshold_sine2: float,
    min_measure: float,
    start: Float64,
    max_move: float,
    threads: int,
    freedom: Freedom,
    normals: Float64,
    ahead: Float64 | None = None,
) -> tuple[int, int]:
    """As `relocate`, in the planes, and on the lines, surfaces and curves of a freedom; seen from normals (m, 3).

    With places `ahead` (n, 3) vertices go there, whatever the move, as far as elements below the threshold get no
    worse.
    """

def normals_around(
    points: Float64, offsets: Int32, nodes: Int32, mesh: Connectivity, edges: NDArray[np.bool_], threads: int
) -> tuple[Float64, Float64]:
    """The unit normals of vertices (k, 3) and elements (m, 3) by what is around them; see `sides.normals_around`."""

def unit_vectors(vectors: Float64) -> Float64:
    """Vectors (n, d) of length 1; those without a length are zero."""

def summed(group: Int32, vectors: Float64, groups: int, rows: Int32 | None = None) -> Float64:
    """The sums (groups, d) of vectors, one behind the other or by their rows (x,), by their groups (x,)."""

def dots_between(vectors: Float64, pairs: Int32) -> Float64:
    """The dot products (p,) of pairs (p, 2) of vectors (n, d)."""

def sines_between(vectors: Float64, pairs: Int32) -> Float64:
    """The sines (p,) of the angles between pairs (p, 2) of vectors (n, d) taken as lines; 0: one has no length."""

def joints(
    facets: Int32, lines: Int32, vertices: int
) -> tuple[Int32, Int32, Int32, Int32, NDArray[np.int64], NDArray[np.uint8]]:
    """Where facets (f, 3 or 4), -1: no fourth corner, of so many vertices meet.

    Of each side of theirs, from the smaller vertex to the larger one, the corners at the ends (s, 2) and the facet
    (s,); the edges (e, 2), ascending, that sides and lines (l, 2) are, the sides (s,) edge by edge, how many sides each
    edge has (e,), and which are lines (e,).
    """

def fan_normals(points: Float64, facets: Int32, normals: Float64, fan: Int32) -> Float64:
    """The unit normals (c, 3) of fans (c,), by the number of each, of the corners of facets, weighted by angles."""

def around_pieces(
    triangles: Int32, segments: Int32, shape: Int32, place: Int32, bounded: NDArray[np.bool_]
) -> tuple[Int32, Int32]:
    """What is around some vertices (k,): offsets (k + 1,), and rows (r, 4) as `Shapes.around` has them.

    Of the triangles (t, 3) and segments (s, 2 or more) that have a shape (t + s,), at their places among all pieces.
    """

def counted_order(numbers: Int32, most: int) -> tuple[Int32, Int32]:
    """The stable order of numbers from 0 to most - 1, and where each of these begins (most + 1,)."""

def edge_lengths(points: Float64, mesh: Connectivity) -> Float64:
    """The length (e,) of each edge of a connectivity, once, its vertices at points (k, d)."""

def pairs_from(edges: Int32, marks: NDArray[np.bool_]) -> Int32:
    """Of edges (e, 2) the pairs (p, 2) of a vertex that is marked (n,) and the other end."""

def rows_of_pairs(pairs: Int32, n: int) -> tuple[Int32, Int32]:
    """Compressed rows of pairs (p, 2) of numbers below n: offsets (n + 1,), and the second ones of each, ascending."""

class Sample:
    """Points of a surface, and unit normals there; it keeps the arrays, which stay as they are."""

    def __init__(self, points: Float64, seen: Float64) -> None:
        """Take points (n, 3), one or more, and normals (n, 3)."""

    def refit(self, points: Float64, rows: Int32, normals: Float64, smooth: float, threads: int) -> None:
        """Move some points (k, 3), by their rows, along unit normals (k, 3) to the surface.

        What the quadric through the nearest, seven or more, leaves of them, relative to their distance, is less than
        `smooth`, else a point stays.
        """

    def left(self, places: Float64, normals: Float64, threads: int) -> Float64:
        """Tell what quadrics at places (k, 3), over planes of unit normals (k, 3), leave (k, 2) of the points there.

        That is the root of the mean of the squares, of the distance of the farthest, infinite where there is no
        quadric; and how far the place is from the quadric, of what the farthest of the others is.
        """

def off_reference(freedom: Freedom, points: Float64, bound: float, threads: int) -> NDArray[np.uint8]:
    """Mark the vertices (k,) on the pieces of a reference that are farther from them than a bound."""
