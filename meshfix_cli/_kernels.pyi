"""The compiled kernels; arrays are C-contiguous and of exactly these types (nothing is converted)."""

import numpy as np
from numpy.typing import NDArray

Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

class Stars:
    """Stars, blocks and block colours of a mesh; the arrays are described in kernels/stars.hpp."""

    def __init__(self, simplices: Int32, n: int) -> None: ...
    @property
    def offsets(self) -> Int32: ...
    @property
    def incident(self) -> Int32: ...
    @property
    def faces(self) -> NDArray[np.uint16]: ...
    @property
    def neighbour_offsets(self) -> Int32: ...
    @property
    def neighbours(self) -> Int32: ...
    @property
    def block_offsets(self) -> Int32: ...
    @property
    def block_vertices(self) -> Int32: ...
    @property
    def colour_offsets(self) -> Int32: ...
    @property
    def colour_blocks(self) -> Int32: ...

def match_facets(simplices: Int32, n: int) -> tuple[Int32, int]:
    """Mates (m, d+1), and a corner whose facet is shared by too many simplices or -1."""

def orient(simplices: Int32, mates: Int32) -> tuple[Int32, NDArray[np.uint8], bool]:
    """Component (m,), against (m,) and whether the mesh is orientable."""

def check(points: Float64, simplices: Int32, threads: int) -> tuple[int, float]:
    """Number of invalid simplices and the smallest signed measure."""

def measure(points: Float64, simplices: Int32, threads: int) -> tuple[Float64, NDArray[np.uint8]]:
    """Signed measure and validity, each (m,)."""

def angles(points: Float64, simplices: Int32, threads: int) -> tuple[Float64, Float64]:
    """Smallest and largest (dihedral) angle in radians, each (m,)."""

def relocate(
    move: int,
    points: Float64,
    movable: NDArray[np.bool_],
    stars: Stars,
    blocks: Int32,
    threshold_sine2: float,
    min_measure: float,
    start: Float64,
    max_move: float,
    threads: int,
) -> tuple[int, int]:
    """Relocate, in place, the movable vertices of some blocks of one colour; the numbers visited and moved.

    Smoothing makes no measure smaller than `min_measure`, no vertex goes farther than `max_move` from `start`.
    """

def linear_program(
    neighbours: Float64, faces: NDArray[np.uint16], heights: bool
) -> tuple[int, Float64, Float64, Float64, int]:
    """Status (0 optimal, 1 degenerate, 2 failed), (x, t), dual weights of faces and box sides, axes of the box, pivots.

    heights: t is the smallest height over a face instead of the smallest determinant.
    """

def crossings(points: Float64, facets: Int32, threads: int) -> Int32:
    """Pairs (k, 2) of facets (f, d), rows of vertices, that cross each other beyond doubt."""

class Foldover:
    """The foldover-free energy of simplices and its gradient; see kernels/foldover.hpp."""

    def __init__(self, simplices: Int32, n: int) -> None: ...
    def evaluate(
        self, points: Float64, sizes: Float64, eps: float, weight: float, free: int, threads: int
    ) -> tuple[float, Float64, float]:
        """Energy, its gradient (free, d) by the first `free` points, and the smallest determinant of J."""

def min_norm_point(vectors: Float64) -> Float64:
    """Return the point of smallest norm in the convex hull of the rows."""

def sines(neighbours: Float64, faces: NDArray[np.uint16], x: Float64) -> tuple[Float64, Float64, float]:
    """Sines of a star, their gradients, and sign * (smallest sine)^2 (-1 where the star is not valid)."""

def find_words(data: bytes, offsets: Int64, count: int, one_line: bool) -> Int64:
    """Spans (k * count, 2) of the first words at or behind each offset (k,).

    With one_line, -1 for those that the line does not have; else fewer spans where the data end.
    """

def scan_integers(data: bytes, at: int, count: int) -> tuple[Int64, int, int]:
    """Values, the offset behind them, and the offset of what is not an integer or -1."""

def integers(data: bytes, spans: Int64, slash: bool) -> tuple[Int64, int]:
    """Values of the words at spans (n, 2), up to a slash if it may be there, and the row of the first bad one or -1."""

def numbers(data: bytes, spans: Int64, single: bool) -> tuple[Float64, int]:
    """Values of the words at spans (n, 2), and the row of the first that is not a number or -1; single: of float32."""

def shortest(values: Float64, single: bool, longest: int) -> tuple[bytes, Int64]:
    """The shortest texts that read back to the values, joined, and their spans; longest: characters at most, or 0."""

def replace(data: bytes, spans: Int64, words: bytes, word_spans: Int64) -> bytes:
    """The data with each span (k, 2), in their order, replaced by a span of `words`."""
