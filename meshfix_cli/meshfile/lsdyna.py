"""LS-DYNA's keyword files: a line of a keyword behind *, and cards of fields in columns, or between commas.

A node has its number in 8 columns and three coordinates in 16 each; an element its number, that of its part, and nodes,
8 columns each; in the long format all have 20. A solid of fewer corners names the last several times.

Source: LSTC, "LS-DYNA Keyword User's Manual", volume I, "Getting Started", *ELEMENT, *NODE, *PART, *SET.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs, lines, without
from meshfix_cli.meshfile.text import Spans, fields_at, in_line

_COMMENT = re.compile(rb"\$[^\n\r]*")
_KEYWORD = re.compile(rb"\*([A-Za-z]\w*)([^\n\r]*)")  # at the beginning of its line
_LONG = re.compile(r"LONG\s*=\s*Y")
_WIDE = re.compile(r"I10\s*=\s*Y")
# Elements that have no more cards than they have without an option, and how many more they have with others.
_SAME = frozenset({"TET4TOTET10", "H8TOH20", "H8TOH27", "SHL4", "TO", "SHL8", "T4TOT10"})
_MORE = {
    "SHELL": ({"THICKNESS", "BETA", "MCID"}, {"OFFSET"}, {"DOF"}), "SOLID": ({"ORTHO"}, {"ORTHO"}),
    "BEAM": ({"THICKNESS"}, {"SCALAR"}, {"OFFSET"}, {"ORIENTATION"}, {"PID"}), "TSHELL": ({"BETA"},),
}  # fmt: skip
_NODES = {"SHELL": 8, "SOLID": 10, "TSHELL": 8, "BEAM": 2, "DISCRETE": 2, "SEATBELT": 2}
_FEWEST = {"SHELL": 3, "SOLID": 4, "TSHELL": 6, "BEAM": 2, "DISCRETE": 1, "SEATBELT": 2}
_MASS = "ELEMENT_MASS"
_SETS = {"SET_NODE": "", "SET_SOLID": "SOLID", "SET_SHELL": "SHELL", "SET_PART": "PART"}
_READ = ("NODE", "PART", "KEYWORD", "END", "TITLE", *_SETS)
_PART = "lsdyna:part"


class _Block(NamedTuple):
    """A keyword, its options, the columns of its integers and of its reals, and where its cards begin and end."""

    name: str
    columns: int
    reals: int
    begin: int
    end: int

    @property
    def options(self) -> set[str]:
        """What stands behind the name of an element."""
        return set(self.name.split("_")[2:])


class _Cards(NamedTuple):
    """Lines (n,) of a text: where they begin and end, and the spans of their words where commas divide them."""

    text: bytes
    begin: Int64
    end: Int64
    spans: Spans | None = None

    def fields(self, edges: Sequence[int]) -> Spans:
        """Return the spans (n, k, 2) of fields between k+1 columns, or of the first k words; empty: there is none."""
        if self.spans is not None:
            return self.spans[:, : len(edges) - 1]
        columns = np.minimum(self.begin[:, None] + np.array(edges), self.end[:, None])
        return np.stack([columns[:, :-1], columns[:, 1:]], axis=-1)

    def integers(self, edges: Sequence[int]) -> Int64:
        """Return the integers (n, k) that stand there; 0: there is none."""
        spans = self.fields(edges)
        found = fields_at(self.text, spans)
        values = np.where(np.abs(found) < 2**53, found, 0.5).astype(np.int64)
        if (wrong := values != found).any():
            at = int(spans[wrong][0, 0])
            raise in_line(self.text, at, "a field is not an integer")
        return values

    def some(self, rows: Int64 | slice) -> _Cards:
        return _Cards(self.text, self.begin[rows], self.end[rows], None if self.spans is None else self.spans[rows])


def parse(data: bytes) -> Source:
    """Read nodes and elements; parts are regions and, by their titles, sets, as are sets of nodes and elements."""
    text = without(data, _COMMENT, b"$")
    blocks = list(_blocks(text))
    tables = [(block, _cards(text, block, 4)) for block in blocks if block.name == "NODE"]
    if not any(len(cards.begin) for _, cards in tables):
        raise ReadError("is not a readable file of LS-DYNA: it has no *NODE")
    numbers = np.concatenate([cards.integers([0, block.columns]) for block, cards in tables])[:, 0]
    (coordinates, held), points, runs = _coordinates(text, tables), Numbering(numbers), Runs()
    for block in blocks:
        if block.name.startswith("ELEMENT_"):
            _add(runs, text, block, points)
    titles = [part for block in blocks if block.name == "PART" for part in _parts(data, text, block)]
    parts = runs.arrays().cell.get(_PART, [])
    for name, number in titles:
        for run, labels in enumerate(parts):
            runs.put(name, run, np.flatnonzero(labels == number))
    arrays = runs.arrays(_sets(runs, data, text, blocks, points, parts))
    others = [block.name for block in blocks if not block.name.startswith(("ELEMENT_", *_READ))]
    untold = ("comments",) * (text is not data) + ((f"keywords {', '.join(dict.fromkeys(others))}",) if others else ())
    including = any(name.startswith("INCLUDE") for name in others)
    notes = ("it includes other files, which are left where they are",) if including else ()
    return Source(
        coordinates.read(text), runs.cells, InPlace(data, coordinates, runs.corners), lambda: arrays,
        (_PART,) * bool(parts), held, untold, notes, lambda: numbers,
    )  # fmt: skip


def _blocks(text: bytes) -> Iterator[_Block]:
    """Find the keywords up to *END."""
    found = [one for one in _KEYWORD.finditer(text) if text[max(one.start() - 1, 0) : one.start()] in b"\xbf\n\r"]
    columns, reals = 8, 16
    for i, match in enumerate(found):
        name, rest = match[1].decode().upper(), match[2].decode("latin-1").upper()
        if name == "END":
            return
        if name == "KEYWORD":
            columns = 20 if _LONG.search(rest) else 10 if _WIDE.search(rest) else 8
            reals = 20 if columns == 20 else 16
        long = rest[:1] == "+" or "%" in rest
        mine = (20, 20) if long else (8, 16) if rest[:1] == "-" else (columns, reals)
        yield _Block(name, *mine, match.end(), found[i + 1].start() if i + 1 < len(found) else len(text))


def _cards(text: bytes, block: _Block, words: int) -> _Cards:
    """Find the lines of a block that are not blank; between commas each has at least so many words."""
    raw = np.frombuffer(text, dtype=np.uint8)[block.begin : block.end]
    ends = np.append(np.flatnonzero((raw == ord("\n")) | (raw == ord("\r"))), len(raw))
    begins = np.append(0, ends[:-1] + 1)
    begins, ends = begins[begins < len(raw)], ends[begins < len(raw)]
    filled = np.add.reduceat((raw > ord(" ")).view(np.uint8), begins, dtype=np.int32) > 0 if len(begins) else begins > 0
    begins, ends = begins[filled] + block.begin, ends[filled] + block.begin
    if text.find(b",", block.begin, block.end) < 0:
        return _Cards(text, begins, ends)
    found = lines(text, block.begin, len(begins))
    if (found.counts < words).any() or text.count(b",", block.begin, block.end) < len(begins) * (words - 1):
        raise in_line(text, block.begin, f"cards of *{block.name} are divided by commas in part, or lack some fields")
    return _Cards(text, begins, ends, found.columns(0, int(found.counts.min()) if len(begins) else 0))


def _coordinates(text: bytes, tables: Sequence[tuple[_Block, _Cards]]) -> tuple[Places, NDArray[np.bool_]]:
    """Find the columns of coordinates, and the points whose lines are too short to take others.

    A blank that stands before each of them is left there: some programs read words.
    """
    edges = ([0, *(block.columns + block.reals * i for i in range(4))] for block, _ in tables)
    spans = np.concatenate([cards.fields(some)[:, 1:4] for some, (_, cards) in zip(edges, tables, strict=True)])
    columns = [np.full(len(cards.begin), block.reals if cards.spans is None else 0) for block, cards in tables]
    widths, width = np.repeat(np.concatenate(columns)[:, None], 3, axis=1), min(block.reals for block, _ in tables)
    lengths = spans[..., 1] - spans[..., 0]
    if not lengths[:, 2].any():  # a mesh in a plane
        spans, widths, lengths = spans[:, :2], widths[:, :2], lengths[:, :2]
    held: NDArray[np.bool_] = (lengths == 0).any(axis=1)
    if (lengths != width).any() or (widths != width).any():
        return Places(spans[..., 0], spans[..., 1], np.dtype("f8"), width, "free", widths), held
    apart = bool((np.frombuffer(text, dtype=np.uint8)[spans[..., 0]] == ord(" ")).all())
    return Places.of_text(spans + np.array([int(apart), 0]), "f8", width - apart, "padded"), held


def _add(runs: Runs, text: bytes, block: _Block, points: Numbering) -> None:
    """Add the elements of a block."""
    kind, w = block.name.split("_")[1], block.columns
    if block.name == _MASS:
        cards = _cards(text, block, 2)
        ids, nodes = cards.integers([0, w, 2 * w]).T
        runs.add(Cells("vertex", points.points_of(nodes[:, None], ids), ids), partial(_corners, cards, [1], w))
        return
    more = _MORE.get(kind, ())
    if kind not in _NODES or block.options - _SAME - set().union(*more):
        raise ReadError(f"has *{block.name}, which is not read")
    cards = _cards(text, block, 2 if kind == "SOLID" else 4)
    size, extra = _NODES[kind], sum(bool(block.options & some) for some in more)
    two = kind == "SOLID" and len(cards.begin) > 0 and not cards.some(slice(0, 1)).integers([2 * w, 3 * w]).any()
    each = 1 + two + extra
    if len(cards.begin) % each:
        raise in_line(text, block.begin, f"there are not {each} cards for each element of *{block.name}")
    heads = cards.some(slice(0, None, each))
    first, listed = (0, cards.some(slice(1, None, each))) if two else (2, heads)
    size = size if two or kind != "SOLID" else 8
    if listed.spans is not None:
        size = min(size, listed.spans.shape[1] - first)
    if size < _FEWEST[kind]:
        raise in_line(text, block.begin, f"there are fewer than {_FEWEST[kind]} nodes of each element of *{block.name}")
    ids, parts = heads.integers([0, w, 2 * w]).T
    nodes = listed.integers([w * i for i in range(first + size + 1)])[:, first:]
    for key, columns, rows in _types(kind, nodes):
        vertices = points.points_of(nodes[rows][:, columns], ids[rows])
        corners = partial(_corners, listed.some(rows), [first + column for column in columns], w)
        runs.add(Cells(key, vertices, ids[rows]), corners, {_PART: parts[rows]})


def _corners(cards: _Cards, columns: Sequence[int], width: int) -> Places:
    spans = cards.fields([width * i for i in range(max(columns) + 2)])[:, columns]
    return Places.of_text(
        spans, "i8", 0 if cards.spans is not None else width, "" if cards.spans is not None else "padded"
    )


def _types(kind: str, nodes: Int64) -> Iterator[tuple[str, list[int], Int64]]:
    """Give types, which columns of the nodes (m, k) are those of their elements, and which elements these are."""
    there, size = nodes != 0, nodes.shape[1]
    left = np.ones(len(nodes), dtype=bool)
    # A tetrahedron repeats its fourth node, which no hexahedron does that is one in another way; it may also end there.
    tips = (nodes[:, 4:8] == nodes[:, 3:4]).all(axis=1) | ~there[:, 4:].any(axis=1)
    if kind in ("BEAM", "DISCRETE", "SEATBELT"):
        choices = [("line", 2, there.all(axis=1)), ("vertex", 1, there[:, 0])]
    elif kind == "SHELL":
        more = there[:, 4:].any(axis=1)
        three = ~more & (~there[:, 3:4] | (nodes[:, 3:4] == nodes[:, 2:3])).all(
            axis=1
        )  # also where there are but three
        whole = there.all(axis=1) & ~(nodes[:, 3:4] == nodes[:, 2:3]).any(axis=1) & (size == 8)
        choices = [("triangle", 3, three), ("quad", 4, ~more), ("quad8", 8, whole), ("quad_of_8", 4, more)]
    else:
        many = there[:, 8:].any(axis=1)
        choices = [("tetra10", size, many), ("tetra", 4, tips & (kind == "SOLID")), ("hexahedron", 8, left.copy())]
    for key, count, mask in choices:
        rows = np.flatnonzero(left & mask)
        left[rows] = False
        if len(rows):
            yield key, [*range(min(count, size))], rows


def _parts(data: bytes, text: bytes, block: _Block) -> Iterator[tuple[str, int]]:
    """Give titles and numbers of parts: a line of a title, and a card."""
    cards = _cards(text.replace(b",", b" "), block, 0)
    for i in range(0, len(cards.begin) - 1, 2):
        title = data[cards.begin[i] : cards.end[i]].decode("utf-8", "replace").strip()
        words = text[cards.begin[i + 1] : cards.end[i + 1]].replace(b",", b" ").split()
        if words and words[0].isdigit():
            number = int(words[0][:18])
            yield title or f"part {number}", number


def _sets(
    runs: Runs, data: bytes, text: bytes, blocks: Sequence[_Block], points: Numbering, parts: Sequence[Int64]
) -> Mapping[str, Int64]:
    """Put the members of sets of elements and parts into sets; return the rows of points of sets of nodes."""
    found: dict[str, Int64] = {}
    for block in blocks:
        kind = next((kind for kind in _SETS if block.name.startswith(kind)), "")
        options = set(block.name.removeprefix(kind).split("_")) - {""}
        if not kind or options - {"LIST", "TITLE", "GENERATE"}:
            continue
        cards = [line for line in data[block.begin : block.end].splitlines() if line.strip() and line[:1] != b"$"]
        title = cards.pop(0).decode("utf-8", "replace").strip() if "TITLE" in options and cards else ""
        words = [[int(word) for word in re.findall(rb"\d{1,18}", line)] for line in cards]
        if not words or not words[0]:
            continue
        name = title or f"{kind.lower()} {words[0][0]}"
        members = np.array([number for line in words[1:] for number in line if number], dtype=np.int64)
        first, last = members[: len(members) // 2 * 2].reshape(-1, 2).T if "GENERATE" in options else (members, members)
        if kind == "SET_NODE":
            rows = [points.between(a, b) for a, b in zip(first.tolist(), last.tolist(), strict=True)]
            found[name] = np.unique(np.concatenate([found.get(name, np.empty(0, dtype=np.int64)), *rows]))
            continue
        for run, cells in enumerate(runs.cells):
            numbers = (parts[run] if run < len(parts) else None) if kind == "SET_PART" else cells.ids
            if numbers is not None and (kind == "SET_PART" or (kind == "SET_SHELL") == (cells.type in _FLAT)):
                ends = np.sort(first), np.sort(last)
                inside = np.searchsorted(ends[0], numbers, "right") > np.searchsorted(ends[1], numbers, "left")
                runs.put(name, run, np.flatnonzero(inside))
    return found


_FLAT = ("triangle", "quad", "quad8", "quad_of_8")
