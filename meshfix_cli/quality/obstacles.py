"""What makes a valid mesh impossible, wherever the free vertices go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Simplices, by their rows, that no position of the free vertices mends.

    Attributes
    ----------
    inverted : (k,) int32
        Inverted simplices without a free vertex.
    crossing : (c, 2) int32
        Pairs of simplices of one part that have fixed facets which cross each other: the part overlaps itself, even
        where all of its simplices are positive. Each facet's first 16 crossings are looked for.
    """

    inverted: NDArray[np.int32]
    crossing: NDArray[np.int32]

    def __bool__(self) -> bool:
        return len(self.inverted) + len(self.crossing) > 0


def find_obstacles(mesh: Mesh, threads: int = 1) -> Obstacles:
    """Find inverted simplices without a free vertex, and fixed facets that cross each other.

    Facets that only touch, as at a slit, do not cross; nor do those of separate parts, which may be in contact.

    Parameters
    ----------
    mesh : Mesh
    threads : int

    Returns
    -------
    Obstacles
        Each simplex, and each pair, once and in ascending order: the same for any number of threads.
    """
    connectivity, points = mesh.topology.connectivity, mesh.along_curve(mesh.points)
    rows = mesh.stuck(threads)
    inverted, _ = kernels.check(points, connectivity.simplices[rows], threads)
    facets, owners = connectivity.fixed_facets(mesh.along_curve(mesh.movable), threads)
    pairs = owners[kernels.crossings(points, facets, threads)]
    pairs = pairs[connectivity.component[pairs[:, 0]] == connectivity.component[pairs[:, 1]]]
    named = np.sort(connectivity.rows[pairs], axis=1)
    return Obstacles(np.sort(connectivity.rows[rows[inverted]]), np.unique(named, axis=0))
