"""The blocks of an archive of Ansys, and the commands between them that say what is in these."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.meshfile.splice import Places, Points
from meshfix_cli.meshfile.tables import CODES, Int64
from meshfix_cli.meshfile.text import Spans, fields_at, in_line, integers

_NAMES = rb"[ \t]*(NBLOCK|EBLOCK|CMBLOCK|ETBLOCK|ET|KEYOPT?|\*SET|TYPE|MAT|EN?|N)[ \t]*,"
_COMMAND = re.compile(_NAMES + rb"([^\n!$]*)", re.I)
_NEXT = re.compile(rb"[\n$](?=" + _NAMES.replace(b"(", b"(?:", 1) + rb")", re.I)
_END = re.compile(rb"\n[ \t]*(?:-1[ \t]*(?=\n|\Z)|[A-Za-z/*!])")
_FORMAT = re.compile(
    rb"[^\n]*\s*\(((?:[ \t]*,?[ \t]*\d{0,2}[ \t]*i[ \t]*\d{1,2})+)[ \t]*"
    rb"(?:,[ \t]*(\d{0,2})[ \t]*[efgd][ \t]*(\d{1,2})\.\d{1,2}(?:e(\d))?|,[^\n]*)?[ \t]*\)[^\n]*", re.I,
)  # fmt: skip
_INTEGERS = re.compile(rb"(\d*)[ \t]*i[ \t]*(\d+)", re.I)
_MOST = 10**15  # of a number in a field


class Format(NamedTuple):
    """How wide integers are and, behind them, how many numbers there are, how wide, and the digits of an exponent."""

    widths: tuple[int, ...]
    reals: int = 0
    columns: int = 0
    exponent: int = 2


@dataclass(frozen=True, eq=False)
class Block:
    """The words behind the command of a block, its format, and where its lines (n,) begin and end.

    Attributes
    ----------
    type, material : int
        What elements have that do not tell theirs.
    element, option : mapping
        The numbers and first options of types of elements, as they are known where the block stands.
    """

    text: bytes
    words: list[str]
    form: Format
    begin: Int64
    end: Int64
    type: int
    material: int
    element: dict[int, int]
    option: dict[int, int]

    @property
    def kind(self) -> str:
        """SOLID, COMPACT or nothing."""
        return self.words[1] if len(self.words) > 1 else ""

    def fields(self, edges: Any, rows: NDArray[Any] | slice = slice(None)) -> Spans:
        """Return the spans (k, c, 2) between c+1 columns; they end with the line."""
        columns = np.minimum(self.begin[rows][:, None] + np.array(edges), self.end[rows][:, None])
        return np.stack([columns[:, :-1], columns[:, 1:]], axis=-1)

    def values(self, first: int, last: int, rows: NDArray[Any] | slice = slice(None)) -> Int64:
        """Return the integers (k, last - first) that stand there; 0: there is none."""
        if self._whole is not None:
            values, starts = self._whole
            each = int(starts[1])
            if last <= each and len(values) == each * len(self.begin) and (np.diff(starts) == each).all():
                return values.reshape(-1, each)[rows, first:last]
            first_value, ends = starts[:-1][rows, None], starts[1:][rows, None]
            at = first_value + np.arange(first, last)
            return np.where(at < ends, values[np.minimum(at, len(values) - 1)], 0)
        spans = self.fields(np.cumsum([0, *self.form.widths])[first : last + 1], rows)
        found = fields_at(self.text, spans)
        values = np.where(np.abs(found) < _MOST, found, 0.5).astype(np.int64)
        if (wrong := values != found).any():
            raise in_line(self.text, int(spans[wrong][0, 0]), "a field is not an integer")
        return values

    @cached_property
    def _whole(self) -> tuple[Int64, Int64] | None:
        """All integers, and where those of each line (n+1,) begin, if all fields up to the end of a line are filled."""
        width, counts = self.form.widths[0], self.end - self.begin
        if set(self.form.widths) != {width} or self.form.reals or not len(counts) or (counts % width).any():
            return None
        values, starts, _ = kernels.read_lines(self.text, int(self.begin[0]), len(self.begin))
        if not np.array_equal(np.diff(starts), counts // width) or values.min() < CODES:
            return None
        return values, starts

    def announced(self, found: int, what: str) -> None:
        """Raise ReadError where there are fewer than the command announces; its third word is the largest number."""
        count = self.words[3] if len(self.words) > 3 else ""
        if count.isdigit() and found < int(count[:18]):
            announced = counted(int(count[:18]), what, what + "s")
            raise ReadError(f"is truncated: {announced} announced, and not all are there")


@dataclass
class Archive:
    """What the commands of a file say.

    Attributes
    ----------
    nodes, elements : list of Block
    sets : list of (str, bool, (k, 2) int64)
        Name, whether it is one of nodes, and ranges of numbers.
    single : bool
        There are nodes or elements that have commands of their own.
    """

    text: bytes
    nodes: list[Block] = field(default_factory=list)
    elements: list[Block] = field(default_factory=list)
    sets: list[tuple[str, bool, Int64]] = field(default_factory=list)
    single: bool = False
    _element: dict[int, int] = field(default_factory=dict)
    _option: dict[int, int] = field(default_factory=dict)
    _set: dict[str, int] = field(default_factory=dict)
    _current: dict[str, int] = field(default_factory=dict)

    @classmethod
    def of(cls, text: bytes) -> Archive:
        """Read a text in which lines end with a line feed."""
        archive, at = cls(text), 0
        while True:
            if match := _COMMAND.match(text, at):
                at = archive._take(match)
            following = _NEXT.search(text, at)
            if following is None:
                return archive
            at = following.end()

    def _take(self, match: re.Match[bytes]) -> int:
        """Take a command; return the offset behind it and its block."""
        name, at = match[1].decode().upper(), match.end()
        words = [word.strip().upper() for word in match[2].decode("latin-1").split(",")]
        if name in ("N", "E", "EN"):
            self.single = self.single or words[0] != "R5.3"
        elif name == "CMBLOCK":
            return self._component([word.strip() for word in match[2].decode("utf-8", "replace").split(",")], at)
        elif name.endswith("BLOCK"):
            block, at = self._block(words, at)
            if name == "ETBLOCK":
                if len(block.form.widths) < 2:
                    raise in_line(self.text, match.start(), "the types of elements have no numbers of their own")
                for number, kind, *options in block.values(0, min(len(block.form.widths), 3)).tolist():
                    self._element[number], self._option[number] = kind, sum(options)
            else:
                (self.nodes if name == "NBLOCK" else self.elements).append(block)
        else:
            self._define(name, words)
        return at

    def _define(self, name: str, words: list[str]) -> None:
        numbers = [self._number(word) for word in words]
        if name in ("TYPE", "MAT"):
            self._current[name] = numbers[0]
        elif name == "*SET" and len(words) > 1:
            self._set[words[0]] = numbers[1]
        elif name == "ET" and len(words) > 1:
            self._element[numbers[0]] = numbers[1]
            self._option[numbers[0]] = numbers[2] if len(words) > 2 else 0
        elif name != "ET" and len(words) > 2 and numbers[1] == 1:
            self._option[numbers[0]] = numbers[2]

    def _number(self, word: str) -> int:
        """Return what a number, a parameter or the name of an element says; 0: nothing."""
        if word in self._set:
            return self._set[word]
        found = re.fullmatch(r"[A-Z]*(\d{1,9})(?:\.0*)?", word)
        return int(found[1]) if found else 0

    def _form(self, at: int) -> tuple[Format, int]:
        match = _FORMAT.match(self.text, at)
        if match is None:
            raise in_line(self.text, at + 1, "a block has no format that is known, as (3i9,6e21.13e3)")
        widths = [(int(width),) * min(int(number or 1), 99) for number, width in _INTEGERS.findall(match[1])]
        form = Format(sum(widths, ()))
        if not form.widths:
            raise in_line(self.text, at + 1, "the format of a block has no integers")
        if match[3]:
            form = Format(form.widths, int(match[2] or 1), int(match[3]), int(match[4] or 2))
        return form, match.end()

    def _block(self, words: list[str], at: int) -> tuple[Block, int]:
        form, at = self._form(at)
        found = _END.search(self.text, at)
        if found is None and not (len(words) > 3 and words[3].isdigit()):  # else a count tells whether all is there
            raise ReadError("is truncated: its last block does not end")
        end = found.start() if found else len(self.text)
        raw = np.frombuffer(self.text, dtype=np.uint8)[at + 1 : end]
        ends = np.append(np.flatnonzero(raw == ord("\n")), len(raw))
        begins = np.append(0, ends[:-1] + 1)
        begins, ends = begins[begins < ends], ends[begins < ends]
        filled = raw[ends - 1] > ord(" ")  # a line that ends with a blank may have nothing else
        for row in np.flatnonzero(~filled).tolist():
            filled[row] = not raw[begins[row] : ends[row]].tobytes().isspace()
        begins, ends = begins[filled] + at + 1, ends[filled] + at + 1
        kind, material = (self._current.get(name, 1) for name in ("TYPE", "MAT"))
        known = dict(self._element), dict(self._option)
        return Block(self.text, words, form, begins, ends, kind, material, *known), end

    def _component(self, words: list[str], at: int) -> int:
        """Take a component: numbers, of which one below 0 ends the range that the one in front of it begins."""
        kind = words[1].upper()[:4] if len(words) > 1 else ""
        if kind not in ("NODE", "ELEM"):
            return at
        if len(words) < 3 or not words[2].isdigit():
            raise in_line(self.text, at, "a component has not the number of its members")
        _, at = self._form(at)
        listed, at = integers(self.text, at, int(words[2][:18]))
        last = np.append(listed[1:], 0)
        ranges = np.stack([listed, np.where(last < 0, -last, listed)], axis=1)[listed > 0]
        self.sets.append((words[0], kind == "NODE", ranges))
        return at


@dataclass(frozen=True, eq=False)
class Scientific(Places):
    """Places of numbers as Fortran writes them: a digit before the point, and an exponent of some digits.

    Some programs read no others.
    """

    exponent: int = 2

    def _encode(self, values: Points) -> tuple[bytes, Spans]:
        """Fill the columns, with a blank or a sign in front and as many digits as there is place for."""
        digits, size = self.longest - 5 - self.exponent, np.abs(values)
        if not ((size < 1e99) & ((size > 1e-99) | (size == 0))).all():
            return super()._encode(values)
        count = len(values)
        text = (f"%+.{digits}E" * count % tuple(values.tolist())).encode()
        rows = np.frombuffer(text, dtype=np.uint8).reshape(count, digits + 7).copy()
        rows[rows[:, 0] == ord("+"), 0] = ord(" ")
        zeros = np.full((count, self.exponent - 2), ord("0"), dtype=np.uint8)
        rows = np.hstack([rows[:, :-2], zeros, rows[:, -2:]])
        places = np.arange(count + 1) * self.longest
        return rows.tobytes(), np.stack([places[:-1], places[1:]], axis=1)
