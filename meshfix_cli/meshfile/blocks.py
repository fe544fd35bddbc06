"""Cells between the points of a block, which has points along one, two or three indices, the first of them fastest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

BLOCK = {1: "line", 2: "quad", 3: "hexahedron"}  # by the number of indices


def cells_of_block(shape: Sequence[int]) -> tuple[str, NDArray[np.int64]]:
    """Return the type and the vertices (m, 2^d) of the cells of a block with points (d,) along each of d indices."""
    steps = np.cumprod([1, *shape[:-1]])
    first = np.zeros(1, dtype=np.int64)
    for step, size in zip(steps.tolist(), shape, strict=True):
        first = (np.arange(max(size - 1, 0))[:, None] * step + first).ravel()
    corners = np.zeros(1, dtype=np.int64)
    for axis, step in enumerate(steps.tolist()):
        corners = np.concatenate([corners, (corners[::-1] if axis == 1 else corners) + step])
    return BLOCK[len(shape)], first[:, None] + corners
