"""Abaqus .inp files: lines `*KEYWORD, PARAMETER=value, ...`, each with data lines of numbers between commas.

Source: Dassault Systèmes, "Abaqus Keywords Reference Guide" and "Input Syntax Rules"; G. Dhondt, "CalculiX CrunchiX
User's Manual".
"""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.abaqus.include import inclusions, read_together
from meshfix_cli.meshfile.abaqus.keywords import Block, Deck, read_deck
from meshfix_cli.meshfile.abaqus.sets import SECTION, Labels, arrays
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.text import Spans, integers_at, line_words

_LONGEST = 20  # characters of a number
_EMPTY_FIELD = re.compile(rb",[ \t]*,")
_FACE = re.compile(
    rb",[ \t]*(?:(?:HP|TRVEC|TRSHR|ED(?:LD|NOR|SHR|TRA|MOM)|[SPFRE])[1-6]|[SPFR](?:POS|NEG))(?:NU|FC|TU)?\b",
    re.IGNORECASE,
)

# Families of elements, behind which the number of nodes tells the shape; all others only hold their nodes.
_SOLID = re.compile(r"(?:[A-Z]{0,3}C3D|F3D|Q3D|SC)(4|5|6|8|10|15|20)(?![\dV])")
_PLANE = re.compile(r"(?:CPS|CPEG?|(?:DC?|A|CG)?CAX|CGAX|[A-Z]{0,2}C2D|WARP2D|M3D|R3D|SFM3D|D?S|STRI)(3|4|6|8|9)(?!\d)")
SOLIDS = {4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10", 15: "wedge15", 20: "hexahedron20"}
# Solids that may lack some of their nodes: they are held, and named as what they are.
_LACKING = {"C3D15V": "wedge", "C3D27": "hexahedron"}
PLANES = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9"}


def parse(data: bytes, path: Path | None = None) -> Source:
    """Read nodes and elements, also those of files that are included; nodes of different parts are different points."""
    return read_together(data, path, _parsed) if inclusions(data) else _parsed(data)


def _parsed(data: bytes) -> Source:
    deck = read_deck(data)
    coordinates, numbers, nodes = _nodes(deck)
    blocks = [*deck.of("ELEMENT")]
    cells = [_cells(deck, block, nodes) for block in blocks]
    layout = InPlace(data, coordinates, [partial(_corners, deck, block) for block in blocks])
    counts = [len(run.vertices) for run in cells]
    elements = Labels({block: run.ids for block, run in zip(blocks, cells, strict=True) if run.ids is not None})
    sections = [block for block in deck.blocks if block.keyword.endswith("SECTION") and "ELSET" in block.parameters]
    if not sections:  # the mesh of another file: its sets are all that tells materials apart
        sections = [block for block in blocks if "ELSET" in block.parameters]
        if len({block.parameters["ELSET"].upper() for block in sections}) < 2:  # one set of all tells nothing
            sections = [block for block in deck.of("ELSET") if "ELSET" in block.parameters]
    load = partial(arrays, deck, nodes, elements, counts, sections)
    points = coordinates.read(deck.text)
    notes = (
        "instances are not moved to their places in the assembly: coordinates are those of the parts",
    ) * deck.placed + ("its last line does not end, as if the file had been cut there",) * deck.open_end
    notes += ("its steps include other files, which are left where they are",) * deck.included_by_steps
    untold = deck.untold()
    apart = sum(1 for _ in deck.of("PART")) > 1
    return Source(
        points, cells, layout, load, (SECTION,) * bool(sections), None, untold, notes, lambda: numbers, apart=apart
    )


def _nodes(deck: Deck) -> tuple[Places, NDArray[np.int64], Labels]:
    """Find the coordinates (n, 2 or 3) of all nodes, and their numbers (n,), also those of each part."""
    spans, numbers = [], {}
    for block in deck.of("NODE"):
        if block.parameters.get("SYSTEM", "R").upper() != "R":
            raise ReadError("uses *NODE with SYSTEM=, which meshfix does not read")
        lines = line_words(deck.text, deck.lines(block), 4)
        lines = lines[lines[:, 0, 0] >= 0]
        if (lines[:, 2, 0] < 0).any() or _EMPTY_FIELD.search(deck.text, block.begin, block.end):
            raise ReadError("is not a readable Abaqus file: there are nodes without all coordinates")
        spans.append(lines[:, 1:])
        numbers[block] = integers_at(deck.text, lines[:, 0])
    if not any(map(len, spans)):
        raise ReadError("is not a readable Abaqus file: it has no nodes")
    labels = Labels(numbers)
    if (number := labels.twice()) is not None:
        raise ReadError(f"is not a readable Abaqus file: the node {number} is defined twice")
    places = Places.of_text(_same_length(deck.text, np.concatenate(spans)), longest=_LONGEST)
    return places, np.concatenate([*numbers.values()]), labels


def _same_length(text: bytes, spans: Spans) -> Spans:
    """Leave out the third coordinate (n, 3, 2) in a plane model, where reference points may have one, of 0."""
    spatial = spans[:, 2, 0] >= 0
    if spatial.all():
        return spans
    if Places.of_text(spans[spatial, 2:]).read(text).any():
        raise ReadError("is not a readable Abaqus file: some nodes have two coordinates, and others three")
    return spans[:, :2]


def _cells(deck: Deck, block: Block, nodes: Labels) -> Cells:
    name = block.parameters.get("TYPE", "").upper()
    if not name:
        raise ReadError("is not a readable Abaqus file: there is *ELEMENT without TYPE")
    kind, corners = _shape(name)
    if not corners:
        return _other_cells(deck, block, nodes, name)
    spans = deck.words(block)
    if not _is_aligned(deck, block, spans, corners + 1):
        raise ReadError(f"is truncated or not readable: a {name} element has not {corners} nodes")
    rows = integers_at(deck.text, spans).reshape(-1, corners + 1)
    ids = np.ascontiguousarray(rows[:, 0])
    return Cells(kind, _vertices(nodes, block.scope, rows[:, 1:], ids), ids)


def _shape(name: str) -> tuple[str, int]:
    """Return what elements are for meshio, and the number of their nodes; 0: not known."""
    if name.startswith("STRI65"):
        return "triangle6", 6
    for family, shapes in ((_SOLID, SOLIDS), (_PLANE, PLANES)):
        if match := family.match(name):
            return shapes[int(match[1])], int(match[1])
    return "", 0


def _is_aligned(deck: Deck, block: Block, spans: Spans, columns: int) -> bool:
    """Whether words are rows without gaps, each of which begins on a line of its own, and may take several."""
    if len(spans) % columns or _EMPTY_FIELD.search(deck.text, block.begin, block.end):
        return False
    ends = deck.line_ends(block)
    before, after = spans[columns - 1 : -1 : columns, 1], spans[columns::columns, 0]
    return bool((np.searchsorted(ends, before) < np.searchsorted(ends, after)).all())


def _vertices(nodes: Labels, scope: str, numbers: NDArray[np.int64], elements: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows of the points of nodes (m, k) of elements (m,); -1 for the number 0, which stands for no node."""
    rows = nodes.rows_of(scope, numbers)
    unknown = np.argwhere((rows < 0) & (numbers != 0))
    if len(unknown):
        i, j = unknown[0]
        raise ReadError(
            f"is truncated or not readable: the element {elements[i]} names the node {numbers[i, j]}, and there is none"
        )
    return rows


def _corners(deck: Deck, block: Block) -> Places:
    if _FACE.search(deck.text):
        raise ReadError("names faces of elements (S1, P2, ...), which would be others if elements were renumbered")
    columns = _shape(block.parameters["TYPE"].upper())[1] + 1
    return Places.of_text(deck.words(block).reshape(-1, columns, 2)[:, 1:], "i8")


def _other_cells(deck: Deck, block: Block, nodes: Labels, name: str) -> Cells:
    """Read elements of any number of nodes: springs, masses, connectors, beams, ..."""
    spans, starts = _lines_of_words(deck, block)
    ids, counts = integers_at(deck.text, spans[starts]), np.diff(starts, append=len(spans)) - 1
    vertices = _named_vertices(deck, block, nodes, np.delete(spans, starts, axis=0), np.repeat(ids, counts))
    held = f"{next((shape for begin, shape in _LACKING.items() if name.startswith(begin)), 'abaqus')}:{name}"
    if len({*counts.tolist()}) != 1:
        return Cells(held, np.split(vertices, np.cumsum(counts)[:-1]) if len(ids) else [], ids)
    corners = int(counts[0])
    kind = {1: "vertex", 2: "line"}.get(corners, held)
    return Cells(kind, vertices.reshape(len(ids), corners), ids)


def _lines_of_words(deck: Deck, block: Block) -> tuple[Spans, NDArray[np.int64]]:
    """Return the words (n, 2) of a block, and which of them begin an element."""
    spans = deck.words(block)
    starts = np.flatnonzero(np.diff(np.searchsorted(deck.line_ends(block), spans[:, 0]), prepend=-1))
    if len({*np.diff(starts, append=len(spans)).tolist()}) > 1:  # lines that end with a comma are continued
        continued = [b"," in deck.text[spans[i - 1, 1] : spans[i, 0]] for i in starts[1:].tolist()]
        starts = starts[~np.array([False, *continued])]
    return spans, starts


def _named_vertices(
    deck: Deck, block: Block, nodes: Labels, spans: Spans, elements: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Rows of the points that words (n, 2) name: by a number or, in an assembly, by `instance.number`."""
    if deck.text.find(b".", block.begin, block.end) < 0:
        return _vertices(nodes, block.scope, integers_at(deck.text, spans)[:, None], elements)[:, 0]
    rows = np.empty(len(spans), dtype=np.int64)
    for i, (begin, end) in enumerate(spans.tolist()):  # few, as no program makes a mesh of them
        instance, dot, _ = deck.text[begin:end].rpartition(b".")
        name = instance.decode("latin-1").upper()
        scope = deck.instances.get(name, name) if dot else block.scope
        number = integers_at(deck.text, np.array([[begin + len(instance) + len(dot), end]]))
        rows[i] = _vertices(nodes, scope, number[:, None], elements[i : i + 1])[0, 0]
    return rows
