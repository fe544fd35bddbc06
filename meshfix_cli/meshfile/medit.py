"""MEDIT .mesh files in text: keywords, each with the number of its rows and with rows of numbers.

Source: L. Maréchal, "Handling unstructured meshes and solutions: libMeshb" (the tables of keywords); P. Frey, "MEDIT:
an interactive mesh visualization software", INRIA RT-0253.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import without
from meshfix_cli.meshfile.text import integers, integers_at, words

_COMMENT = re.compile(rb'#[^\n\r]*|"[^"\n\r]*"')  # or a text, in which the words are no keywords
_KEYWORD = re.compile(rb"(?<![^\s])(?!(?i:nan|inf|infinity)\b)[A-Za-z]\w*")
_VERSION = re.compile(rb"(?:\xef\xbb\xbf)?\s*MeshVersionFormatted\s+([0-4])(?!\S)")
_BINARY = (b"\1\0\0\0", b"\0\0\0\1")
_CELLS = {
    "Edges": ("line", 2), "Triangles": ("triangle", 3), "Quadrilaterals": ("quad", 4), "Tetrahedra": ("tetra", 4),
    "Hexahedra": ("hexahedron", 8), "Hexaedra": ("hexahedron", 8), "Prisms": ("wedge", 6), "Pentahedra": ("wedge", 6),
    "Pyramids": ("pyramid", 5),
    "EdgesP2": ("line3", 3), "TrianglesP2": ("triangle6", 6), "QuadrilateralsQ2": ("quad9", 9),
    "TetrahedraP2": ("tetra10", 10),
    # Of these the order of nodes is not known, and they are held.
    "HexahedraQ2": ("hexahedron_of_27", 27), "PrismsP2": ("wedge_of_18", 18), "PyramidsP2": ("pyramid_of_14", 14),
    "EdgesP3": ("line_of_4", 4), "TrianglesP3": ("triangle_of_10", 10), "QuadrilateralsQ3": ("quad_of_16", 16),
    "TetrahedraP3": ("tetra_of_20", 20), "EdgesP4": ("line_of_5", 5), "TrianglesP4": ("triangle_of_15", 15),
    "QuadrilateralsQ4": ("quad_of_25", 25), "TetrahedraP4": ("tetra_of_35", 35),
}  # fmt: skip
_REF = "medit:ref"


@dataclass(frozen=True, eq=False)
class _Section:
    """A keyword and its rows: integers (n, k); spans (n, k, 2) of vertices; None where the keyword is not known."""

    name: str
    begin: int
    end: int
    rows: Any = None

    @property
    def marks(self) -> str | None:
        """The section whose rows its numbers name as fixed."""
        if self.name == "Corners":
            return "Vertices"
        return self.name.removeprefix("Required") if self.name.startswith("Required") else None


def parse(data: bytes) -> Source:
    """Read vertices and cells; vertices that are required or corners, alone or with their cell, are held."""
    if data[:4] in _BINARY:
        raise ReadError("is a binary file of medit (.meshb), which meshfix does not read")
    text = _without_texts(data)
    version = _VERSION.match(text)
    if version is None:
        raise ReadError("is not a readable medit file: it does not begin with MeshVersionFormatted and a known version")
    sections = list(_sections(text, version.end()))
    vertices = [section for section in sections if section.name == "Vertices"]
    if len(vertices) != 1:
        raise ReadError(f"is not a readable medit file: it has {len(vertices) or 'no'} sections of vertices")
    spans = vertices[0].rows
    coordinates = Places.of_text(spans[:, :-1], "f4" if version[1] == b"1" else "f8")
    runs = [section for section in sections if section.name in _CELLS]
    cells = [Cells(_CELLS[run.name][0], run.rows[:, :-1] - 1) for run in runs]
    arrays = Arrays({_REF: integers_at(text, spans[:, -1])}, {_REF: [run.rows[:, -1] for run in runs]})
    layout = InPlace(data, coordinates, [partial(_corners, text, run) for run in runs])
    held = _held(sections, len(spans))
    return Source(coordinates.read(text), cells, layout, lambda: arrays, (_REF,), held, _untold(sections, b"#" in data))


def promoted(data: bytes) -> bytes:
    """Return the same file with coordinates in double precision."""
    version = _VERSION.match(_without_texts(data))
    if version is None or version[1] != b"1":
        return data
    return data[: version.start(1)] + b"2" + data[version.end(1) :]


def _without_texts(data: bytes) -> bytes:
    """Return the data with blanks in the place of comments and texts, so that all else stands where it stood."""
    return without(data, _COMMENT) if b"#" in data or b'"' in data else data


def _sections(text: bytes, at: int) -> Iterator[_Section]:
    """Read the sections from an offset to the keyword End, or to the end of the text."""
    name, dimension, known = "MeshVersionFormatted", 0, True
    while match := _KEYWORD.search(text, at):
        _check_blank(text[at : match.start()] if known else b"", name)
        name, at = match[0].decode(), match.end()
        if name == "End":
            if b"MeshVersionFormatted" in text[at:]:
                raise ReadError("holds several meshes, and one mesh is read: give each a file of its own")
            return
        if name == "Dimension":
            (dimension, at), known = _integer(text, at), True
            if dimension not in (2, 3):
                raise ReadError(f"is not a readable medit file: its dimension is {dimension}")
            continue
        if name.endswith("Ordering"):
            raise ReadError(f"gives nodes an order of its own ({name}), which meshfix does not read")
        section = _section(text, name, at, dimension)
        known, at = section.rows is not None, section.end
        yield section
    if not known or not text[-1:].isspace():  # else only the word End is missing, which some programs leave out
        raise ReadError(f"is truncated: it ends within {name}")
    _check_blank(text[at:], name)


def _check_blank(text: bytes, name: str) -> None:
    if text.strip():
        raise ReadError(f"is not a readable medit file: {name} has more numbers than it announces")


def _section(text: bytes, name: str, at: int, dimension: int) -> _Section:
    """Read the section whose keyword ends at an offset; of one that is not known only the keyword."""
    if name == "Vertices" and not dimension:
        raise ReadError("is not a readable medit file: the dimension does not stand before the vertices")
    columns = dimension + 1 if name == "Vertices" else _CELLS[name][1] + 1 if name in _CELLS else 1
    if columns == 1 and _Section(name, at, at).marks is None:
        return _Section(name, at, at)
    count, begin = _integer(text, at)
    if not 0 <= count * columns <= len(text) - begin:
        raise ReadError(f"is truncated: {name} announces {counted(count, 'row', 'rows')}")
    if name == "Vertices":
        spans = words(text, begin, count * columns)
        return _Section(name, begin, int(spans.max(initial=begin)), spans.reshape(count, columns, 2))
    values, end = integers(text, begin, count * columns)
    return _Section(name, begin, end, values.reshape(count, columns))


def _integer(text: bytes, at: int) -> tuple[int, int]:
    values, end = integers(text, at, 1)
    return int(values[0]), end


def _corners(text: bytes, run: _Section) -> Places:
    return Places.of_text(words(text, run.begin, run.rows.size).reshape(*run.rows.shape, 2)[:, :-1], "i8")


def _held(sections: Sequence[_Section], n: int) -> NDArray[np.bool_]:
    """Mark the vertices that are corners or required, or belong to a cell that is required."""
    held = np.zeros(n, dtype=bool)
    for mark in sections:
        if mark.marks is None:
            continue
        marked = _marked(sections, mark.marks, n)
        named = mark.rows[:, 0]
        if named.size and not 1 <= named.min() <= named.max() <= len(marked):
            raise ReadError(f"is not a readable medit file: {mark.name} names what is not among its {mark.marks}")
        vertices = marked[named - 1]
        held[vertices[(vertices >= 1) & (vertices <= n)] - 1] = True
    return held


def _marked(sections: Sequence[_Section], name: str, n: int) -> NDArray[np.int64]:
    """Vertices (k, c), from 1, of the rows of a section."""
    if name == "Vertices":
        return np.arange(1, n + 1)[:, None]
    rows = [run.rows[:, :-1] for run in sections if run.name == name and name in _CELLS]
    return np.concatenate(rows) if rows else np.empty((0, 1), dtype=np.int64)


def _untold(sections: Sequence[_Section], comments: bool) -> tuple[str, ...]:
    names = dict.fromkeys(one.name for one in sections if one.name not in _CELLS and one.name != "Vertices")
    return ("comments",) * comments + ((f"sections {', '.join(names)}",) if names else ())
