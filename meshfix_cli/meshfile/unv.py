"""I-deas's universal files: data sets between lines of -1, each with a number that tells what is in it.

A point has four integers, its number and that of its coordinate system among them, and three coordinates; an element
its number, what it is, its property and its material, how many points it has, and these, on as many lines as they take.
Numbers fill columns, of 10 and of 25. What points and elements belong to, groups tell.

Source: University of Cincinnati, SDRL, "Universal File Formats", data sets 15, 781, 2411, 780, 2412, 2420, 2467.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs, alike, in_columns, right_aligned, within
from meshfix_cli.meshfile.text import in_line, integers, integers_at

_EDGE = re.compile(rb"-1[ \t]*(?=[\n\r]|\Z)")  # where nothing stands before it in its line
_NUMBER = re.compile(rb"\s*(\d{1,9})[^\n\r]*")
_POINTS = (15, 781, 2411)
# The columns of property, material and number of points, which is the last before the points.
_ELEMENTS = {780: (3, 5, 7), 2412: (2, 3, 5)}
_OTHERS = (71,)  # elements as well
# How many numbers tell a member of a group; the first two are its kind and its number.
_GROUPS = {2417: 2, 2429: 2, 2430: 2, 2432: 2, 2435: 4, 2452: 4, 2467: 4, 2477: 4}
_SYSTEMS = 2420
_CURVED = {1: "cylindrical", 2: "spherical"}
_NODE, _ELEMENT = 7, 8  # kinds of members
_BEAMS = frozenset({11, 21, 22, 23, 24})  # which have three more numbers before their points
_HEAD = re.compile(rb"\s*(-?\d+)(?:[ \t]+-?\d+){6}[ \t]+(\d{1,18})[ \t]*(?:\r\n|[\n\r])([^\n\r]*)")
_PROPERTY, _MATERIAL, _GROUP = "unv:property", "unv:material", "unv:group"
# Which of its points, in their order around an element, stands in each place of the table of elements.
_LINES = {2: ("line", [0, 1]), 3: ("line3", [0, 2, 1])}
_PLANES = {
    3: ("triangle", [0, 1, 2]), 4: ("quad", [0, 1, 2, 3]), 6: ("triangle6", [0, 2, 4, 1, 3, 5]),
    8: ("quad8", [0, 2, 4, 6, 1, 3, 5, 7]),
}  # fmt: skip
_SOLIDS = {
    4: ("tetra", [*range(4)]), 5: ("pyramid", [*range(5)]), 6: ("wedge", [*range(6)]), 8: ("hexahedron", [*range(8)]),
    10: ("tetra10", [0, 2, 4, 9, 1, 3, 5, 6, 7, 8]),
    15: ("wedge15", [0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8]),
    20: ("hexahedron20", [0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11]),
}  # fmt: skip


class _DataSet(NamedTuple):
    """What stands between two lines of -1, behind its number."""

    number: int
    begin: int
    end: int


def parse(data: bytes) -> Source:
    """Read points and elements; groups are sets, and materials of a file whose elements are told apart by them."""
    sets = list(_data_sets(data))
    tables = [_points(data, one) for one in sets if one.number in _POINTS]
    if not tables:
        raise ReadError("is truncated or not readable: it has no data set of points (2411)")
    spans = np.concatenate(tables)
    _check_systems(data, sets, spans)
    points, coordinates, runs = Numbering(integers_at(data, spans[:, 0])), right_aligned(data, spans[:, 4:]), Runs()
    for one in sets:
        if one.number in _OTHERS:
            raise ReadError(f"has elements in the data set {one.number}, which is not read")
        if one.number in _ELEMENTS:
            _add(runs, data, one, points)
    names = [group for one in sets if one.number in _GROUPS for group in _groups(data, one)]
    regions = (_PROPERTY, _MATERIAL, *((_GROUP,) if names else ())) if runs.cells else ()
    read = {*_POINTS, *_ELEMENTS, *_GROUPS, _SYSTEMS}
    others = ", ".join(str(one.number) for one in sets if one.number not in read)
    return Source(
        coordinates.read(data), runs.cells, InPlace(data, coordinates, runs.corners),
        partial(_arrays, runs, names, points), regions, untold=(f"data sets {others}",) * bool(others),
        numbers=lambda: points.numbers,
    )  # fmt: skip


def _data_sets(data: bytes) -> Iterator[_DataSet]:
    edges = [found.span() for found in _EDGE.finditer(data) if _begins_line(data, found.start())]
    for i in range(0, len(edges), 2):
        begin = edges[i][1]
        number = _NUMBER.match(data, begin)
        if number is None:
            raise in_line(data, begin, "a data set has no number")
        if i + 1 == len(edges):
            raise ReadError(f"is truncated: the data set {int(number[1])} does not end")
        yield _DataSet(int(number[1]), number.end(), edges[i + 1][0])


def _begins_line(data: bytes, at: int) -> bool:
    before = data[max(at - 80, 0) : at].rstrip(b" \t").removeprefix(b"\xef\xbb\xbf")
    return not before or before[-1:] in b"\n\r"


def _points(data: bytes, one: _DataSet) -> Int64:
    """Find the words (n, 7, 2) of points."""
    spans = within(data, one.begin, one.end)
    if len(spans) % 7:
        raise in_line(data, one.begin, "there are not 7 numbers for each point of the data set")
    return spans.reshape(-1, 7, 2)


def _check_systems(data: bytes, sets: Sequence[_DataSet], points: Int64) -> None:
    """Raise ReadError where coordinates say little without their system."""
    used = np.unique(integers_at(data, points[:, 1])).tolist()
    if len(used) > 1:
        named = ", ".join(map(str, used))
        raise ReadError(f"has points in several coordinate systems ({named}), which meshfix does not compare")
    for one in sets:
        listed = data[one.begin : one.end].split(b"\n")[3::6] if one.number == _SYSTEMS else []
        for words in filter(lambda words: len(words) > 1 and words[0].isdigit(), map(bytes.split, listed)):
            if int(words[0]) in used and words[1] in (b"1", b"2"):
                name = f"{_CURVED[int(words[1])]} system ({int(words[0])})"
                raise ReadError(f"has its points in a {name}, which meshfix does not read")


def _add(runs: Runs, data: bytes, one: _DataSet, points: Numbering) -> None:
    """Add the elements of a data set."""
    values, end, _ = kernels.scan_integers(data[one.begin : one.end], 0, one.end - one.begin)
    if data[one.begin + end : one.end].strip():
        integers(data, one.begin + end, 1)  # which says what it is
    heads, nodes = _records(values.data, _ELEMENTS[one.number][2])
    ids, kinds, properties, materials, sizes = (
        values[heads + column].astype(np.int64) for column in (0, 1, *_ELEMENTS[one.number])
    )
    for rows in alike(np.where(kinds < 200, kinds // 10, 20), sizes):
        key, order = _type(int(kinds[rows[0]]), int(sizes[rows[0]]))
        if not key:
            what = f"elements of the type {kinds[rows[0]]} with {sizes[rows[0]]} points are not known"
            raise in_line(data, int(within(data, one.begin, one.end)[heads[rows[0]], 0]), what)
        places = nodes[rows][:, None] + np.array(order)
        vertices = points.points_of(values[places].astype(np.int64, copy=False), ids[rows])
        labels = {_PROPERTY: properties[rows], _MATERIAL: materials[rows]}
        runs.add(Cells(key, vertices, ids[rows]), partial(_corners, data, one, places), labels)


def _records(values: memoryview, last: int) -> tuple[Int64, Int64]:
    """Return where the numbers of each element begin, and those of its points."""
    heads, nodes, at = [], [], 0
    while at + last < len(values):
        head = last + 1 + 3 * (values[at + 1] in _BEAMS)
        heads.append(at)
        nodes.append(at + head)
        at += head + max(values[at + last], 0)
    if at != len(values):
        raise ReadError("is not a readable file: the elements do not add up")
    return np.array(heads, dtype=np.int64), np.array(nodes, dtype=np.int64)


def _type(kind: int, size: int) -> tuple[str, Sequence[int]]:
    """Return the type of elements by their number, and the order of their points; "": unknown."""
    types = _LINES if kind < 40 else _PLANES if kind < 100 else _SOLIDS if kind < 120 else {}
    if 120 <= kind < 200 and size > 0:  # rigid bars, springs, masses, constraints
        return "vertex" if size == 1 else _LINES.get(size, (f"curve{size}", ()))[0], range(size)
    return types.get(size, ("", ()))


def _corners(data: bytes, one: _DataSet, places: Int64) -> Places:
    spans = within(data, one.begin, one.end)[places]
    columns = in_columns(data, spans, 10)
    return Places.of_text(spans if columns is None else columns, "i8")


def _groups(data: bytes, one: _DataSet) -> Iterator[tuple[str, Int64]]:
    """Give the names of groups, and the kinds and numbers (k, 2) of their members."""
    at = one.begin
    while data[at : one.end].strip():
        head = _HEAD.match(data, at, one.end)
        if head is None:
            raise in_line(data, at + 1, "a group does not begin with eight numbers and a line for its name")
        columns, count = _GROUPS[one.number], int(head[2])
        if count * columns > one.end - at:
            raise ReadError(f"is truncated: {count:,} members of a group are announced, and not all are there")
        name = head[3].decode("utf-8", "replace").strip() or f"group {int(head[1])}"
        values, at = integers(data, head.end(), count * columns)
        yield name, values.reshape(count, columns)[:, :2]


def _arrays(runs: Runs, groups: Sequence[tuple[str, Int64]], points: Numbering) -> Arrays:
    """Put the members of groups into sets; cells of the same groups are of one region, as in families of MED."""
    none = np.empty(0, dtype=np.int64)
    elements = Numbering(np.concatenate([none, *(run.ids for run in runs.cells if run.ids is not None)]))
    ends = np.cumsum([0, *(len(run.vertices) for run in runs.cells)])
    point_sets: dict[str, Int64] = {}
    cell_sets: dict[str, Int64] = {}
    for name, members in groups:
        for kind, numbering, found in ((_NODE, points, point_sets), (_ELEMENT, elements, cell_sets)):
            rows = numbering.rows_of(members[members[:, 0] == kind, 1])
            if len(rows := rows[rows >= 0]) or kind == _ELEMENT:
                found[name] = np.union1d(found.get(name, none), rows)
    arrays, regions = runs.arrays(point_sets), np.zeros(ends[-1], dtype=np.int64)
    for rows in cell_sets.values():
        regions *= 2
        regions[rows] += 1
        regions = np.unique(regions, return_inverse=True)[1].reshape(-1)
    cell: Mapping[str, Sequence[Int64]] = {_GROUP: np.split(regions, ends[1:-1])} if groups else {}
    by_run = {
        name: [rows[slice(*np.searchsorted(rows, ends[i : i + 2]))] - ends[i] for i in range(len(ends) - 1)]
        for name, rows in cell_sets.items()
    }
    return Arrays(cell={**arrays.cell, **cell}, cell_sets=by_run, point_sets=point_sets)
