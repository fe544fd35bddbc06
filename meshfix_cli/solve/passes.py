"""Passes of smoothing that were run before it is known where smoothing begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.solve.strategies import Move, Phase

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Passes:
    """Passes of smoothing that were run to choose a start: the first ones of the smoothing that begins there.

    Attributes
    ----------
    near : (k,) bool
        The vertices that might move.
    points : list of (k, d) float64
        Before the first pass, and after each.
    states : (k,) uint8
        After the last.
    """

    near: Mask
    points: list[Array]
    states: NDArray[np.uint8]

    def begin(self, points: Array, near: Mask, phase: Phase) -> bool:
        """Whether a phase begins with them."""
        return phase.moves == (Move.COMBINED_SMOOTH,) and points is self.points[0] and np.array_equal(near, self.near)
