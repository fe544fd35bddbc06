"""FEBio's .feb files: sections of XML in `Geometry` or `Mesh`, in which each node and element is an XML element.

The text of a node is its coordinates, that of an element its nodes, between commas; the attribute id is their number.
What elements are, their section tells, or in older files their own names. Node sets, element sets and surfaces are
sections as well; older ones have an XML element for each member, newer ones numbers alone.

Source: FEBio, "User's Manual", versions 1.8 to 4, "Geometry section" and "Mesh section"; FEBio, "FEElement.cpp".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs, alike, within, without
from meshfix_cli.meshfile.text import Spans, fields_at, in_line, integers_at

_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_SECTION = re.compile(rb"<(Nodes|Elements|NodeSet|ElementSet|Surface|Edge|DiscreteSet)\b([^<>]*?)(/?)>")
_DOMAIN = re.compile(rb"<(?:Solid|Shell|Beam)Domain\b([^<>]*)>")
_ELSEWHERE = re.compile(rb"<(?:Geometry|Mesh)\b[^<>]*\bfrom\s*=|<(?:Instance|Include)\b|<include\b")
_ATTRIBUTE = re.compile(rb"([\w:]+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")
_KIND = re.compile(r"(tet|hex|penta|pyra|quad|q|tri|line|truss|rb)(\d+)")
_SHAPES = {
    "tet": "tetra", "hex": "hexahedron", "penta": "wedge", "pyra": "pyramid", "quad": "quad", "q": "quad",
    "tri": "triangle", "line": "line", "truss": "line", "rb": "line",
}  # fmt: skip
_HEX27 = [*range(20), 23, 21, 20, 22, 24, 25, 26]  # which node stands in each place of the table of elements
_NAME = 12  # letters by which XML elements are told apart
_MATERIAL = "febio:material"


class _Rows(NamedTuple):
    """The XML elements (n,) of a section: their names, numbers, and the words (k, 2) of their texts.

    Attributes
    ----------
    starts : (n+1,) int64
        The number of the first word of each, and of all words.
    """

    names: NDArray[np.bytes_]
    ids: Int64
    words: Spans
    starts: Int64


class _Section(NamedTuple):
    """A section, its attributes, and where what is in it begins and ends."""

    tag: str
    about: dict[str, str]
    begin: int
    end: int

    @property
    def name(self) -> str:
        """What the file calls it."""
        return self.about.get("name") or self.about.get("elset") or ""


def parse(data: bytes) -> Source:
    """Read nodes and elements; materials are regions, and parts, surfaces and sets are sets."""
    text = without(data, _COMMENT, b"<!--")
    if _ELSEWHERE.search(text):
        raise ReadError("includes other files or instances of parts, which are not read")
    sections = list(_sections(text))
    nodes = [_rows(text, one) for one in sections if one.tag == "Nodes"]
    if not nodes:
        raise ReadError("has no nodes")
    if any((np.diff(rows.starts) != 3).any() for rows in nodes):
        raise ReadError("is not a readable file of FEBio: a node has not three coordinates")
    points = Numbering(np.concatenate([rows.ids for rows in nodes]))
    coordinates = Places.of_text(np.concatenate([rows.words for rows in nodes]).reshape(-1, 3, 2))
    runs, materials = Runs(), _Materials(text)
    for one in (one for one in sections if one.tag == "Elements"):
        _add(runs, text, one, points, materials.of(one))
    elements = [(i, run.ids) for i, run in enumerate(runs.cells) if run.ids is not None]
    point_sets: dict[str, Int64] = {}
    for one in sections:
        if one.tag in ("Surface", "Edge", "DiscreteSet"):
            _add(runs, text, one, points, 0)
        elif one.tag == "NodeSet":
            rows = points.rows_of(_members(text, one))
            point_sets[one.name] = np.unique(rows[rows >= 0])
        elif one.tag == "ElementSet":
            members = _members(text, one)
            for run, ids in elements:
                runs.put(one.name, run, np.flatnonzero(np.isin(ids, members)))
    return Source(
        coordinates.read(text), runs.cells, InPlace(data, coordinates, runs.corners),
        partial(runs.arrays, point_sets), (_MATERIAL,) * bool(elements), untold=("the model",),
        numbers=lambda: points.numbers,
    )  # fmt: skip


def _sections(text: bytes) -> Iterator[_Section]:
    at = 0
    while match := _SECTION.search(text, at):
        at, tag = match.end(), match[1].decode()
        if match[3]:
            continue
        end = text.find(b"</" + match[1], at)
        if end < 0:
            raise ReadError(f"is truncated: a section {tag} does not end")
        yield _Section(tag, _attributes(match[2]), at, end)
        at = end


def _attributes(text: bytes) -> dict[str, str]:
    found = _ATTRIBUTE.findall(text)
    return {name.decode(): (one or other).decode("utf-8", "replace").strip() for name, one, other in found}


class _Materials:
    """The materials of sections of elements, which newer files tell elsewhere by the names of the sections."""

    def __init__(self, text: bytes) -> None:
        found = [_attributes(match[1]) for match in _DOMAIN.finditer(text)]
        self._by_name = {one.get("name", ""): one.get("mat", "") for one in found}
        self._numbers: dict[str, int] = {}

    def of(self, section: _Section) -> int:
        told = section.about.get("mat") or self._by_name.get(section.name)
        return self._numbers.setdefault(told or f"section {section.name or section.begin}", len(self._numbers) + 1)


def _rows(text: bytes, section: _Section) -> _Rows:
    """Read the XML elements of a section, which have no others in them."""
    raw = np.frombuffer(text, np.uint8, section.end - section.begin, section.begin)
    opening, closing = np.flatnonzero(raw == ord("<")), np.flatnonzero(raw == ord(">"))
    fits = len(opening) == len(closing) and (opening < closing).all() and (closing[:-1] < opening[1:]).all()
    if not fits:
        raise in_line(text, section.begin, f"the XML of a section {section.tag} is not well-formed")
    last = raw[np.minimum(opening + 1, len(raw) - 1)] == ord("/")
    first, ends = opening[~last], closing[~last]
    inside = np.zeros(len(raw) + 1, dtype=np.int8)
    inside[opening] += 1
    inside[closing + 1] -= 1
    blank = np.add.accumulate(inside, dtype=np.int8)[:-1].astype(bool)
    words = within(np.where(blank, np.uint8(ord(" ")), raw).tobytes(), 0, len(raw))
    starts = np.append(np.searchsorted(words[:, 0], ends), len(words)) if len(first) else np.zeros(1, dtype=np.int64)
    if len(words) and (not len(first) or starts[0]):
        raise in_line(text, section.begin + int(words[0, 0]), f"a section {section.tag} has a text of its own")
    return _Rows(_names(raw, first), _ids(text, section, raw, first, ends), words + section.begin, starts)


def _names(raw: NDArray[np.uint8], first: Int64) -> NDArray[np.bytes_]:
    """Return the names (n,) of XML elements that begin at some offsets, cut after some letters; of one alone (1,)."""
    if len(first):
        head = raw[first[0] + 1 : first[0] + 1 + _NAME].tobytes().split(b" ")[0]
        if all((raw[np.minimum(first + 1 + i, len(raw) - 1)] == one).all() for i, one in enumerate(head + b" ")):
            return np.array([head], dtype=f"S{_NAME}")
    found, there = np.zeros((len(first), _NAME), dtype=np.uint8), np.ones(len(first), dtype=bool)
    for i in range(_NAME):
        letters = raw[np.minimum(first + 1 + i, len(raw) - 1)]
        there &= (letters > ord(" ")) & (letters != ord(">")) & (letters != ord("/"))
        found[there, i] = letters[there]
    return found.view(f"S{_NAME}")[:, 0]


def _ids(text: bytes, section: _Section, raw: NDArray[np.uint8], first: Int64, ends: Int64) -> Int64:
    """Return the attributes id (n,)."""
    quotes = np.flatnonzero((raw == ord('"')) | (raw == ord("'")))
    each = len(quotes) // max(len(first), 1)
    spans = quotes.reshape(len(first), -1, 2) if each and each % 2 == 0 and len(quotes) == each * len(first) else None
    if not len(first):
        return np.empty(0, dtype=np.int64)
    if spans is None or (spans[:, 0, 0] < first).any() or (spans[:, -1, 1] > ends).any():
        raise in_line(text, section.begin, f"not each XML element in a section {section.tag} has the same attributes")
    for i in range(spans.shape[1]):
        before = spans[:, i, 0][:, None] - np.array([3, 2, 1])
        if (raw[before] == np.frombuffer(b"id=", np.uint8)).all():
            at = spans[:, i] + section.begin + np.array([1, 0])
            found = fields_at(text, at)  # in which blanks may stand
            if (found != np.floor(found)).any() or (np.abs(found) >= 2**53).any():
                raise in_line(text, int(at[0, 0]), f"an id in a section {section.tag} is not an integer")
            return found.astype(np.int64)
    raise in_line(text, section.begin, f"an XML element in a section {section.tag} has no id")


def _members(text: bytes, section: _Section) -> Int64:
    """Return the numbers that a set lists, in XML elements or as they are."""
    if text.find(b"<", section.begin, section.end) >= 0:
        rows = _rows(text, section)
        return rows.ids if not len(rows.words) else integers_at(text, rows.words)
    return integers_at(text, within(text, section.begin, section.end))


def _add(runs: Runs, text: bytes, section: _Section, points: Numbering, material: int) -> None:
    """Add the elements of a section; those of surfaces have no numbers of their own."""
    rows, kind = _rows(text, section), section.about.get("type", "")
    sizes, kinds = np.diff(rows.starts), np.unique(rows.names, return_inverse=True)[1]
    for here in alike(*([kinds] if len(rows.names) > 1 else []), sizes):
        name, size = rows.names[here[0] if len(rows.names) > 1 else 0].decode("latin-1"), int(sizes[here[0]])
        if size < 1:
            raise ReadError(f"is not a readable file of FEBio: an element of the section {section.name!r} has no nodes")
        key = _key(kind if name == "elem" else name, size)
        order = np.array(_HEX27 if key == "hexahedron27" else range(size))
        spans = rows.words[rows.starts[here][:, None] + order]
        vertices = points.points_of(integers_at(text, spans), rows.ids[here])
        ids = rows.ids[here] if section.tag == "Elements" else None
        corners = partial(Places.of_text, spans, "i8")
        runs.add(Cells(key, vertices, ids), corners, {_MATERIAL: material}, (section.name,) if section.name else ())


def _key(kind: str, size: int) -> str:
    """Return the type of elements that a file calls by a name."""
    found = _KIND.match(kind.lower())
    if kind == "delem":
        return "line" if size == 2 else f"line_of_{size}"
    shape = _SHAPES[found[1]] if found else ""
    second = f"{shape}{size}"
    known = {ELEMENTS[shape].nodes: shape} if shape else {}
    if not shape or int(found[2] if found else 0) != size:
        return f"{shape or 'unknown'}_of_{size}"
    return known.get(size) or (second if second in ELEMENTS else f"{shape}_of_{size}")
