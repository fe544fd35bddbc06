"""MOVIE.BYU files: counts, the first and the last polygon of each part, the coordinates, and the points of polygons.

The last point of a polygon is negative. Numbers may touch one another, where they fill columns; programs differ in how
wide these are, and some have none.

Source: P. Bourke, "Movie BYU Format"; VTK, "vtkBYUReader.cxx".
"""

from __future__ import annotations

import re
from functools import partial

import numpy as np

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs, alike, are_blank, check_blank, in_columns
from meshfix_cli.meshfile.text import Spans, integers_at, unmarked

_COUNTS = re.compile(rb"\s*(\d{1,18})\s+(\d{1,18})\s+(\d{1,18})\s+(\d{1,18})(?!\S)")
_TYPES = {1: "vertex", 2: "line", 3: "triangle", 4: "quad"}
_PART = "byu:part"
_LEAST = 8  # columns that a number needs


def parse(data: bytes) -> Source:
    """Read points and polygons; parts are regions where there are several."""
    text = unmarked(data)
    counts = _COUNTS.match(text)
    if counts is None:
        raise ReadError("is not a readable file of MOVIE.BYU: it does not begin with four counts")
    parts, n, m, size = (int(word) for word in counts.groups())
    if 2 * parts + 3 * n + size > len(data):
        raise ReadError(f"is truncated: {counted(n, 'point', 'points')} announced, and not all are there")
    words = _words(text, counts.end())
    if len(words) < 2 * parts + 3 * n + size:
        raise ReadError(f"is truncated: {counted(n, 'point', 'points')} announced, and not all numbers are there")
    behind = 2 * parts + 3 * n + size
    check_blank(data, int(words[behind - 1, 1]) if behind else counts.end())
    ranges = integers_at(data, words[: 2 * parts]).reshape(parts, 2)
    coordinates = _places(data, words[2 * parts :][: 3 * n].reshape(n, 3, 2))
    runs = _polygons(data, words[2 * parts + 3 * n : behind], n, m, ranges)
    return Source(
        coordinates.read(data), runs.cells, InPlace(data, coordinates, runs.corners), runs.arrays,
        (_PART,) * (parts > 1 and bool(runs.cells)),
    )  # fmt: skip


def _words(data: bytes, begin: int) -> Spans:
    """Find all numbers; a sign behind a digit begins the next."""
    found = kernels.find_words(data, begin, len(data))
    raw = np.frombuffer(data, dtype=np.uint8)
    before, here = raw[:-1], raw[1:]
    digits = ((before >= ord("0")) & (before <= ord("9"))) | (before == ord("."))
    cuts = np.flatnonzero(digits & ((here == ord("-")) | (here == ord("+")))) + 1
    cuts = cuts[cuts > begin]
    begins, ends = (np.sort(np.concatenate([found[:, i], cuts])) for i in range(2))
    return np.stack([begins, ends], axis=1)


def _places(data: bytes, spans: Spans) -> Places:
    """Return the places of coordinates (n, 3, 2), in columns of one width where they stand so.

    A blank is left in front of each in columns, and of each that touches the number before it.
    """
    begin, end = spans[..., 0], spans[..., 1]
    width = int(spans[0, 1, 1] - spans[0, 0, 1]) if spans.size else 0
    columns = in_columns(data, spans, width) if width > _LEAST else None
    if columns is not None:
        widths = np.full(begin.shape, width)
        return Places(columns[..., 0], columns[..., 1], np.dtype("f8"), width - 1, "free", widths)
    touching = ~are_blank(data, begin - 1)
    if not touching.any():
        return Places.of_text(spans, "f8", 25, "free")
    longest = int((end - begin)[touching].min()) - 1
    if longest < _LEAST:
        raise ReadError("has numbers that touch one another, and too few columns for others in their place")
    return Places(begin, end, np.dtype("f8"), longest, "free", np.where(touching, end - begin, 0))


def _polygons(data: bytes, words: Spans, n: int, m: int, ranges: Int64) -> Runs:
    numbers = integers_at(data, words)
    ends = np.flatnonzero(numbers < 0) + 1
    if len(ends) != m or (ends[-1:] != len(numbers)).any():
        raise ReadError(f"is not a readable file of MOVIE.BYU: there are not the {m:,} polygons that it announces")
    starts = np.concatenate([[0], ends[:-1]]).astype(np.int64)
    labels = np.zeros(m, dtype=np.int64)
    for part, (first, last) in enumerate(ranges.tolist(), start=1):
        labels[max(first - 1, 0) : max(last, 0)] = part
    runs, numbering = Runs(), Numbering(np.arange(1, n + 1))
    for rows in alike(ends - starts):
        count = int(ends[rows[0]] - starts[rows[0]])
        at = starts[rows][:, None] + np.arange(count)
        cells = Cells(_TYPES.get(count, "polygon"), numbering.points_of(np.abs(numbers[at]), rows + 1), rows + 1)
        several = len(ranges) > 1
        runs.add(cells, partial(_corners, data, words[at], count), {_PART: labels[rows]} if several else {})
        for part in np.unique(labels[rows]).tolist() if several else ():
            runs.put(f"part {part}", len(runs.cells) - 1, np.flatnonzero(labels[rows] == part))
    return runs


def _corners(data: bytes, spans: Spans, count: int) -> Places:
    """Of triangles the last point stays the last when they are turned; that of others has the sign."""
    if count != 3:
        raise ReadError("has polygons that are no triangles, and they cannot be renumbered")
    width = int(spans[0, 1, 1] - spans[0, 0, 1]) if spans.size else 0
    columns = in_columns(data, spans, width) if width else None
    return Places.of_text(spans if columns is None else columns, "i8")
