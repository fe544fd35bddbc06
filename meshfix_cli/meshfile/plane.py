"""Meshes that lie in a plane in space are solved in that plane."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError

# Distance from the plane, relative to the size of the mesh, that text with seven digits or float32 may leave.
FLAT = 1e-6
SOME, BENT = 300, 0.01  # points of a mesh that in the mean are so far from any plane: there is none for all of them
FAR = 1e3  # median distances from the middle, beyond which a vertex was thrown away rather than meshed


def plane_basis(points: NDArray[np.float64], epsilon: float = 0.0) -> NDArray[np.float64] | None:
    """Return two orthonormal vectors (2, 3) that span the plane of the points (n, 3); None: they lie in no plane.

    Of the two sides the one with the positive largest coordinate of the normal is seen, so a mesh in a plane of
    constant z is seen from above. Planes along the axes give exact unit vectors.

    Parameters
    ----------
    points : (n, 3) float64
    epsilon : float
        Relative rounding of the coordinates in the file: far from the origin it bends a plane.

    Raises
    ------
    ReadError
        The points lie on one line.
    """
    if _is_bent(points[:: max(1, len(points) // SOME)], epsilon):
        return None
    points, epsilon = _drawn_near(points, epsilon)
    size = float(np.ptp(points, axis=0).max())
    flat = FLAT + 4 * epsilon * float(np.abs(points).max()) / size
    spread = np.ptp(points, axis=0)
    thin = int(np.argmin(spread))
    if spread[thin] <= flat * size and np.partition(spread, 1)[1] > 0.0:
        return np.eye(3)[[(thin + 1) % 3, (thin + 2) % 3]]
    centred = (points - points.mean(axis=0)) / size
    _, axes = np.linalg.eigh(centred.T @ centred)
    normal_vector = axes[:, 0] * np.sign(axes[np.argmax(np.abs(axes[:, 0])), 0])
    if np.abs(centred @ normal_vector).max() > flat:
        return None
    if np.ptp(centred @ axes[:, 1]) <= flat:
        raise ReadError("all vertices lie on one line")
    return np.stack([axes[:, 2], np.cross(normal_vector, axes[:, 2])])


def _is_bent(points: NDArray[np.float64], epsilon: float) -> bool:
    """Whether some of the points of a mesh leave no doubt that all of them lie in no plane."""
    points, epsilon = _drawn_near(points, epsilon)
    size = float(np.ptp(points, axis=0).max())
    if not size > 0.0 or len(points) < SOME:
        return False
    centred = (points - points.mean(axis=0)) / size
    doubt = BENT + epsilon * float(np.abs(points).max()) / size / FLAT * BENT
    return bool(np.linalg.eigvalsh(centred.T @ centred)[0] > doubt**2 * len(points))


def is_level(basis: NDArray[np.float64]) -> bool:
    """Whether a plane is one of constant z, seen from above."""
    return bool((basis == np.eye(3)[:2]).all())


def _drawn_near(points: NDArray[np.float64], epsilon: float) -> tuple[NDArray[np.float64], float]:
    """Return the points with what is far away brought near in its direction, and the relative rounding of these.

    Else one vertex would hide from the tolerance what the others form, and from the fit which plane they lie in.
    """
    middle = points[np.argmin(np.linalg.norm(points - _median(points), axis=1))]
    distance = np.linalg.norm(points - middle, axis=1)
    usual = float(_median(distance))
    if not 0.0 < FAR * usual < distance.max():
        return points, epsilon
    scale = distance + usual
    rounding = epsilon * float((np.abs(points).max(axis=1) / scale).max())
    return (points - middle) / scale[:, None], rounding


def _median(values: NDArray[np.float64]) -> Any:
    """Return the upper median along the first axis: numpy's imports masked arrays, a tenth of a small mesh's time."""
    middle = len(values) // 2
    return np.partition(values, middle, axis=0)[middle]
