"""Surfaces in space; see kernels/surface."""

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.kernels import Connectivity, Freedom

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]

def unfold(points: Float64, offsets: Int32, nodes: Int32, normals: Float64, threads: int) -> Float64:
    """Where the nodes of elements are in their own planes (sum of nodes, 2), seen from their normals (m, 3)."""

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
) -> tuple[int, int]:
    """As `relocate`, in the planes, and on the lines, surfaces and curves of a freedom; seen from normals (m, 3)."""
