"""MEDIT's files in text, .mesh: keywords, each with the number of its rows and with rows of numbers.

A point has its coordinates and a reference, a cell its points and a reference.

Source: L. Maréchal, "Handling unstructured meshes and solutions: libMeshb" (the tables of keywords); P. Frey, "MEDIT:
an interactive mesh visualization software", INRIA RT-0253.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.medit.sections import CELLS, Section, check_dimension, columns_of, source_of
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.splice import Places
from meshfix_cli.meshfile.tables import without
from meshfix_cli.meshfile.text import integers, integers_at, words

_COMMENT = re.compile(rb'#[^\n\r]*|"[^"\n\r]*"')  # or a text, in which the words are no keywords
_KEYWORD = re.compile(rb"(?<![^\s])(?!(?i:nan|inf|infinity)\b)[A-Za-z]\w*")
_VERSION = re.compile(rb"(?:\xef\xbb\xbf)?\s*MeshVersionFormatted\s+([0-4])(?!\S)")


def parse(data: bytes) -> Source:
    """Read vertices and cells."""
    text = _without_texts(data)
    version = _VERSION.match(text)
    if version is None:
        raise ReadError("is not a readable medit file: it does not begin with MeshVersionFormatted and a known version")
    sections = list(_sections(text, version.end(), "f4" if version[1] == b"1" else "f8"))
    return source_of(data, sections, comments=b"#" in data)


def promoted(data: bytes) -> bytes:
    """Return the same file with coordinates in double precision."""
    version = _VERSION.match(_without_texts(data))
    if version is None or version[1] != b"1":
        return data
    return data[: version.start(1)] + b"2" + data[version.end(1) :]


def _without_texts(data: bytes) -> bytes:
    """Return the data with blanks in the place of comments and texts, so that all else stands where it stood."""
    return without(data, _COMMENT) if b"#" in data or b'"' in data else data


def _sections(text: bytes, at: int, kind: str) -> Iterator[Section]:
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
            check_dimension(dimension)
            continue
        section, at = _section(text, name, at, dimension, kind)
        known = section.rows is not None
        yield section
    if not known or not text[-1:].isspace():  # else only the word End is missing, which some programs leave out
        raise ReadError(f"is truncated: it ends within {name}")
    _check_blank(text[at:], name)


def _check_blank(text: bytes, name: str) -> None:
    if text.strip():
        raise ReadError(f"is not a readable medit file: {name} has more numbers than it announces")


def _section(text: bytes, name: str, at: int, dimension: int, kind: str) -> tuple[Section, int]:
    """Read the section whose keyword ends at an offset, and return where it ends; of one that is not known its name."""
    if name == "Vertices" and not dimension:
        raise ReadError("is not a readable medit file: the dimension does not stand before the vertices")
    columns = columns_of(name, dimension) + dimension * (name == "Vertices")
    if not columns:
        return Section(name), at
    count, begin = _integer(text, at)
    if not 0 <= count * columns <= len(text) - begin:
        raise ReadError(f"is truncated: {name} announces {counted(count, 'row', 'rows')}")
    if name == "Vertices":
        spans = words(text, begin, count * columns).reshape(count, columns, 2)
        places = partial(Places.of_text, spans[:, :-1], kind)
        return Section(name, integers_at(text, spans[:, -1:]), places), int(spans.max(initial=begin))
    values, end = integers(text, begin, count * columns)
    rows = values.reshape(count, columns)
    return Section(name, rows, partial(_corners, text, begin, *rows.shape) if name in CELLS else None), end


def _integer(text: bytes, at: int) -> tuple[int, int]:
    values, end = integers(text, at, 1)
    return int(values[0]), end


def _corners(text: bytes, begin: int, count: int, columns: int) -> Places:
    return Places.of_text(words(text, begin, count * columns).reshape(count, columns, 2)[:, :-1], "i8")
