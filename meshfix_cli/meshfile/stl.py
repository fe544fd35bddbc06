"""Stereolithography .stl files, text and binary: facets, each with its normal and the coordinates of its corners.

Source: M. Burns, "Automated Fabrication", 1993, section 6.5.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.splice import Edits, Places, Points, Turned, apply, differing
from meshfix_cli.meshfile.text import Spans, first_words, in_line, line_words

_SOLID = re.compile(rb"(?:\xef\xbb\xbf)?\s*solid\b", re.IGNORECASE)
_END = re.compile(rb"(?m)^([ \t]*)end solid")  # as long as the word that is meant
_FACET = np.array([b"facet", b"vertex", b"vertex", b"vertex", b"endfacet"])
_HEAD = 84  # bytes of a binary file before its facets
_BINARY = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_RIGHT = 1e-6  # a component of a normal that is as near as this keeps its bytes


@dataclass(frozen=True, eq=False)
class _Facets:
    """The layout of facets: the coordinates of a point stand at each corner where it is.

    Attributes
    ----------
    data : bytes
    normals : Places
        A row for each facet that has one.
    corners : Places
        Three rows for each facet.
    rows : (m, 3) int64
        Rows of the points.
    bare : (m,) bool
        The facets that have no normal.
    """

    data: bytes
    normals: Places
    corners: Places
    rows: NDArray[np.int64]
    bare: NDArray[np.bool_]

    def rounded(self, points: Points) -> Points:
        """Return points (n, 3) as the file can hold them."""
        return self.corners.rounded(points)

    def rewritten(self, original: Points, points: Points, reversed_cells: Mapping[int, Turned]) -> bytes:
        """Return the file with other points (n, 3) and turned facets, and with the normals of all that changed."""
        rows, turned = self.rows.copy(), np.zeros(len(self.rows), dtype=bool)
        for here, order in reversed_cells.values():
            rows[here], turned[here] = rows[here][:, order], True
        changed = differing(original, points)[rows]
        moved = changed.any(axis=(1, 2))
        changed[turned & moved, :2] = True
        corners = self.corners.replace(changed.reshape(-1, 3), points[rows].reshape(-1, 3))
        normals = self._renewed(turned | moved, points[rows[turned | moved]])
        return apply(self.data, [corners, self._exchanged(turned & ~moved), normals])

    def _exchanged(self, facets: NDArray[np.bool_]) -> Edits:
        """Exchange the first two corners of some facets."""
        here, there = (3 * np.flatnonzero(facets)[:, None] + place for place in ([0, 1], [1, 0]))
        return self.corners.at(here).copied(self.data, self.corners.at(there))

    def _renewed(self, facets: NDArray[np.bool_], corners: Points) -> Edits:
        """Make the normals of some facets, where they have one, those of their corners (k, 3, 3)."""
        places = self.normals.at(facets[~self.bare])
        values = _normals(corners[~self.bare[facets]])
        try:
            with np.errstate(invalid="ignore"):
                wrong = ~(np.abs(places.read(self.data) - values) <= _RIGHT)
        except ReadError:  # "-nan(ind)" and the like
            wrong = np.ones(values.shape, dtype=bool)
        return places.replace(wrong, values)


def parse(data: bytes) -> Source:
    """Read facets; corners with the same coordinates are one point."""
    facets = int.from_bytes(data[80:_HEAD], "little")
    missing = _HEAD + facets * _BINARY.itemsize - len(data)
    if len(data) >= _HEAD and missing == 0:
        return _parse_binary(data, facets)
    if _SOLID.match(data) and b"\0" not in data[:_HEAD]:
        return _parse_text(data)
    if len(data) >= _HEAD and missing > 0:
        lacking = counted(missing, "byte is missing", "bytes are missing")
        raise ReadError(f"is truncated: it announces {counted(facets, 'facet', 'facets')}, for which {lacking}")
    raise ReadError("is not a readable stl file: it is neither text nor as long as its number of facets says")


def _parse_binary(data: bytes, facets: int) -> Source:
    table = np.frombuffer(data[_HEAD:], dtype=_BINARY)
    begin = _HEAD + _BINARY.itemsize * np.arange(facets, dtype=np.int64)
    corners = Places.of_rows((begin[:, None] + np.array([12, 24, 36])).ravel(), 3, "<f4")
    cell = {"attribute": [table["attribute"].astype(np.uint16)]} if table["attribute"].any() else {}
    coordinates = table["corners"].reshape(-1, 3).astype("=f4")
    source = _source(data, Places.of_rows(begin, 3, "<f4"), corners, coordinates, np.zeros(facets, dtype=bool))
    return replace(source, load=lambda: Arrays(cell=cell), untold=("header",) if data[:80].strip(b"\0 ") else ())


def _parse_text(data: bytes) -> Source:
    ends, words = first_words(_END.sub(rb"\1endsolid ", data.lower()))
    _check_keywords(data, ends, words)
    corners = Places.of_text(_numbers(data, ends[words == b"vertex"], 3, "a vertex has not three coordinates"))
    begin = ends[words == b"facet"]
    bare = line_words(data, begin, 1)[:, 0, 0] < 0
    normals = Places.of_text(_numbers(data, begin[~bare], 4, "a facet has not one normal")[:, 1:])
    solids = ends[words == b"solid"]
    source = _source(data, normals, corners, corners.read(data), bare)
    named = (line_words(data, solids, 1) >= 0).any()
    cell = {"stl:solid": [np.searchsorted(solids, begin) - 1]} if len(solids) > 1 else {}
    load = lambda: Arrays(cell=cell)  # noqa: E731
    return replace(source, load=load, regions=tuple(cell), untold=("names of solids",) if named else ())


def _check_keywords(data: bytes, ends: NDArray[np.int64], words: NDArray[np.bytes_]) -> None:
    """Each facet has three vertices, and the last solid ends; what else there is does not matter."""
    which = np.flatnonzero((words == b"facet") | (words == b"vertex") | (words == b"endfacet"))
    facets = len(which) // 5
    wrong = (words[which[: 5 * facets]].reshape(-1, 5) != _FACET).any(axis=1)
    first = int(wrong.argmax()) if wrong.any() else facets
    found = words[which[5 * first : 5 * first + 5]]
    if len(found) and (len(found) == 5 or (found != _FACET[: len(found)]).any()):
        raise in_line(data, int(ends[which[5 * first]]), "a facet begins here that has not three vertices")
    if len(found) or not (words[which[-1] if len(which) else 0 :] == b"endsolid").any():
        raise ReadError("is truncated: its last solid does not end")


def _numbers(data: bytes, at: NDArray[np.int64], count: int, what: str) -> Spans:
    """Spans (k, count, 2) of the words behind some keywords, which have to be as many."""
    spans = line_words(data, at, count + 1)
    bad = (spans[:, count - 1, 0] < 0) | (spans[:, count, 0] >= 0)
    if bad.any():
        raise in_line(data, int(at[bad.argmax()]), what)
    return spans[:, :count]


def _source(data: bytes, normals: Places, corners: Places, coordinates: Points, bare: NDArray[np.bool_]) -> Source:
    first, rows = _merged(coordinates)
    facets = rows.reshape(-1, 3)
    return Source(coordinates[first], [Cells("triangle", facets)], _Facets(data, normals, corners, facets, bare))


def _merged(coordinates: Points) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where each distinct point (n,) appears first, in that order, and the point (k,) at each corner."""
    with np.errstate(invalid="ignore"):
        bits = (coordinates + 0.0).view(f"i{coordinates.itemsize}")  # -0.0 becomes 0.0, and NaN equals itself
    order = np.lexsort(bits.T)
    new = np.ones(len(order), dtype=bool)
    new[1:] = (bits[order[1:]] != bits[order[:-1]]).any(axis=1)
    first = order[new]  # as the sorting is stable
    appearance = np.argsort(first)
    number = np.empty_like(appearance)
    number[appearance] = np.arange(len(first))
    rows = np.empty_like(order)
    rows[order] = number[np.cumsum(new) - 1]
    return first[appearance], rows


def _normals(corners: Points) -> NDArray[np.float64]:
    """Unit normals (k, 3) by the right-hand rule; zero for facets without area."""
    with np.errstate(invalid="ignore", over="ignore"):
        a, b, c = corners.astype(np.float64).transpose(1, 0, 2)
        cross: NDArray[Any] = np.cross(b - a, c - a)
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        return np.divide(cross, length, out=np.zeros_like(cross), where=length > 0) + 0.0
