"""Small tangled meshes from which the tests make files."""

from __future__ import annotations

from functools import cache

import generate
import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.solve.perturb import perturb


@cache
def plate() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (n, 3) with z = 0 and triangles (m, 3), some of them inverted; six digits behind the point."""
    return _tangled(*generate.plate(0.4))


@cache
def block() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (n, 3) and tetrahedra (m, 4), some of them inverted; six digits behind the point."""
    return _tangled(*generate.bracket(0.5, 4))


def _tangled(points: NDArray[np.float64], cells: NDArray[np.int32]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    mesh = Mesh.build(points.round(6), cells)
    moved = perturb(mesh, 10, mesh.mean_edge_length(), seed=3)[0].points.round(6)
    return np.column_stack([moved, np.zeros((len(moved), 3 - mesh.dimension))]), np.asarray(cells, dtype=np.int64)
