"""One element of each type of second order, and where its nodes lie between its corners."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import ELEMENTS

_TRIANGLE, _QUAD, _TETRA, _PYRAMID = "01 12 20", "01 12 23 30", "01 12 20 03 13 23", "01 12 23 30 04 14 24 34"
_WEDGE, _HEXAHEDRON = "01 12 20 34 45 53 03 14 25", "01 12 23 30 45 56 67 74 04 15 26 37"
# For each node that is no corner the corners in whose middle it lies, in VTK's order.
BETWEEN = {
    "line3": "01", "triangle6": _TRIANGLE, "quad8": _QUAD, "quad9": f"{_QUAD} 0123", "tetra10": _TETRA,
    "pyramid13": _PYRAMID, "pyramid14": f"{_PYRAMID} 0123", "wedge15": _WEDGE, "wedge18": f"{_WEDGE} 0143 1254 2035",
    "hexahedron20": _HEXAHEDRON, "hexahedron27": f"{_HEXAHEDRON} 0473 1265 0154 3762 0321 4567 01234567",
}  # fmt: skip
_CORNERS: dict[str, list[list[float]]] = {
    "line": [[0, 0], [1, 0]], "triangle": [[0, 0], [1, 0], [0, 1]], "quadrilateral": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "tetrahedron": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "pyramid": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0.75]],
    "wedge": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]],
    "hexahedron": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
}  # fmt: skip


def middles(key: str, corners: NDArray[Any]) -> NDArray[Any]:
    """Where the other nodes (..., k, d) of a straight element lie, by its corners (..., c, d)."""
    return np.stack([corners[..., [int(one) for one in word], :].mean(axis=-2) for word in BETWEEN[key].split()], -2)


def reference(key: str) -> NDArray[np.float64]:
    """Nodes (k, 3), in VTK's order, of an element whose sides are along the axes."""
    corners = np.zeros((ELEMENTS[key].shape.corners, 3))
    known = _CORNERS[ELEMENTS[key].shape.name]
    corners[:, : len(known[0])] = known
    return np.concatenate([corners, middles(key, corners)]) if key in BETWEEN else corners


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
