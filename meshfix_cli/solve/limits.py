"""What of curved elements may move, how far, and for how long."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from meshfix_cli import kernels
from meshfix_cli.mesh.quadratic import Array, Mask, Quadratic


@dataclass(frozen=True)
class Limits:
    """What may move, and how far.

    Attributes
    ----------
    free : (n,) bool
    start : (n, d) float64
        Where the nodes were.
    max_move : float
        How far from there they may go, in model units.
    threads : int
        The result has the same bits for any number.
    """

    free: Mask
    start: Array
    max_move: float = math.inf
    threads: int = 1

    def energy(
        self, mesh: Quadratic, points: Array, rest: Array, sizes: Array, region: Mask
    ) -> kernels.QuadraticEnergy:
        """Return the energy of coefficients from points (n, d) on, over the nodes of a region (n,).

        `rest` (n, d) has the straight elements' corners, and `sizes` (m,) what coefficients are compared with.
        """
        free = region.astype(np.uint8)
        return kernels.QuadraticEnergy(mesh.kernel, points, rest, sizes, free, self.start, self.max_move, self.threads)


class Budget:
    """How many untangling sweeps are left; what is tried is one, whether or not it is any good. None: no end."""

    def __init__(self, sweeps: int | None = None) -> None:
        self.left = math.inf if sweeps is None else sweeps

    def take(self) -> bool:
        """Use one up, if there is one."""
        self.left -= 1
        return self.left >= 0
