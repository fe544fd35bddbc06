"""Wavefront .obj files: lines `v x y z [w | r g b]`, `f a/ta/na b/tb/nb ...`, `l a b ...`, `p a ...`.

Source: Wavefront, "Object Files (.obj)", Advanced Visualizer Manual, appendix B1.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.text import Spans, first_words, in_line, integers_at, line_words

_CONTINUED = re.compile(rb"#[^\r\n]*|\\[ \t]*(?:\r\n|\r|\n)")  # or a comment, which is not
_COMMA = re.compile(rb"(?:^|[\r\n])[ \t]*[vflp]\b[^\r\n#]*(,)")  # no part of a number, but the kernels end words there
_NAME_END = re.compile(rb"[\r\n#]")
MATERIAL = "obj:material"
_UNTOLD = {
    "objects and groups": {b"o", b"g"}, "materials": {b"usemtl", b"mtllib"}, "smoothing groups": {b"s"},
    "texture coordinates": {b"vt"}, "normals": {b"vn"},
}  # fmt: skip
_CORNERS = {b"f": 3, b"l": 2, b"p": 1}  # at least
_NAMES = {b"f": "face", b"l": "line", b"p": "point"}
_TYPES = {(b"f", 3): "triangle", (b"f", 4): "quad", (b"l", 2): "line"}
_LARGER = {b"f": "polygon", b"l": "polyline", b"p": "vertex"}


def parse(data: bytes) -> Source:
    """Read vertices, faces, lines and points."""
    original = data
    if b"\\" in data:
        data = _CONTINUED.sub(lambda end: end[0] if end[0][:1] == b"#" else b" " * len(end[0]), data)
    comma = _COMMA.search(data) if b"," in data else None
    if comma:
        raise in_line(data, comma.start(1), "there is a comma between the numbers")
    ends, keywords = first_words(data)
    at = {keyword: ends[keywords == keyword] for keyword in (b"v", *_CORNERS)}
    coordinates = Places.of_text(_coordinates(data, at[b"v"]))
    cells, corners, labels = [], [], []
    uses = ends[keywords == b"usemtl"]
    materials = _materials(data, uses)
    for keyword, minimum in _CORNERS.items():
        for rows, spans in _runs(data, at[keyword]):
            count = spans.shape[1]
            if count < minimum:
                what = f"a {_NAMES[keyword]} of {counted(count, 'vertex', 'vertices')}"
                raise in_line(data, int(at[keyword][rows[0]]), what)
            before = np.searchsorted(at[b"v"], at[keyword][rows])
            vertices = _vertices(data, spans, before, len(at[b"v"]))
            if keyword == b"p":  # as many cells as there are numbers
                vertices, rows = vertices.reshape(-1, 1), np.repeat(rows, count)
            labels.append(materials[np.searchsorted(uses, at[keyword][rows])])
            cells.append(Cells(_TYPES.get((keyword, count), _LARGER[keyword]), vertices, rows))
            corners.append(partial(Places.of_text, spans, "i8"))
    untold = _untold(data, coordinates, set(np.unique(keywords).tolist()))
    layout, regions = InPlace(original, coordinates, corners), (MATERIAL,) if len(uses) else ()
    load = lambda: Arrays(cell=dict.fromkeys(regions, labels))  # noqa: E731
    return Source(coordinates.read(data), cells, layout, load, regions, untold=untold)


def _materials(data: bytes, uses: NDArray[np.int64]) -> NDArray[np.int64]:
    """Numbers of the materials: 0 before the first `usemtl`, then that of the name behind each."""
    names = [_NAME_END.split(data[at : at + 999], 1)[0].strip() for at in uses.tolist()]
    return np.concatenate([[0], 1 + np.unique(np.array(names, dtype="S"), return_inverse=True)[1]])


def _coordinates(data: bytes, at: NDArray[np.int64]) -> Spans:
    spans = line_words(data, at, 3)
    if not len(spans):
        raise ReadError("is not a readable obj file: it has no vertices")
    raw = np.frombuffer(data, dtype=np.uint8)
    short = (spans[..., 0] < 0) | (raw[spans[..., 0]] == ord("#"))
    if short[:, 2].all() and not short[:, :2].any():  # as some programs write meshes in the plane
        return spans[:, :2]
    short = short.any(axis=1)
    if short.any():
        raise in_line(data, int(at[short.argmax()]), "a vertex of less than three coordinates")
    return spans


def _runs(data: bytes, at: NDArray[np.int64]) -> Iterator[tuple[NDArray[np.int64], Spans]]:
    """Group lines by their number of corners: rows (m,) of the lines, and spans (m, k, 2) of the corners."""
    raw = np.frombuffer(data, dtype=np.uint8)
    rows, width = np.arange(len(at)), 4
    while len(rows):
        spans = line_words(data, at[rows], width + 1)
        behind = (spans[:, :, 0] < 0) | (raw[spans[:, :, 0]] == ord("#"))
        counts = np.where(behind.any(axis=1), behind.argmax(axis=1), width + 1)
        for count in np.unique(counts[counts <= width]).tolist():
            yield rows[counts == count], spans[counts == count, :count]
        rows, width = rows[counts > width], 2 * width


def _vertices(data: bytes, spans: Spans, before: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Rows of the points: from 1 in the file, or negative, from the last vertex `before` the line."""
    numbers = integers_at(data, spans, slash=True)
    rows = np.where(numbers < 0, before[:, None] + numbers, numbers - 1)
    outside = (rows < 0) | (rows >= n)
    if outside.any():
        at = int(spans[outside][0, 0])
        raise in_line(data, at, f"there is no vertex {numbers[outside][0]}; the file has {n:,}")
    return rows


def _untold(data: bytes, coordinates: Places, keywords: set[Any]) -> tuple[str, ...]:
    assert coordinates.end is not None
    fourth = line_words(data, coordinates.end[:, -1], 1)[:, 0, 0]
    found = [what for what, names in _UNTOLD.items() if names & keywords]
    if b"#" in data:
        found.insert(0, "comments")
    if (np.frombuffer(data, dtype=np.uint8)[fourth[fourth >= 0]] != ord("#")).any():
        found.append("colours or weights of vertices")
    return tuple(found)
