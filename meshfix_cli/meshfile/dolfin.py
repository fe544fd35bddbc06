"""DOLFIN's .xml files: an element `vertex` for each vertex and one for each cell, whose attributes are the numbers.

Coordinates are x, y and z, vertices v0, v1 and so on, in any order and with any quotes; each has a number, its index.
Cells are of one type, and their numbering does not tell their orientation. Functions and values of the mesh, in it or
beside it, stay as they are; those of cells tell regions apart.

Source: DOLFIN, "XMLMesh.cpp" and "XMLMeshValueCollection.h"; "UFC Specification and User Manual", "Reference cells".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, without
from meshfix_cli.meshfile.text import Spans, in_line, integers_at

_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_SECTION = rb"<(%s)\b((?:[^>\"']|\"[^\"]*\"|'[^']*')*?)(/?)>"
_MESH = re.compile(_SECTION % rb"mesh")
_ATTRIBUTE = re.compile(rb"([\w:]+)\s*=\s*[\"']([^\"']*)[\"']")
_VALUES = re.compile(_SECTION % rb"mesh_(?:value_collection|function)")
_ROOT = re.compile(rb"<dolfin\b[^>]*>\s*<(\w+)")
# The types, and which vertex stands in each place of the table of elements.
_TYPES = {
    "point": ("vertex", [0]), "interval": ("line", [0, 1]), "triangle": ("triangle", [0, 1, 2]),
    "quadrilateral": ("quad", [0, 1, 3, 2]), "tetrahedron": ("tetra", [0, 1, 2, 3]),
    "hexahedron": ("hexahedron", [0, 1, 3, 2, 4, 5, 7, 6]),
}  # fmt: skip
_DOMAINS = "dolfin:domains"
_MOST_BLANKS = 99  # between a name, the = and a quote


def parse(data: bytes) -> Source:
    """Read vertices and cells of the mesh."""
    text = without(data, _COMMENT, b"<!--")
    meshes = list(_MESH.finditer(text))
    if len(meshes) > 1:
        raise ReadError("holds several meshes, and one mesh is read: give each a file of its own")
    if not meshes:
        root = _ROOT.search(text)
        holds = f"a {root[1].decode().replace('_', ' ')} of dolfin" if root else "nothing"
        raise ReadError(f"holds {holds}, and no mesh")
    about = _attributes(meshes[0][2])
    kind, dimension = about.get("celltype", ""), about.get("dim", "")
    if kind not in _TYPES or dimension not in ("1", "2", "3"):
        raise ReadError(f"is not a readable dolfin-xml file: its cells are {kind!r} in {dimension!r} dimensions")
    key, order = _TYPES[kind]
    at = meshes[0].end()
    vertices, at = _rows(text, at, "vertices", ["index", "x", "y", "z"][: 1 + int(dimension)])
    cells, at = _rows(text, at, "cells", ["index", *(f"v{i}" for i in order)])
    coordinates, ids = Places.of_text(vertices[:, 1:]), integers_at(text, cells[:, 0])
    numbering = Numbering(integers_at(text, vertices[:, 0]))
    runs = [Cells(key, numbering.points_of(integers_at(text, cells[:, 1:]), ids), ids)]
    layout = InPlace(data, coordinates, [partial(Places.of_text, cells[:, 1:], "i8")])
    cell = {f"{_DOMAINS}{i or ''}": [values] for i, values in enumerate(_domains(text, key, ids))}
    untold = ("comments",) * (text is not data) + ("functions and values of the mesh",) * bool(_VALUES.search(text))
    return Source(
        coordinates.read(text), runs, layout, partial(Arrays, cell=cell), tuple(cell), untold=untold, oriented=False
    )


def _domains(text: bytes, key: str, ids: Int64) -> Iterator[Int64]:
    """Give the values of cells (m,) in each collection and function that has whole numbers for them; 0: none."""
    for found in _VALUES.finditer(text):
        about = _attributes(found[2])
        whole = about.get("type") in ("int", "uint", "size_t") and about.get("dim") == str(dimension_of(key))
        if not whole or found[3]:
            continue
        index = "cell_index" if found[1] == b"mesh_value_collection" else "index"
        table = integers_at(text, _rows(text, found.start(), found[1].decode(), [index, "value"])[0])
        rows, values = Numbering(ids).rows_of(table[:, 0]), np.zeros(len(ids), dtype=np.int64)
        values[rows[rows >= 0]] = table[rows >= 0, 1]
        yield values


def _attributes(text: bytes) -> dict[str, str]:
    return {name.decode(): value.decode("latin-1") for name, value in _ATTRIBUTE.findall(text)}


def _rows(text: bytes, at: int, section: str, names: list[str]) -> tuple[Spans, int]:
    """Return the spans (n, k, 2) of some attributes of all elements in a section, and the offset of its end."""
    begin = re.compile(_SECTION % section.encode()).search(text, at)
    end = text.find(b"</%s" % section.encode(), begin.end()) if begin else -1
    if begin is None or end < 0:
        raise ReadError(f"is truncated: its {section} do not {'end' if begin else 'begin'}")
    start, sizes = begin.end(), _attributes(begin[2]).get("size", "")
    raw = np.frombuffer(text, np.uint8, end - start, start)
    held = int((raw == ord("<")).sum()) - text.count(b"</", start, end)
    if sizes.isdigit() and held != int(sizes[:18]):
        raise ReadError(f"is truncated or not readable: it announces {int(sizes[:18]):,} {section} and holds {held:,}")
    if not held:
        return np.empty((0, len(names), 2), dtype=np.int64), end
    quotes = np.flatnonzero((raw == ord('"')) | (raw == ord("'")))
    if len(quotes) % (2 * held) or len(quotes) < 2 * held * len(names):
        raise in_line(text, start, f"the {section} have not all the attributes {', '.join(names)}, and no others")
    spans = quotes.reshape(held, -1, 2)
    keys = _keys(raw, spans[..., 0] - 1)
    columns = []
    for name in names:
        word = np.frombuffer(f" {name}".encode(), np.uint8)
        fits = keys == _keys(word, np.array([len(name)]))
        lacking = np.flatnonzero(~fits.any(axis=1))
        if len(lacking):
            raise in_line(text, start + int(spans[lacking[0], 0, 0]), f"there is no attribute {name}")
        columns.append(fits.argmax(axis=1))
    if all((column == column[0]).all() for column in columns):
        found = spans[:, [int(column[0]) for column in columns]]
    else:
        found = spans[np.arange(held)[:, None], np.stack(columns, axis=1)]
    return found + np.array([start + 1, start]), end


def _keys(raw: NDArray[np.uint8], at: Int64) -> NDArray[Any]:
    """Return numbers (...) that tell names apart, their last two letters: those before the = that stands there."""
    at = at.copy()
    for _ in range(_MOST_BLANKS):
        between = (raw[at] == ord("=")) | (raw[at] <= ord(" "))
        if not between.any() or not at.min():
            break
        at -= between
    before = np.maximum(raw[at - 1], ord(" ")).astype(np.uint16)
    return (before << np.uint16(8)) | raw[at]
