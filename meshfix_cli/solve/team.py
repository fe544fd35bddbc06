"""The processes that hold a mesh together, as the sweeps of `untangle.py` see them; here: one that has all of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from meshfix_cli.mesh.freedom import Freedom
    from meshfix_cli.mesh.mesh import Mesh

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Team(Protocol):
    """What a process must know of the others; all of them make the same calls in the same order.

    Each has the stars of some vertices, which are its own, and copies of the others that these contain. All arrays
    are in the order of its `Topology.connectivity`. Whatever the number of processes, the answers have the same bits:
    they are numbers of things, smallest values, and what one process computes of the whole mesh.

    Attributes
    ----------
    own_vertices : (n,) bool
    own_elements : (m,) bool
        Each element is some process's own, and only one's.
    freedom : Freedom or None
        That of the whole mesh, in the process that computes for it.
    """

    own_vertices: Mask
    own_elements: Mask
    freedom: Freedom | None

    def total(self, count: int) -> int:
        """Return the sum of a number over all processes."""

    def least(self, value: float) -> float:
        """Return the smallest of a value over all processes."""

    def ranked(self, values: Array, percent: float) -> float:
        """Return a percentile of the values of all processes, that below where it is between two.

        Parameters
        ----------
        values : (k,) float64
            Of the things that are this process's own; all positive.
        percent : float
            From 0 to 100.
        """

    def shared(self, mask: Mask) -> Mask:
        """Return a mask (n,) with what the owners of its vertices say of them."""

    def grown(self, mask: Mask, rings: int) -> Mask:
        """Return a mask (n,) with `rings` rings of neighbours around its vertices."""

    def sweep(self, points: Array, states: NDArray[np.uint8]) -> Iterator[NDArray[np.int32]]:
        """Yield blocks of one colour after the other; points and states follow what others relocate meanwhile."""

    def of_whole(self, compute: Callable[..., Iterator[Array]], *values: NDArray[Any]) -> Iterator[Array]:
        """Yield what `compute(stars, *values)` does, points (n, d); one process calls it, for the whole mesh."""


class Alone:
    """One process with the whole mesh; see `Team`."""

    def __init__(self, mesh: Mesh, threads: int) -> None:
        self.stars, self.colours = mesh.topology.stars(threads), mesh.topology.colours
        self.own_vertices = np.ones(len(self.stars.vertices), dtype=bool)
        self.own_elements = np.ones(len(self.stars.rows), dtype=bool)
        self.freedom = mesh.freedom

    def total(self, count: int) -> int:
        """Return the number."""
        return count

    def least(self, value: float) -> float:
        """Return the value."""
        return value

    def ranked(self, values: Array, percent: float) -> float:
        """Return the value of a rank."""
        rank = rank_of(len(values), percent)
        return float(np.partition(values, rank)[rank])

    def shared(self, mask: Mask) -> Mask:
        """Return the mask."""
        return mask

    def grown(self, mask: Mask, rings: int) -> Mask:
        """Return the mask and the rings around it."""
        return self.stars.grown(mask, rings).view(bool)

    def sweep(self, points: Array, states: NDArray[np.uint8]) -> Iterator[NDArray[np.int32]]:
        """Yield the blocks of each colour."""
        del points, states
        return iter(self.colours)

    def of_whole(self, compute: Callable[..., Iterator[Array]], *values: NDArray[Any]) -> Iterator[Array]:
        """Compute here."""
        return compute(self.stars, *values)


def rank_of(count: int, percent: float) -> int:
    """Return the place, from 0, of a percentile among so many sorted values: that below, where it is between two."""
    return int(percent / 100 * max(count - 1, 0))
