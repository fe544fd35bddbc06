"""What of curved elements may move, how far, and for how long."""

from __future__ import annotations

import math
from dataclasses import dataclass

from meshfix_cli.mesh.quadratic import Array, Mask


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


class Budget:
    """How many untangling sweeps are left; what is tried is one, whether or not it is any good. None: no end."""

    def __init__(self, sweeps: int | None = None) -> None:
        self.left = math.inf if sweeps is None else sweeps

    def take(self) -> bool:
        """Use one up, if there is one."""
        self.left -= 1
        return self.left >= 0
