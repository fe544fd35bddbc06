"""What makes a valid mesh impossible; see kernels/mesh/crossings.hpp and kernels/moves/exclusive.hpp."""

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.kernels import Connectivity, Freedom

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Uint8 = NDArray[np.uint8]

def crossings(points: Float64, facets: Int32, threads: int) -> Int32:
    """Pairs (k, 2) of facets (f, d), rows of vertices, that cross each other beyond doubt."""

def crossings_and_folds(points: Float64, facets: Int32, shared: Uint8, threads: int) -> tuple[Int32, Int32]:
    """Pairs that cross, and pairs (b, 2) of oriented facets that lie upon each other, their insides on the same side.

    Those that are `shared` (f,) have their insides on both sides.
    """

def enclosing(points: Float64, facets: Int32, parts: Int32, places: Float64, own: Int32, threads: int) -> Int32:
    """For each place (q, d) that is inside its own part (q,) another that it is inside of; -1: there is none.

    Oriented facets (f, d) close around a part; `parts` (f,) are those of the facets.
    """

def exclusive(
    points: Float64,
    mesh: Connectivity,
    movable: NDArray[np.bool_],
    hopeless: NDArray[np.bool_],
    vertices: Int32,
    threads: int,
    freedom: Freedom | None = None,
) -> tuple[Int32, Int32]:
    """Simplices, but hopeless ones, whose only free vertex is one of these, and no position makes all of them positive.

    Behind these such that no place in what the vertex slides in makes positive, each by itself. Vertices that slide are
    at `points` where they began.
    """
