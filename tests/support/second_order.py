"""One element of each type of second order."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.lagrange import kinds

SECOND = [key for key in ELEMENTS if key in kinds() and kinds()[key].order == 2]
_CORNERS: dict[str, list[list[float]]] = {
    "line": [[0, 0], [1, 0]], "triangle": [[0, 0], [1, 0], [0, 1]], "quadrilateral": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "tetrahedron": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "pyramid": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0.75]],
    "wedge": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]],
    "hexahedron": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
}  # fmt: skip


def middles(key: str, corners: NDArray[Any]) -> NDArray[Any]:
    """Where the other nodes (..., k, d) of a straight element lie, by its corners (..., c, d)."""
    return np.asarray(np.array(ELEMENTS[key].weights) @ corners)


def reference(key: str) -> NDArray[np.float64]:
    """Nodes (k, 3), in VTK's order, of an element whose sides are along the axes."""
    corners = np.zeros((ELEMENTS[key].shape.corners, 3))
    known = _CORNERS[ELEMENTS[key].shape.name]
    corners[:, : len(known[0])] = known
    return np.concatenate([corners, middles(key, corners)]) if ELEMENTS[key].weights else corners


def element(key: str) -> NDArray[np.float64]:
    """Nodes (k, 3), in VTK's order, of a straight element of which no two sides are alike; five digits or fewer."""
    corners = reference(key)[: ELEMENTS[key].shape.corners]
    skew = np.random.default_rng(len(corners)).integers(-8, 9, corners.shape) / 64
    corners[:, :2] += skew[:, :2]
    corners[:, 2] += skew[:, 2] * (ELEMENTS[key].shape.dimension == 3)
    return np.concatenate([corners, middles(key, corners)])


def is_straight(key: str, nodes: NDArray[Any], tolerance: float) -> bool:
    """Whether the nodes (..., k, d) of elements lie where those of VTK's order do."""
    corners = ELEMENTS[key].shape.corners
    off = nodes[..., corners:, :] - middles(key, nodes[..., :corners, :])
    return bool((np.abs(off) <= tolerance).all())
