"""Curved elements as they are drawn: with their edges in pieces, as the nodes on these bend them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import ELEMENTS, Element, Shape
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.quadratic import Quadratic

Points = NDArray[np.float64]
Rows = NDArray[np.int32]
Cells = Mapping[str, Rows]

PIECES = ((2_000, 8), (10_000, 6))  # up to so many edges there are so many pieces of each, and of more:
FEWEST = 4
SEEN = 1e-3  # of the length of an edge: what its nodes are off at least, where it is drawn in pieces
PLACES = 9  # digits by which places of nodes along edges are the same
MOST = 20_000  # elements of a type, or facets, that are drawn so; of more the straight ones of their corners
BY, FILLED = (
    ":",
    "/",
)  # between a type and the number of pieces, in the names of what is drawn; the second: without edges


@dataclass(frozen=True)
class Surface:
    """What is drawn of an element, by the places of its points.

    Attributes
    ----------
    corners : int
        Number of points.
    sides : tuple of tuples of int
        Polygons that are filled.
    edges : tuple of tuples of int, optional
        Lines from point to point; None: the sides of the polygons.
    outline : tuple of int
        Of an element in a plane the points that go round it.
    """

    corners: int
    sides: tuple[tuple[int, ...], ...]
    edges: tuple[tuple[int, ...], ...] | None
    outline: tuple[int, ...]


@cache
def surface(key: str) -> Surface:
    """Return what is drawn of a type: a key of `ELEMENTS`, or one of those of `Curves.refined`.

    Of the latter the points are the corners, those on the edges, and the middles of the sides, around which these are
    filled.
    """
    name, filled, count = re.split(f"([{BY}{FILLED}])", f"{key}{BY}")[:3]
    shape, pieces = ELEMENTS[name].shape, int(count or 1)
    around = tuple(range(shape.corners))
    sides = shape.facets if shape.dimension == 3 else (around,)
    if not count:
        return Surface(shape.corners, sides, None, around)
    places, edges, more = {}, [], shape.corners
    for a, b in _edges(shape):
        edges.append((a, *range(more, more + pieces - 1), b))
        places[a, b], places[b, a] = edges[-1][:-1], edges[-1][:0:-1]
        more += pieces - 1
    outlines = [tuple(chain.from_iterable(places[pair] for pair in _around(side))) for side in sides]
    triangles = tuple((more + i, a, b) for i, side in enumerate(outlines) for a, b in _around(side))
    return Surface(more + len(sides), triangles, () if filled == FILLED else tuple(edges), outlines[0])


def _around(side: Sequence[int]) -> list[tuple[int, int]]:
    return list(zip(side, (*side[1:], side[0]), strict=True))


def _edges(shape: Shape) -> list[tuple[int, int]]:
    """Return the edges of a shape, each once, in the direction in which its first side has it."""
    found: list[tuple[int, int]] = []
    for side in shape.facets if shape.dimension == 3 else [range(shape.corners)]:
        found += [pair for pair in _around(tuple(side)) if pair[::-1] not in found and pair not in found]
    return found if shape.corners > 2 else [(0, 1)]


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edges whose nodes have the same places.

    Attributes
    ----------
    ends : (e, 2) int
    nodes : (e, k) int
        From the first end on.
    places : tuple of k float
        Of these along the edge, from 0 to 1.
    """

    ends: NDArray[np.integer]
    nodes: NDArray[np.integer]
    places: tuple[float, ...]

    def at(self, points: Points, t: Sequence[float]) -> Points:
        """Return where they are (e, len(t), d) at parameters from 0 to 1, by the polynomial through all nodes."""
        places = np.array([0.0, 1.0, *self.places])
        basis = np.ones((len(t), len(places)))
        for i, here in enumerate(places):
            for other in np.delete(places, i):
                basis[:, i] *= (np.array(t) - other) / (here - other)
        return np.asarray(basis @ points[np.column_stack([self.ends, self.nodes])])


class Curves:
    """The curved edges of a mesh in pieces, and the sides that have them, with points behind those of the connectivity.

    Parameters
    ----------
    meshes : sequence of Mesh
        Of one topology: what is curved in one of them is drawn in pieces in all.

    Attributes
    ----------
    pieces : int
        Of each edge; 0: nothing is curved.
    """

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        quadratic, self._topology, self.pieces = meshes[0].quadratic, meshes[0].topology, 0
        if quadratic is None:
            return
        bent = np.logical_or.reduce([_bent(mesh) for mesh in meshes])
        if not bent.any():
            return
        curved, number = quadratic.with_one(bent), self._topology.number
        self._along = _edges_of(quadratic, curved, number)
        self._bent = np.concatenate([bent[edges.nodes].any(axis=1) for edges in self._along])
        ends = np.concatenate([edges.ends for edges in self._along])
        self._table = {2: number[ends]}
        self.pieces = next((pieces for most, pieces in PIECES if len(ends) <= most), FEWEST)
        self._sides = _sides(quadratic, curved)
        self._table |= {width: np.sort(number[corners], axis=1) for width, corners in self._sides.items()}
        self._nodes = {4: _nodes_between(quadratic, self._sides[4])}
        self._edges_of = {width: self._edges(number[corners]) for width, corners in self._sides.items()}

    def points(self, mesh: Mesh) -> Points:
        """Return the points that rows name: those of the connectivity, and those of the pieces."""
        points = mesh.along_curve(mesh.points)
        if not self.pieces:
            return points
        pieces = self._at(mesh, [i / self.pieces for i in range(1, self.pieces)])
        middles = self._at(mesh, [0.5])
        return np.concatenate([points, pieces, *(self._centres(mesh, middles, width) for width in (3, 4))])

    def _at(self, mesh: Mesh, t: Sequence[float]) -> Points:
        """Return all edges at parameters, one edge behind the other."""
        return np.concatenate([edges.at(mesh.points, t).reshape(-1, mesh.points.shape[1]) for edges in self._along])

    def refined(self, cells: Cells, shared: bool = False) -> dict[str, Rows]:
        """Return cells with those that are curved as other types, see `surface`.

        Parameters
        ----------
        cells : dict of (m, corners) int32
            By the vertices of the connectivity.
        shared : bool
            Neighbours are among them: their edges are lines, each once, and not their own.
        """
        if not self.pieces:
            return dict(cells)
        result: dict[str, Rows] = {}
        lines = [np.empty((0, 2), dtype=np.int32)]
        for key, rows in cells.items():
            curved, numbers = self._numbers(key, rows)
            if not len(numbers):
                result[key] = rows
            elif key == "line":
                result[key] = np.concatenate([rows[~curved], _pairs(numbers)])
            else:
                result |= {key: rows[~curved], f"{key}{FILLED if shared else BY}{self.pieces}": numbers}
                edges = surface(f"{key}{BY}{self.pieces}").edges or ()
                lines += [_pairs(numbers[:, edge]) for edge in edges if shared]
        if sum(map(len, lines)):
            result["line"] = np.unique(np.sort(np.concatenate(lines), axis=1), axis=0)
        return result

    def _numbers(self, key: str, rows: Rows) -> tuple[NDArray[np.bool_], Rows]:
        """Mark the rows (r,) that are curved, and give the numbers of all points of these; of a line in its order."""
        shape = ELEMENTS[key].shape
        edges = _edges(shape)
        sides = [] if key == "line" else shape.facets if shape.dimension == 3 else [tuple(range(shape.corners))]
        at = np.stack([self._find(rows[:, pair]) for pair in edges], axis=1)
        inside = [self._find(rows[:, side]) for side in sides]
        curved = np.logical_and.reduce(
            [(at >= 0).all(axis=1), self._bent[at].any(axis=1), *(one >= 0 for one in inside)]
        )
        if curved.sum() > MOST:
            curved[:] = False
        some, parts = rows[curved], []
        for (a, b), edge in zip(edges, at[curved].T, strict=True):
            steps = np.arange(self.pieces - 1)
            there = np.where((some[:, a] < some[:, b])[:, None], steps, steps[::-1])
            parts.append(self._first(2) + edge[:, None] * (self.pieces - 1) + there)
        parts += [self._first(len(side)) + one[curved, None] for side, one in zip(sides, inside, strict=True)]
        order = [some[:, :1], *parts, some[:, 1:]] if key == "line" else [some, *parts]
        return curved, np.concatenate(order, axis=1).astype(np.int32)

    def _first(self, width: int) -> int:
        """Return the number of the first point of edges or sides of so many corners."""
        start = len(self._topology.connectivity.vertices)
        return start + (width > 2) * len(self._bent) * (self.pieces - 1) + (width > 3) * len(self._sides[3])

    def _find(self, corners: NDArray[np.integer]) -> NDArray[np.int64]:
        """Return the positions (r,) of edges or sides (r, w), -1 for others."""
        return _positions(self._table[corners.shape[1]], np.sort(corners, axis=1))

    def _edges(self, sides: NDArray[np.integer]) -> NDArray[np.int64]:
        """Return the positions (s, w) of the edges of sides (s, w)."""
        pairs = np.stack([sides, np.roll(sides, -1, axis=1)], axis=2)
        return self._find(pairs.reshape(-1, 2)).reshape(sides.shape)

    def _centres(self, mesh: Mesh, middles: Points, width: int) -> Points:
        """Return the middles of sides of so many corners: where these have no node, it is where their edges have it."""
        corners = mesh.points[self._sides[width]].sum(axis=1)
        around = middles[self._edges_of[width]].sum(axis=1)
        if width == 3:
            return (4 * around - corners) / 9
        nodes = self._nodes[width]
        return np.where((nodes >= 0)[:, None], mesh.points[nodes], (2 * around - corners) / 4)


def _bent(mesh: Mesh) -> NDArray[np.bool_]:
    """Mark the nodes (n,) on edges that are seen to be off the place where a straight edge has them."""
    quadratic, points = mesh.quadratic, mesh.points
    assert quadratic is not None
    mask = np.zeros(quadratic.n, dtype=bool)
    for tie in (tie.at(quadratic.used[tie.nodes]) for tie in quadratic.ties.groups if tie.corners.shape[1] == 2):
        start, end = (points[tie.corners[:, k]] for k in (0, 1))
        off = np.linalg.norm(points[tie.nodes] - tie.middle(points), axis=1)
        mask[tie.nodes] = off > SEEN * np.linalg.norm(end - start, axis=1)
    return mask


def _edges_of(quadratic: Quadratic, elements: NDArray[np.bool_], number: NDArray[np.integer]) -> list[_Edges]:
    """Return the edges of some elements (m,), each once, from the end with the smaller number on."""
    found: dict[tuple[float, ...], list[NDArray[np.integer]]] = {}
    exact: dict[tuple[float, ...], tuple[float, ...]] = {}
    for code in np.unique(quadratic.codes[elements]):
        element = quadratic.types[code]
        starts = quadratic.offsets[:-1][elements & (quadratic.codes == code)]
        for nodes, places in _nodes_on_edges(element):
            rows = quadratic.nodes[starts[:, None] + np.array(nodes)]
            descending = number[rows[:, 0]] > number[rows[:, -1]]
            rows[descending] = rows[descending, ::-1]
            key = tuple(round(place, PLACES) for place in places)
            exact.setdefault(key, places)
            found.setdefault(key, []).append(rows)
    several = {key: np.unique(np.concatenate(rows), axis=0) for key, rows in found.items()}
    return [_Edges(rows[:, [0, -1]], rows[:, 1:-1], exact[key]) for key, rows in several.items()]


@cache
def _nodes_on_edges(element: Element) -> list[tuple[list[int], tuple[float, ...]]]:
    """Return the nodes of a type on each edge, from end to end, and their places between these."""
    found = []
    for a, b in _edges(element.shape):
        there = {place: weights[b] for place, weights in enumerate(element.weights, element.shape.corners)
                 if set(np.flatnonzero(weights)) == {a, b}}  # fmt: skip
        nodes = sorted(there, key=lambda place: there[place])
        found.append(([a, *nodes, b], tuple(there[place] for place in nodes)))
    return found


def _sides(quadratic: Quadratic, elements: NDArray[np.bool_]) -> dict[int, NDArray[np.int32]]:
    """Return the sides of some elements (m,), each once, with three and with four corners (s, w), as they go round."""
    found: dict[int, list[NDArray[np.int32]]] = {3: [np.empty((0, 3), np.int32)], 4: [np.empty((0, 4), np.int32)]}
    for code in np.unique(quadratic.codes[elements]):
        shape = quadratic.types[code].shape
        starts = quadratic.offsets[:-1][elements & (quadratic.codes == code)]
        corners = quadratic.nodes[starts[:, None] + np.arange(shape.corners)]
        for side in shape.facets if shape.dimension == 3 else [tuple(range(shape.corners))]:
            found[len(side)].append(corners[:, side])
    several = {width: np.concatenate(rows) for width, rows in found.items()}
    return {
        width: rows[np.unique(np.sort(rows, axis=1), axis=0, return_index=True)[1]] for width, rows in several.items()
    }


def _nodes_between(quadratic: Quadratic, corners: NDArray[np.int32]) -> NDArray[np.int64]:
    """Return the node (s,) that lies in the middle between the corners (s, w) of each side, or -1."""
    found = np.full(len(corners), -1)
    for tie in quadratic.ties.groups:
        if tie.corners.shape[1] == corners.shape[1]:
            some = tie.at((tie.weights == tie.weights[:, :1]).all(axis=1))
            at = _positions(some.corners, np.sort(corners, axis=1))
            found[at >= 0] = some.nodes[at[at >= 0]]
    return found


def _pairs(lines: Rows) -> Rows:
    """Return the pieces (s, 2) of lines (r, p) from point to point."""
    return np.stack([lines[:, :-1], lines[:, 1:]], axis=2).reshape(-1, 2)


def _positions(table: NDArray[np.integer], rows: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return where rows (r, w) stand in a table (t, w), or -1."""
    number = np.unique(np.concatenate([table, rows]), axis=0, return_inverse=True)[1].reshape(-1)
    place = np.full(len(number), -1)
    place[number[: len(table)]] = np.arange(len(table))
    return place[number[len(table) :]]
