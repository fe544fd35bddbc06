"""Which points of the pieces of a mesh are the same: those of one number, or those of one place on an interface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.meshfile.solved import Part, solved_of, solved_runs
from meshfix_cli.meshfile.source import Cells, ghost_vertices
from meshfix_cli.meshfile.splice import Points

Int64 = NDArray[np.int64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Copies:
    """The points of all pieces one behind the other: what is one point of the mesh may stand there several times.

    Attributes
    ----------
    names : sequence of str
        Of the pieces.
    points : (n, d) float
    piece : (n,) int64
        Which piece has the point.
    cells : sequence of Cells
        Of all pieces; their vertices are rows of the points.
    """

    names: Sequence[str]
    points: Points
    piece: Int64
    cells: Sequence[Cells]

    def of_cells(self, cells: Sequence[Cells]) -> Mask:
        """Mark the vertices (n,) of some cells."""
        mask = np.zeros(len(self.points), dtype=bool)
        for run in cells:
            mask[run.vertices] = True
        return mask

    def of_nodes(self, parts: Sequence[Part]) -> Mask:
        """Mark the nodes (n,) of some elements that have more than corners."""
        mask = np.zeros(len(self.points), dtype=bool)
        for part in parts:
            if part.nodes is not None:
                mask[part.nodes] = True
        return mask

    def place(self, row: int) -> str:
        """Return the coordinates of a point, as a user reads them."""
        return f"({', '.join(f'{x:g}' for x in self.points[row].tolist())})"


def joined(labels: Int64, used: Mask) -> tuple[Int64, Int64]:
    """Number the points of the mesh in the order in which they first appear.

    Parameters
    ----------
    labels : (k,) int64
        Those of copies of one point are equal.
    used : (k,) bool
        The vertices of cells.

    Returns
    -------
    (k,) int64
        The point of the mesh of each copy.
    (n,) int64
        For each point of the mesh the first of its copies, or the first that is used.
    """
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    rows, chosen = rank[inverse.reshape(-1)], first[order]
    at = np.flatnonzero(used)
    points, first_used = np.unique(rows[at], return_index=True)
    chosen[points] = at[first_used]
    return rows, chosen


def by_numbers(copies: Copies, numbers: Int64) -> Int64:
    """Return labels (k,) by the numbers (k,) that the pieces give to their points.

    Raises
    ------
    ReadError
        A number stands twice in a piece, or the pieces disagree about the place of a point that cells use.
    """
    order = np.lexsort((copies.piece, numbers))
    same = (np.diff(numbers[order]) == 0) & (np.diff(copies.piece[order]) == 0)
    if same.any():
        row = order[np.argmax(same)]
        raise ReadError(f"{copies.names[copies.piece[row]]}: two of its points have the number {numbers[row]}")
    used = copies.of_cells(copies.cells)
    rows, chosen = joined(numbers, used)
    mine, first = copies.points, copies.points[chosen][rows]
    apart = used & ((mine != first) & ~(np.isnan(mine) & np.isnan(first))).any(axis=1)
    if apart.any():
        here = int(np.argmax(apart))
        there = int(chosen[rows[here]])
        one, other = (f"{copies.place(row)} in {copies.names[copies.piece[row]]}" for row in (there, here))
        raise ReadError(f"the pieces disagree about the point with the number {numbers[here]}: {one}, {other}")
    return numbers


def by_place(copies: Copies, threads: int = 1) -> Int64:
    """Return labels (k,) by equal coordinates of points on the boundaries of pieces.

    Inside of a piece nothing is joined, so that a slit stays open: there points may be at one place and not the same.

    Raises
    ------
    ReadError
        Two points of a piece are where another piece has one.
    """
    members, foreign = _on_interfaces(copies, threads)
    # A vertex that a piece knows of ghosts alone may be inside of the piece that owns it.
    at = np.flatnonzero(copies.of_cells(copies.cells) if foreign.any() else members)
    at = at[np.lexsort((at, *copies.points[at].T))]
    group = _groups(copies.points[at])
    if foreign.any():
        kept = members[at] | (np.bincount(group, foreign[at]) > 0)[group]
        at, group = at[kept], group[kept]
    together, here = np.diff(group) == 0, np.diff(copies.piece[at]) == 0
    size = int(group[-1]) + 1 if len(group) else 0
    crowded = np.bincount(group[1:], together & here, size) > 0
    spanning = np.bincount(group[1:], together & ~here, size) > 0
    if (crowded & spanning).any():
        raise _ambiguous(copies, at[group == np.argmax(crowded & spanning)])
    labels = np.arange(len(copies.points))
    labels[at] = np.where(spanning[group], at[np.searchsorted(group, group)], at)
    return labels


def _on_interfaces(copies: Copies, threads: int) -> tuple[Mask, Mask]:
    """Mark the points (n,) that may be on an interface, and those of ghost cells alone.

    The first are on the boundary of the elements that a piece has for itself, on other cells, or on ghosts.
    """
    chosen = solved_runs(copies.cells)
    elements = [copies.cells[i] for i in chosen]
    others = [run for i, run in enumerate(copies.cells) if i not in chosen]
    own = solved_of([run if run.ghosts is None else Cells(run.type, run.vertices[~run.ghosts]) for run in elements])
    members = copies.of_cells([*others, *own.rest])
    mine = np.zeros_like(members)
    if own.parts:
        # Where they are does not matter here, so a plane in space may be seen from any side.
        topology = Mesh.build(copies.points[:, : own.dimension], own.blocks, threads=threads).topology
        members |= topology.boundary
        mine = topology.used | copies.of_nodes(own.parts)
    ghosts = ghost_vertices(elements, len(members))
    if ghosts is None:
        return members, np.zeros_like(members)
    return members | ghosts, ghosts & ~mine


def _groups(points: Points) -> Int64:
    """Number sorted points (n, d) by their places (n,)."""
    changes = (points[1:] != points[:-1]).any(axis=1)
    return np.concatenate([[0], np.cumsum(changes)])[: len(points)]


def _ambiguous(copies: Copies, rows: Int64) -> ReadError:
    pieces, counts = np.unique(copies.piece[rows], return_counts=True)
    crowded, other = (copies.names[pieces[i]] for i in np.argsort(-counts, kind="stable")[:2])
    return ReadError(
        f"{crowded} has {counts.max()} points at {copies.place(rows[0])}, where {other} has some as well: "
        "only global ids could tell which of them are the same"
    )
