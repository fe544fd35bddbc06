"""Exodus files as text, which exotxt makes of them: sections behind lines that begin with an exclamation mark.

A line of coordinates is a node's, in columns of 16; nodes of elements are in columns of 10. Sets of sides name elements
and the numbers of their sides. Steps in time stay as they are.

Source: SEACAS, "exotxt", "et_wrinit.f" and the others that write the sections; "txtexo".
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.exodus import source_of
from meshfix_cli.meshfile.hdf5 import Table
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, check_blank, in_columns, right_aligned, rows, within
from meshfix_cli.meshfile.text import in_line, integers_at

_COUNTS = re.compile(
    rb"\n!\s*Database initial variables[^\n]*\n\s*([123])[ \t][^\n]*\n\s*(\d{1,18})\s+(\d{1,18})\s+(\d{1,9})(?!\d)"
)
_COORDINATES = re.compile(rb"\n!\s*Coordinates\b[^\n]*\n")
_NUMBERS = re.compile(rb"\n!\s*Element number map[^\n]*\n\s*explicit map[^\n]*\n")
_BLOCK = re.compile(
    rb"\n!\s*Element block[^\n]*\n[ \t]*(\d{1,18})[ \t]+(\d{1,18})[ \t]*([^!\s]*)[^\n]*\n"
    rb"[ \t]*(\d{1,9})[ \t]+\d+[^\n]*\n(?:!\s*Connectivity[^\n]*\n)?"
)
_NODES = re.compile(rb"\n!\s*Nodal point set[^\n]*\n[ \t]*(\d{1,18})[ \t]+(\d{1,18})[^\n]*\n")
_SIDES = re.compile(rb"\n!\s*Elements and sides[^\n]*\n")
_SIDE_SET = re.compile(rb"[ \t]*(\d{1,18})[ \t]+(\d{1,18})[ \t]")


def parse(data: bytes) -> Source:
    """Read nodes, blocks and sets."""
    counts = _COUNTS.search(data)
    if counts is None:
        raise ReadError("is not a readable exotxt file: it does not tell how many nodes and elements it has")
    dimension, n, m, number = (int(word) for word in counts.groups())
    variables = _OfText(data, _named(data, n, dimension))
    tables = [one for name, one in variables.named.items() if name.startswith("connect")]
    if len(tables) != number or sum(len(one.spans) for one in tables) != m:
        raise ReadError(f"is truncated: {counted(m, 'element', 'elements')} announced, and not all are there")
    return source_of(variables, lambda: nullcontext(variables))


@dataclass(frozen=True, eq=False)
class _Table:
    """A table of numbers, see `variables.Variable`: where they stand, and an attribute."""

    numbers: NDArray[Any]
    spans: Int64 = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))
    type: str = ""

    @property
    def shape(self) -> tuple[int, ...]:
        return self.numbers.shape

    def text(self, name: str) -> str:
        return self.type if name == "elem_type" else ""

    def values(self) -> NDArray[Any]:
        return self.numbers

    def last(self) -> NDArray[Any]:
        return self.numbers[-1]


@dataclass(frozen=True, eq=False)
class _OfText:
    """The variables of a file, see `variables.Variables`."""

    data: bytes = field(repr=False)
    named: Mapping[str, _Table]

    def layout(self, points: Table, corners: Sequence[Callable[[], Table]]) -> InPlace:
        places = right_aligned(self.data, self.named["coord"].spans.transpose(1, 0, 2))
        return InPlace(self.data, places, [partial(self._corners, one) for one in corners])

    def _corners(self, table: Callable[[], Table]) -> Places:
        one = table()
        spans = self.named[one.sets[0]].spans.reshape(-1, 2)[one.at]
        columns = in_columns(self.data, spans, 10)
        return Places.of_text(spans if columns is None else columns, "i8")


def _named(data: bytes, n: int, dimension: int) -> dict[str, _Table]:
    """Return the variables by the names that they have in netCDF."""
    heading = _COORDINATES.search(data)
    if heading is None:
        raise ReadError("is truncated: it has no coordinates")
    spans = _rows(data, heading.end(), n, dimension).transpose(1, 0, 2)
    coordinates = right_aligned(data, spans.transpose(1, 0, 2)).read(data)
    found = {"coord": _Table(coordinates.T, spans)}
    if explicit := _NUMBERS.search(data):
        found["elem_num_map"] = _Table(integers_at(data, within(data, explicit.end(), _end(data, explicit.end()))))
    found |= _of_sets(data, "eb", _blocks(data))
    found |= _of_sets(data, "ns", _node_sets(data))
    return found | _of_sets(data, "ss", _side_sets(data))


def _of_sets(data: bytes, kind: str, tables: Iterator[tuple[int, dict[str, _Table]]]) -> dict[str, _Table]:
    """Return the tables of blocks or sets, whose names end with which they are, and their numbers."""
    found: dict[str, _Table] = {}
    ids = []
    for i, (number, named) in enumerate(tables, start=1):
        ids.append(number)
        found |= {f"{name}{i}": table for name, table in named.items()}
    return found | {f"{kind}_prop1": _Table(np.array(ids, dtype=np.int64))}


def _blocks(data: bytes) -> Iterator[tuple[int, dict[str, _Table]]]:
    for block in _BLOCK.finditer(data):
        spans = _rows(data, block.end(), int(block[2]), int(block[4]))
        yield int(block[1]), {"connect": _Table(integers_at(data, spans), spans, block[3].decode("latin-1"))}


def _node_sets(data: bytes) -> Iterator[tuple[int, dict[str, _Table]]]:
    """Behind each node stands its distribution factor."""
    for one in _NODES.finditer(data):
        count, spans = int(one[2]), within(data, one.end(), _end(data, one.end()))
        if len(spans) not in (count, 2 * count):
            raise in_line(data, one.end(), f"a set has not the {counted(count, 'node', 'nodes')} that it announces")
        yield int(one[1]), {"node_ns": _Table(integers_at(data, spans[:: 2 if len(spans) > count else 1]))}


def _side_sets(data: bytes) -> Iterator[tuple[int, dict[str, _Table]]]:
    """Their numbers, and those of their sides, stand in the line before the heading."""
    for one in _SIDES.finditer(data):
        head = _SIDE_SET.match(data, data.rfind(b"\n", 0, one.start()) + 1, one.start())
        if head is None:
            raise in_line(data, one.start(), "a set of sides has no number, or not the number of its sides")
        listed = integers_at(data, _rows(data, one.end(), int(head[2]), 2))
        yield int(head[1]), {"elem_ss": _Table(listed[:, 0]), "side_ss": _Table(listed[:, 1])}


def _rows(data: bytes, begin: int, count: int, columns: int) -> Int64:
    """Find the words (count, columns, 2) that stand up to the next heading."""
    found, end = rows(data, begin, count, columns)
    last = _end(data, begin)
    if end > last:
        raise ReadError(f"is truncated: {counted(count, 'row', 'rows')} announced, and not all are there")
    check_blank(data, end, last)
    return found


def _end(data: bytes, begin: int) -> int:
    """Return where the next heading begins, or the file ends."""
    found = data.find(b"\n!", begin - 1)
    return found + 1 if found >= 0 else len(data)
