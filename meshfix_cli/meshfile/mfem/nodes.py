"""Nodes of second order in MFEM's files: those of vertices, of edges, of quadrilateral faces, and inside of elements.

Edges and faces have no numbers in a file: they are counted as elements name them first, element by element.

Source: MFEM, "geom.cpp" (the edges and faces of each shape), "mesh.cpp" (GetVertexToVertexTable and
GetElementToFaceTable), "fespace.cpp" (Construct), and "fe_coll.cpp" (H1_FECollection).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, Rows
from meshfix_cli.meshfile.tables import Int64

_MANY = 16  # more than any element has edges


class _Second(NamedTuple):
    """An element of second order: its edges, its quadrilateral faces, how many nodes are inside, and in which order.

    `order` tells which of MFEM's nodes stands in each place of the table of elements; empty: they stand so.
    """

    key: str
    edges: Rows
    faces: Rows = ()
    inside: int = 0
    order: Sequence[int] = ()


_AROUND = ((0, 1), (1, 2), (2, 0))
_TYPES = {
    "line": _Second("line3", ((0, 1),)),
    "triangle": _Second("triangle6", _AROUND),
    "quad": _Second("quad9", ((0, 1), (1, 2), (2, 3), (3, 0)), inside=1),
    "tetra": _Second("tetra10", ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)), order=(0, 1, 2, 3, 4, 7, 5, 6, 8, 9)),
    "wedge": _Second(
        "wedge18", (*_AROUND, (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
        ((0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    ),
    "hexahedron": _Second(
        "hexahedron27",
        ((0, 1), (1, 2), (3, 2), (0, 3), (4, 5), (5, 6), (7, 6), (4, 7), (0, 4), (1, 5), (2, 6), (3, 7)),
        ((3, 2, 1, 0), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (4, 5, 6, 7)),
        1, (*range(20), 24, 22, 21, 23, 20, 25, 26),
    ),
}  # fmt: skip


class Linear(NamedTuple):
    """Elements or facets of one type: their vertices (m, k), and which rows (m,) of their section they are."""

    key: str
    vertices: Int64
    rows: Int64


def second_order(n: int, elements: Sequence[Linear], facets: Sequence[Linear]) -> tuple[list[tuple[str, Int64]], int]:
    """Return the types and the nodes (m, k) of elements and of facets, and how many nodes there are.

    Parameters
    ----------
    n : int
        Number of vertices.
    elements, facets : sequence of Linear

    Raises
    ------
    ReadError
        There are pyramids, which MFEM has of several kinds, or a facet is none of an element.
    """
    cells = (*elements, *facets)
    if lacking := [one.key for one in cells if one.key not in _TYPES]:
        raise ReadError(f"has {ELEMENTS[lacking[0]].shape.plural} with nodes of order 2, which are not read")
    kinds = [_TYPES[one.key] for one in cells]
    solid = any(ELEMENTS[one.key].shape.dimension == 3 for one in elements)
    edges, last = _numbered(n, elements, facets, [kind.edges for kind in kinds], 2)
    # Of solids, the node in the middle of a quadrilateral is on a face.
    quads: list[Rows] = [((0, 1, 2, 3),) if solid and one.key == "quad" else _TYPES[one.key].faces for one in cells]
    faces, more = _numbered(n, elements, facets, quads, 4)
    inside = _inside([kind.inside for kind in kinds[: len(elements)]], elements)
    starts = (n, n + last, n + last + more)
    found = []
    for i, (one, kind) in enumerate(zip(cells, kinds, strict=True)):
        parts = (edges[i], faces[i], inside[i] if i < len(elements) else edges[i][:, :0])
        nodes = np.hstack([one.vertices, *(part + start for part, start in zip(parts, starts, strict=True))])
        found.append((kind.key, nodes[:, kind.order] if kind.order else nodes))
    return found, starts[2] + sum(part.size for part in inside)


def _numbered(
    n: int, elements: Sequence[Linear], facets: Sequence[Linear], corners: Sequence[Rows], size: int
) -> tuple[list[Int64], int]:
    """Number the edges or faces, of `size` vertices, that elements have; return those of all cells, and how many.

    Parameters
    ----------
    corners : sequence of tuples
        For the elements and the facets, where the vertices of each edge or face stand.
    """
    cells, m = (*elements, *facets), sum(len(one.rows) for one in elements)
    named, places, sizes = [], [], []
    for i, (one, some) in enumerate(zip(cells, corners, strict=True)):
        named.append(one.vertices[:, np.array(some, dtype=np.int64).reshape(-1, size)].reshape(-1, size))
        places.append((_MANY * (one.rows + m * (i >= len(elements)))[:, None] + np.arange(len(some))).ravel())
        sizes.append(len(places[-1]))
    numbers = _ranks(_codes(n, np.concatenate(named)), np.argsort(np.concatenate(places)))
    count = int(numbers[: sum(sizes[: len(elements)])].max(initial=-1)) + 1
    if numbers.max(initial=-1) >= count:
        raise ReadError("has a facet on its boundary that is none of an element, so that its nodes cannot be told")
    parts = np.split(numbers, np.cumsum(sizes)[:-1])
    return [part.reshape(len(one.rows), -1) for part, one in zip(parts, cells, strict=True)], count


def _codes(n: int, rows: Int64) -> Int64:
    """Return a number (k,) for each set of vertices, of which there are n, that stands in a row (k, size)."""
    first, *others = np.sort(rows, axis=1).T
    for column in others:
        first = np.unique(first * n + column, return_inverse=True)[1].reshape(-1)
    return first


def _ranks(codes: Int64, order: Int64) -> Int64:
    """Number codes (k,) by where, in an order (k,), each stands first."""
    _, first, which = np.unique(codes[order], return_index=True, return_inverse=True)
    ranks, numbers = np.empty_like(first), np.empty_like(codes)
    ranks[np.argsort(first)] = np.arange(len(first))
    numbers[order] = ranks[which.reshape(-1)]
    return numbers


def _inside(counts: Sequence[int], elements: Sequence[Linear]) -> list[Int64]:
    """Number the nodes (m, 0 or 1) that elements have for themselves."""
    having = np.sort(
        np.concatenate([one.rows[: len(one.rows) * count] for one, count in zip(elements, counts, strict=True)])
    )
    return [np.searchsorted(having, one.rows)[:, None][:, :count] for one, count in zip(elements, counts, strict=True)]
