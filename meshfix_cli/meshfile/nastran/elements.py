"""The elements of a deck: which fields name their points, and in which order.

Source: MSC Software, "MSC Nastran Quick Reference Guide", CTRIA3 and the others of `_SHAPES` and `_LINES`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.nastran.cards import BLANK, Deck, is_number, some_of
from meshfix_cli.meshfile.source import Cells
from meshfix_cli.meshfile.splice import Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs, alike

REF = "nastran:ref"

# The shape, and the most nodes; they stand behind the numbers of element and property.
_SHAPES = {
    "CTRIA3": ("triangle", 3), "CTRIAR": ("triangle", 3), "CTRIA6": ("triangle", 6), "CTRIAX": ("triangle", 6),
    "CTRIAX6": ("triangle", 6), "CTRAX3": ("triangle", 3), "CTRAX6": ("triangle", 6), "CPLSTN3": ("triangle", 3),
    "CPLSTN6": ("triangle", 6), "CPLSTS3": ("triangle", 3), "CPLSTS6": ("triangle", 6),
    "CQUAD4": ("quad", 4), "CQUADR": ("quad", 4), "CQUAD8": ("quad", 8), "CQUAD": ("quad", 9), "CQUADX": ("quad", 9),
    "CQUADX4": ("quad", 4), "CQUADX8": ("quad", 8), "CPLSTN4": ("quad", 4), "CPLSTN8": ("quad", 8),
    "CPLSTS4": ("quad", 4), "CPLSTS8": ("quad", 8), "CSHEAR": ("quad", 4),
    "CTETRA": ("tetra", 10), "CPYRA": ("pyramid", 13), "CPYRAM": ("pyramid", 13),
    "CPENTA": ("wedge", 15), "CPENTCZ": ("wedge", 15), "CHEXA": ("hexahedron", 20), "CHEXCZ": ("hexahedron", 20),
}  # fmt: skip
_SIZES = {
    "triangle": (3, 6), "quad": (4, 8, 9), "tetra": (4, 10), "pyramid": (5, 13), "wedge": (6, 15),
    "hexahedron": (8, 20),
}  # fmt: skip
# Where the table of elements has another order: which of the card's nodes stands there.
ORDER = {
    "hexahedron20": [*range(12), *range(16, 20), *range(12, 16)],
    "wedge15": [*range(9), 12, 13, 14, 9, 10, 11],
    "CTRIAX6": [0, 2, 4, 1, 3, 5],  # nodes stand along the circumference
}
# Fields of the points of elements that only hold these.
_LINES = {
    "CBAR": (2, 3), "CBEAM": (2, 3), "CBEND": (2, 3), "CROD": (2, 3), "CTUBE": (2, 3), "CVISC": (2, 3), "CBUSH": (2, 3),
    "CBUSH1D": (2, 3), "CGAP": (2, 3), "CBEAM3": (2, 3, 4), "CONROD": (1, 2), "PLOTEL": (1, 2), "RBAR": (1, 2),
    "RROD": (1, 2), "CELAS1": (2, 4), "CELAS2": (2, 4), "CDAMP1": (2, 4), "CDAMP2": (2, 4), "CMASS1": (2, 4),
    "CMASS2": (2, 4), "CONM1": (1,), "CONM2": (1,),
}  # fmt: skip
_RIGID = ("RBE1", "RBE2", "RBE3", "RSPLINE", "RTRPLT")
NAMES = (*_SHAPES, *_LINES, *_RIGID)


def elements(deck: Deck, points: Numbering) -> Runs:
    """Read the elements, in the order of the file; those of springs, masses and rigid elements behind the others."""
    runs = Runs()
    rows = deck.where(*_SHAPES)
    corners = np.array([_corners_of(name) for name in deck.names], dtype=np.int64)
    kinds = some_of(deck.kinds, rows)
    more = some_of(deck.filled, rows) > 2 + corners[kinds]
    for some in alike(kinds, more):
        _add_shapes(deck, rows[some], bool(more[some[0]]), points, runs)
    for name in deck.names:
        if name in _LINES:
            _add_lines(deck, deck.where(name), _LINES[name], points, runs)
    pairs = np.array([*_rigid(deck)], dtype=np.int64).reshape(-1, 3)
    _hold(pairs[:, 0], points.rows_of(pairs[:, 1:]), None, runs)
    return runs


def _corners_of(name: str) -> int:
    return _SIZES[_SHAPES[name][0]][0] if name in _SHAPES else 0


def _add_shapes(deck: Deck, rows: Int64, more: bool, points: Numbering, runs: Runs) -> None:
    """Read elements of one name, all of which have more fields than they have corners, or none of which has."""
    name = deck.names[deck.kinds[rows[0]]]
    shape, most = _SHAPES[name]
    corners = _corners_of(name)
    columns = np.array(ORDER.get(name, range(most if more else corners))) + 2
    labels = deck.integers(rows, 0, 2)
    ids, properties = np.ascontiguousarray(labels[:, 0]), labels[:, 1]
    nodes = _taken(deck.integers(rows, 2, columns.max() + 1, texts=more), columns - 2)
    if min(labels.min(), nodes.min()) <= 0:
        nodes = np.where(nodes == BLANK, 0, nodes)
        good = (ids != BLANK) & (nodes[:, :corners] > 0).all(axis=1)
        deck.check(rows, good, f"{name} lacks a number of a point, or its own")
        properties = np.where(properties == BLANK, ids, properties)  # which is the default
    for size, chosen in _divided(_SIZES[shape], nodes) if more else [(corners, np.True_)]:
        if not chosen.any():
            continue
        here = slice(None) if chosen.all() else np.flatnonzero(chosen)
        key = f"{shape}_incomplete" if not size else shape if size == corners else f"{shape}{size}"
        order = np.array(ORDER.get(key, range(size or nodes.shape[1])))
        vertices = _vertices(_taken(nodes[here], order), ids[here], points)
        places = partial(_places, deck, rows[here], columns[order])
        runs.add(Cells(key, vertices, ids[here]), places, {REF: properties[here]})


def _taken(values: Int64, columns: Int64) -> Int64:
    """Return some columns (m, k), and no copy where they are all of them."""
    return values if np.array_equal(columns, np.arange(values.shape[1])) else values[:, columns]


def _vertices(nodes: Int64, elements: Int64, points: Numbering) -> Int64:
    """Return the rows of points (m, k), -1 for those that an element lacks."""
    if nodes.min() > 0:
        return points.points_of(nodes, elements)
    known = nodes != 0
    vertices = np.full(nodes.shape, -1)
    vertices[known] = points.points_of(nodes[known][:, None], np.repeat(elements, known.sum(axis=1)))[:, 0]
    return vertices


def _divided(sizes: Sequence[int], nodes: Int64) -> Iterator[tuple[int, NDArray[np.bool_]]]:
    """Give numbers of nodes, and which elements with nodes (m, k), 0 where there is none, have these, and no others.

    With 0 come those that lack some nodes of their edges.
    """
    known, left = nodes != 0, np.ones(len(nodes), dtype=bool)
    for size in (size for size in sizes if size <= nodes.shape[1]):
        here = known[:, :size].all(axis=1) & ~known[:, size:].any(axis=1)
        left &= ~here
        yield size, here
    yield 0, left


def _places(deck: Deck, rows: Int64, columns: Int64) -> Places:
    """Find where cards name the points of elements."""
    fields = deck.fields(rows, columns.max() + 1, whole=True)
    widths = fields.widths_of(0, columns.max() + 1)[:, columns]
    width = int(widths[0, 0])
    if (widths != width).any():
        raise ReadError("has elements in fields of different widths, which cannot be renumbered")
    spans = fields.columns(0, columns.max() + 1)[:, columns]
    return Places.of_text(spans, "i8", width, "padded" if width else "")


def _add_lines(deck: Deck, rows: Int64, columns: Sequence[int], points: Numbering, runs: Runs) -> None:
    """Read elements that name their points in some fields."""
    numbers = np.hstack([deck.integers(rows, column, column + 1) for column in (0, *columns)])
    deck.check(rows, numbers[:, 0] != BLANK, "an element has no number")
    properties = deck.integers(rows, 1, 2)[:, 0] if columns[:2] == (2, 3) else None
    _hold(numbers[:, 0], points.rows_of(numbers[:, 1:]), properties, runs)


def _hold(ids: Int64, vertices: Int64, properties: Int64 | None, runs: Runs) -> None:
    """Take elements whose points (m, k) may be others than GRIDs, which have no place: -1."""
    known = vertices >= 0
    whole, some = known.all(axis=1), known.any(axis=1)
    kind = {1: "vertex", 2: "line", 3: "line3"}[vertices.shape[1]]
    single = vertices[np.arange(len(vertices)), known.argmax(axis=1)][:, None]
    for key, here, those in ((kind, whole, vertices), ("vertex", some & ~whole, single)):
        if here.any():
            labels = {} if properties is None else {REF: np.where(properties == BLANK, ids, properties)[here]}
            nowhere = partial(Places.of_text, np.empty((0, those.shape[1], 2), dtype=np.int64))
            runs.add(Cells(key, those[here], ids[here]), nowhere, labels)


def _rigid(deck: Deck) -> Iterator[tuple[int, int, int]]:
    """Give the numbers of rigid elements with those of their first point and another."""
    for name in deck.names:
        if name in _RIGID:
            for words in deck.fields(deck.where(name)).words():
                named = {"RBE2": words[1:2] + words[3:], "RBE3": [*_weighted(words[2:])]}.get(name, words[1:])
                numbers = [int(word) for word in (*words[:1], *named) if is_number(word)]
                yield from ((numbers[0], numbers[1], node) for node in numbers[2:])


def _weighted(words: Sequence[str]) -> Iterator[str]:
    """Give the points of RBE3: the first and its components, then others, behind a weight and components for some."""
    components = False
    yield from words[:1]
    for word in words[2:]:
        if word in ("UM", "ALPHA"):
            return
        if is_number(word) and not components:
            yield word
        components = not components and bool(word) and not is_number(word)
