"""Nodes of second and higher order in MFEM's files: those of vertices, on edges, on faces, and inside of elements.

Edges and faces have no numbers in a file: they are counted as elements name them first, element by element. The nodes
of an edge go from the vertex with the smaller number to the other, those of a face by its corners as it is named first.

Source: MFEM, "geom.cpp" (the edges and faces of each shape), "mesh.cpp" (GetVertexToVertexTable and
GetElementToFaceTable), "fespace.cpp" (Construct), "fe_coll.cpp" (H1_FECollection and L2_FECollection) and "fe_h1.cpp".
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, Rows
from meshfix_cli.mesh.lagrange import Kind, Place, key_of, lattice
from meshfix_cli.meshfile.tables import Int64

_MANY = 16  # more than any element has edges


class _Sides(NamedTuple):
    """The edges and faces of an element, in MFEM's order and with their corners in its."""

    edges: Rows
    faces: Rows = ()


_AROUND = ((0, 1), (1, 2), (2, 0))
_SIDES = {
    "line": _Sides(((0, 1),)),
    "triangle": _Sides(_AROUND),
    "quad": _Sides(((0, 1), (1, 2), (2, 3), (3, 0))),
    "tetra": _Sides(
        ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)), ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))
    ),
    "wedge": _Sides(
        (*_AROUND, (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
        ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    ),
    "hexahedron": _Sides(
        ((0, 1), (1, 2), (3, 2), (0, 3), (4, 5), (5, 6), (7, 6), (4, 7), (0, 4), (1, 5), (2, 6), (3, 7)),
        ((3, 2, 1, 0), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)),
    ),
}  # fmt: skip


class Linear(NamedTuple):
    """Elements or facets of one type: their vertices (m, k), and which rows (m,) of their section they are."""

    key: str
    vertices: Int64
    rows: Int64


class _Numbered(NamedTuple):
    """Edges or faces of all cells.

    Attributes
    ----------
    numbers : list of (m, s) int64
        Those of the cells of each type.
    first : (e, 4) int64
        The vertices of each as it is named first, -1 behind three.
    """

    numbers: list[Int64]
    first: Int64


@cache
def own_nodes(key: str, order: int) -> list[int]:
    """Return where each node of an element, in VTK's order, stands among those that it has for itself."""
    return Kind(key, order, True).order_of("rows")


def higher_order(
    n: int, order: int, elements: Sequence[Linear], facets: Sequence[Linear], lobatto: bool
) -> tuple[list[tuple[str, Int64]], int]:
    """Return the types and the nodes (m, k) of elements and of facets, and how many nodes there are.

    Parameters
    ----------
    n : int
        Number of vertices.
    order : int
        2 or more.
    elements, facets : sequence of Linear
    lobatto : bool
        Nodes are at the points of Gauss and Lobatto, and else evenly spaced.

    Raises
    ------
    ReadError
        There are pyramids, which MFEM has of several kinds, or a facet is none of an element.
    """
    cells = (*elements, *facets)
    if lacking := [one.key for one in cells if one.key not in _SIDES]:
        raise ReadError(f"has {ELEMENTS[lacking[0]].shape.plural} with nodes of order {order}, which are not read")
    edges = _numbered(n, elements, facets, [_SIDES[one.key].edges for one in cells])
    # Of solids, the nodes inside a triangle or a quadrilateral are on a face.
    solid = any(ELEMENTS[one.key].shape.dimension == 3 for one in elements)
    sides = [_whole(one.key) if solid and one.key in ("triangle", "quad") else _SIDES[one.key].faces for one in cells]
    faces = _numbered(n, elements, facets, sides)
    sizes = np.where(faces.first[:, 3] < 0, len(_interior("triangle", order)), len(_interior("quad", order)))
    on_faces = n + len(edges.first) * (order - 1)
    starts = on_faces + np.cumsum(sizes) - sizes
    inside, end = _inside(on_faces + int(sizes.sum()), order, elements)
    found = []
    for i, one in enumerate(cells):
        kind = Kind(one.key, order, True, lobatto and order > 2)
        nodes = np.empty((len(one.rows), len(kind.places())), dtype=np.int64)
        nodes[:, : one.vertices.shape[1]] = one.vertices
        _put_on_edges(nodes, one, order, n + edges.numbers[i] * (order - 1))
        _put_on_faces(nodes, one, order, sides[i], (faces.first[faces.numbers[i]], starts[faces.numbers[i]]))
        if i < len(elements):
            nodes[:, [column for column, _ in _interior(one.key, order)]] = inside[i]
        found.append((key_of(kind), nodes))
    return found, end


def _put_on_edges(nodes: Int64, cells: Linear, order: int, first: Int64) -> None:
    """Put the nodes on edges where they stand; `first` (m, edges) is the first of each edge."""
    for k, (a, b) in enumerate(_SIDES[cells.key].edges):
        ascending = cells.vertices[:, a] < cells.vertices[:, b]
        for column, step in _on_edge(cells.key, order, (a, b)):
            nodes[:, column] = first[:, k] + np.where(ascending, step, order - step) - 1


def _put_on_faces(nodes: Int64, cells: Linear, order: int, sides: Rows, named: tuple[Int64, Int64]) -> None:
    """Put the nodes inside of faces where they stand.

    `named` are the vertices of each face (m, faces, 4) as it is named first, and the first node of each (m, faces).
    """
    for k, face in enumerate(sides):
        turned = _turned(cells.vertices[:, face], named[0][:, k, : len(face)])
        for column, place in _on_face(cells.key, order, face):
            nodes[:, column] = named[1][:, k] + _rank_on_face(order, len(face), turned, place)


def _whole(key: str) -> Rows:
    return (tuple(range(ELEMENTS[key].nodes)),)


@cache
def _interior(key: str, order: int) -> list[tuple[int, Place]]:
    """Return the nodes inside, in MFEM's order: where they stand in VTK's, and places; a line has them on its edge."""
    if key == "line":
        return []
    places = lattice(key, order, "vtk")
    some = [(column, places[column]) for column, here in enumerate(_between(key, order)) if len(here) == _corners(key)]
    return sorted(some, key=lambda one: one[1][::-1])


def _corners(key: str) -> int:
    return ELEMENTS[key].shape.corners


@cache
def _between(key: str, order: int) -> list[dict[int, float]]:
    """Return for each node, in VTK's order, the corners that it lies between, and how much each of them weighs."""
    return [{i: share for i, share in enumerate(row) if share} for row in Kind(key, order, True).weights]


def _on_edge(key: str, order: int, edge: tuple[int, ...]) -> list[tuple[int, int]]:
    """Return the nodes between the ends of an edge, each with its steps from the first of these."""
    some = enumerate(_between(key, order))
    return [(column, round(order * here[edge[1]])) for column, here in some if set(here) == set(edge)]


def _on_face(key: str, order: int, face: tuple[int, ...]) -> list[tuple[int, Place]]:
    """Return the nodes inside of a face, each with its steps towards the second and the last corner of it."""
    found = []
    for column, here in enumerate(_between(key, order)):
        if set(here) == set(face):
            along = (face[1],) if len(face) == 3 else (face[1], face[2])
            across = (face[2],) if len(face) == 3 else (face[2], face[3])
            found.append((column, tuple(round(order * sum(here[i] for i in some)) for some in (along, across))))
    return found


def _turned(corners: Int64, first: Int64) -> Int64:
    """Return for faces (m, w) which of their corners stands in each place of the same face as it is named first."""
    return np.asarray((corners[:, None, :] == first[:, :, None]).argmax(axis=2))


def _rank_on_face(order: int, width: int, turned: Int64, place: Place) -> Int64:
    """Return which (m,) of the nodes inside of a face one is, whose place is told by the corners of other elements."""
    x, y = place
    if width == 3:
        steps = np.array([order - x - y, x, y])
        at = np.stack([steps[turned[:, 1]], steps[turned[:, 2]]], axis=1)
    else:
        corners = np.array(lattice("quad", 1, "vtk"))
        origin = corners[turned[:, 0]]
        ways = [corners[turned[:, k]] - origin for k in (1, 3)]
        at = np.stack([((np.array(place) - order * origin) * way).sum(axis=1) for way in ways], axis=1)
    interior = _interior("triangle" if width == 3 else "quad", order)
    rank = np.zeros((order, order), dtype=np.int64)
    for i, (_, (a, b)) in enumerate(interior):
        rank[a, b] = i
    return np.asarray(rank[at[:, 0], at[:, 1]])


def _numbered(n: int, elements: Sequence[Linear], facets: Sequence[Linear], corners: Sequence[Rows]) -> _Numbered:
    """Number the edges or faces that elements have, also those that are named by facets.

    Parameters
    ----------
    corners : sequence of tuples
        For the elements and the facets, where the vertices of each edge or face stand.
    """
    cells, m = (*elements, *facets), sum(len(one.rows) for one in elements)
    named, places, sizes = [np.empty((0, 4), np.int64)], [np.empty(0, np.int64)], []
    for i, (one, some) in enumerate(zip(cells, corners, strict=True)):
        here = np.full((len(one.rows), len(some), 4), -1)
        for k, side in enumerate(some):
            here[:, k, : len(side)] = one.vertices[:, side]
        named.append(here.reshape(-1, 4))
        places.append((_MANY * (one.rows + m * (i >= len(elements)))[:, None] + np.arange(len(some))).ravel())
        sizes.append(len(places[-1]))
    rows, order = np.concatenate(named), np.argsort(np.concatenate(places))
    numbers, first = _ranks(_codes(n, rows), order)
    count = int(numbers[: sum(sizes[: len(elements)])].max(initial=-1)) + 1
    if numbers.max(initial=-1) >= count:
        raise ReadError("has a facet on its boundary that is none of an element, so that its nodes cannot be told")
    parts = np.split(numbers, np.cumsum(sizes)[:-1])
    shaped = [part.reshape(len(one.rows), -1) for part, one in zip(parts, cells, strict=True)]
    return _Numbered(shaped, rows[first])


def _codes(n: int, rows: Int64) -> Int64:
    """Return a number (k,) for each set of vertices, of which there are n, that stands in a row (k, size)."""
    first, *others = np.sort(rows + 1, axis=1).T
    for column in others:
        first = np.unique(first * (n + 1) + column, return_inverse=True)[1].reshape(-1)
    return first


def _ranks(codes: Int64, order: Int64) -> tuple[Int64, Int64]:
    """Number codes (k,) by where, in an order (k,), each stands first; and tell where that is."""
    _, first, which = np.unique(codes[order], return_index=True, return_inverse=True)
    ranks, numbers = np.empty_like(first), np.empty_like(codes)
    ranks[np.argsort(first)] = np.arange(len(first))
    numbers[order] = ranks[which.reshape(-1)]
    return numbers, order[np.sort(first)]


def _inside(start: int, order: int, elements: Sequence[Linear]) -> tuple[list[Int64], int]:
    """Number the nodes (m, count) that elements have for themselves, from a number on; return also where these end."""
    counts = [len(_interior(one.key, order)) for one in elements]
    sizes = np.zeros(sum(len(one.rows) for one in elements), dtype=np.int64)
    for one, count in zip(elements, counts, strict=True):
        sizes[one.rows] = count
    first = start + np.cumsum(sizes) - sizes
    pairs = zip(elements, counts, strict=True)
    return [first[one.rows][:, None] + np.arange(count) for one, count in pairs], start + int(sizes.sum())
