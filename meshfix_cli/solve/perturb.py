"""The paper's tangling protocol, section 4. Light to import, as the command line reads `Distance`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh


@dataclass(frozen=True)
class Distance:
    """A length in model units, or in mean edge lengths h."""

    value: float
    in_h: bool

    @classmethod
    def parse(cls, text: str) -> Distance:
        """Read `2h`, `h` or `0.3`; ValueError for anything else, negative and infinite numbers included."""
        number, in_h = (text[:-1] or "1", True) if text.endswith("h") else (text, False)
        value = float(number)
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(text)
        return cls(value, in_h)

    def __str__(self) -> str:
        return f"{self.value:g}{'h' * self.in_h}"

    def length(self, mesh: Mesh, threads: int = 1) -> float:
        """Return the length in model units of a mesh."""
        return self.value * (mesh.mean_edge_length(threads) if self.in_h else 1.0)

    def on_boundary(self, mesh: Mesh) -> float:
        """Return the length in model units, h that of the boundary, which no tangle inside changes."""
        return self.value * (mesh.boundary_edge_length() if self.in_h else 1.0)


def perturb(mesh: Mesh, percent: float, distance: float, seed: int = 0) -> tuple[Mesh, int]:
    """Move some interior vertices by a distance in random directions.

    Those of the boundary that slide move in their lines and planes, and on their curves and surfaces; nodes between
    corners go along with these. From the seed
    come one permutation of the free vertices and one direction for every vertex; so in a series of percentages or
    distances the same vertices move in the same directions.

    Parameters
    ----------
    mesh : Mesh
    percent : float
        Of all vertices, as in the paper; where that is more than there are free vertices, all of those move.
    distance : float
        Model units.
    seed : int

    Returns
    -------
    mesh : Mesh
    moved : int
        Number of vertices moved.

    Notes
    -----
    Source: section 4, the two series of perturbed meshes.
    """
    import numpy as np

    random = np.random.default_rng(seed)
    order = random.permutation(np.flatnonzero(mesh.movable))
    directions = random.standard_normal(mesh.points.shape)
    if mesh.freedom is not None:
        start = mesh.along_curve(mesh.points)
        ways = mesh.freedom.onto(start + mesh.along_curve(directions), start) - start
        directions[mesh.topology.connectivity.vertices] = ways
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    chosen = order[: round(percent / 100 * int(mesh.topology.used.sum()))]
    points = mesh.points.copy()
    points[chosen] += distance * directions[chosen]
    if mesh.quadratic is not None:
        points = mesh.quadratic.follow(mesh.points, points)
    moved = mesh.with_points(points)
    if mesh.freedom is not None:
        there = mesh.freedom.onto(mesh.along_curve(points), start)
        moving = mesh.freedom.curved & (there != start).any(axis=1)
        moved = mesh.with_vertices(np.where(moving[:, None], mesh.freedom.rounded(there)[0], there))
    return moved, len(chosen)


def tangled(mesh: Mesh, percent: float, dist: Distance, seed: int, threads: int) -> tuple[Mesh, dict[str, float]]:
    """Tangle a mesh, see `perturb`; return it, and what a report tells of that."""
    length = dist.length(mesh, threads)
    moved, count = perturb(mesh, percent, length, seed)
    return moved, {"moved": count, "distance": length, "percent": percent, "seed": seed}
