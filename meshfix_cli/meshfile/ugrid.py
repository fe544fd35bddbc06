"""UGRID files of AFLR, FUN3D and others, in text and binary: seven counts, and numbers without anything between them.

They count nodes, triangles and quadrilaterals of the surface, tetrahedra, pyramids, prisms and hexahedra. Behind them
stand the coordinates, the surface, the numbers of its parts, and the elements. Binary files are a stream, or two
records of Fortran, of either byte order, and the length tells how many bytes an integer and a coordinate have, as the
name does (.b8, .lb4, .r8, .b8l, ...). Some programs append further numbers of elements, which stay.

Source: Mississippi State University, SimCenter, "UG_IO: 3D grid file type UGRID" and "3D input/output grids".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs, rows
from meshfix_cli.meshfile.text import integers, unmarked
from meshfix_cli.meshfile.ugrid_layout import MARKER, SURFACE, VOLUME, binary, sizes

_REF = "ugrid:ref"
_PYRAMID = [1, 0, 3, 4, 2]  # which of its nodes stands in each place of the table of elements


def parse(data: bytes) -> Source:
    """Read nodes and elements; the parts of the surface are sets."""
    form, runs = binary(data), Runs()
    if form is None and b"\0" in data[:64]:
        raise ReadError("is truncated or not readable: its length fits no binary file with its counts")
    if form is not None:
        first = form.begin + 3 * form.real.itemsize * np.arange(form.counts[0])
        coordinates, more = Places.of_rows(first, 3, form.real.str), len(data) > form.end + MARKER
        counts, at = form.counts, form.begin + 3 * form.counts[0] * form.real.itemsize
        listed = np.frombuffer(data, form.integer, sum(sizes(counts)), at).astype(np.int64)
        places = partial(_bytes, form.integer, at)
    else:
        text = unmarked(data)
        values, at = integers(text, 0, 7)
        counts = tuple(values.tolist())
        if min(counts) < 0:
            raise ReadError("is not a readable file of UGRID: one of its counts is below 0")
        spans, at = rows(text, at, counts[0], 3)
        coordinates = Places.of_text(spans)
        listed, end = integers(text, at, sum(sizes(counts)))
        more, places = bool(text[end:].strip()), partial(_words, text, at)
    _add(runs, counts, listed, places)
    return Source(
        coordinates.read(data), runs.cells, InPlace(data, coordinates, runs.corners), runs.arrays,
        (_REF,) if runs.cells else (), untold=("numbers of elements",) * more,
    )  # fmt: skip


def _bytes(integer: np.dtype[Any], at: int, first: int, count: int, columns: int) -> Places:
    starts = at + integer.itemsize * (first + columns * np.arange(count))
    return Places.of_rows(starts, columns, integer.str)


def _words(text: bytes, at: int, first: int, count: int, columns: int) -> Places:
    _, begin = integers(text, at, first)
    return Places.of_text(rows(text, begin, count, columns)[0], "i8")


def _add(runs: Runs, counts: tuple[int, ...], listed: Int64, places: Callable[[int, int, int], Places]) -> None:
    """Add the surface and the elements, whose numbers go on from type to type."""
    points, parts = Numbering(np.arange(1, counts[0] + 1)), sizes(counts)
    starts = np.cumsum([0, *parts]).tolist()
    labels = listed[starts[2] : starts[4]]
    for key, first, count in _blocks(counts, starts):
        columns, solid = ELEMENTS[key].nodes, key in VOLUME
        order = _PYRAMID if key == "pyramid" else list(range(columns))
        nodes = listed[first : first + count * columns].reshape(count, columns)[:, order]
        number = 1 + sum(len(run.vertices) for run in runs.cells if run.type in VOLUME)
        ids, run = np.arange(number, number + count), len(runs.cells)
        mine = np.zeros(count, dtype=np.int64) if solid else labels[:count] if key == "triangle" else labels[-count:]
        corners = partial(_corners, places, first, count, order)
        runs.add(Cells(key, points.points_of(nodes, ids), ids if solid else None), corners, {_REF: mine})
        for surface in () if solid else np.unique(mine).tolist():
            runs.put(f"surface {surface}", run, np.flatnonzero(mine == surface))


def _blocks(counts: tuple[int, ...], starts: list[int]) -> Iterator[tuple[str, int, int]]:
    """Give types, where the first of their integers stands, and how many elements there are."""
    for key, count, first in zip((*SURFACE, *VOLUME), counts[1:], [*starts[:2], *starts[4:8]], strict=True):
        if count:
            yield key, first, count


def _corners(places: Callable[[int, int, int], Places], first: int, count: int, order: list[int]) -> Places:
    return places(first, count, len(order)).at((slice(None), order))
