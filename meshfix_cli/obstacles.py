"""What makes a valid mesh impossible, wherever the free vertices go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import _kernels
from meshfix_cli.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Obstacles:
    """Simplices, by their rows, that no position of the free vertices mends.

    Attributes
    ----------
    inverted : (k,) int64
        Inverted simplices without a free vertex.
    crossing : (c, 2) int64
        Pairs of simplices of one part that have fixed facets which cross each other: the part overlaps itself, even
        where all of its simplices are positive. Each facet's first 16 crossings are looked for.
    """

    inverted: NDArray[np.int64]
    crossing: NDArray[np.int64]

    def __bool__(self) -> bool:
        return len(self.inverted) + len(self.crossing) > 0


def find_obstacles(mesh: Mesh, threads: int = 1) -> Obstacles:
    """Find inverted simplices without a free vertex, and fixed facets that cross each other.

    Facets that only touch, as at a slit, do not cross; nor do those of separate parts, which may be in contact.
    """
    topology = mesh.topology
    fixed = ~mesh.movable[topology.simplices]
    rows = np.flatnonzero(fixed.all(axis=1))
    valid = _kernels.measure(mesh.points, np.ascontiguousarray(topology.simplices[rows]), threads)[1]
    facets, owners = _fixed_facets(mesh, fixed)
    pairs = owners[_kernels.crossings(mesh.points, facets, threads)]
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    return Obstacles(rows[valid == 0], pairs[topology.component[pairs[:, 0]] == topology.component[pairs[:, 1]]])


def _fixed_facets(mesh: Mesh, fixed: NDArray[np.bool_]) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the facets (f, d) all of whose vertices are fixed, each once, and a simplex of each."""
    simplices, mates = mesh.topology.simplices, mesh.topology.mates
    corners = simplices.shape[1]
    first = mates < np.arange(simplices.size).reshape(simplices.shape)
    some = np.flatnonzero(fixed.sum(axis=1) >= corners - 1)
    facets, owners = [], []
    for position in range(corners):
        rest = [k for k in range(corners) if k != position]
        rows = some[fixed[some][:, rest].all(axis=1) & first[some, position]]
        facets.append(simplices[rows][:, rest])
        owners.append(rows)
    return np.ascontiguousarray(np.concatenate(facets)), np.concatenate(owners)
