"""Tecplot's files in text: names of variables, and zones, each with keys, numbers and, perhaps, its elements.

The numbers of a zone stand point by point or variable by variable; X, Y and Z are variables like others. Elements name
points of their zone from 1; a zone without elements is a block of points, whose first index is the fastest. A zone may
share variables and elements with another.

Source: Tecplot, "360 Data Format Guide", chapter "ASCII Data"; VTK, "vtkTecplotReader.h".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from meshfix_cli import kernels
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.blocks import cells_of_block
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import Int64, Numbering, Runs, check_blank, without
from meshfix_cli.meshfile.text import Spans, in_line, integers_at

BINARY = b"#!TD"
_COMMENT = re.compile(rb"(?m)^[ \t]*#[^\n\r]*")
_RECORD = re.compile(
    rb"(?i)(?:\A(?:\xef\xbb\xbf)?|[\n\r])\s*"
    rb"(ZONE|TITLE|VARIABLES|FILETYPE|TEXT|GEOMETRY|CUSTOMLABELS|DATASETAUXDATA|VARAUXDATA)\b"
)
_NAME = re.compile(rb"[\s,=]*(?:\"([^\"\n]*)\"|([^\s,\"=]+)(?![ \t]*=))")
_KEY = re.compile(
    rb"[\s,]*(?:AUXDATA\s+)?([A-Za-z_]\w*)\s*=\s*(\"[^\"]*\"|\((?:[^()\"]|\"[^\"]*\")*\)|[^\s,\"()]+)", re.IGNORECASE
)
_AXIS = re.compile(
    r"(?:coordinate|coord)?[ _]?([xyz])(?:[ _]?coord(?:inate)?s?)?(?![a-z])[^a-z]*(?:[\[(].*)?", re.IGNORECASE
)
_SHARED = re.compile(r"\[([\d,\s-]+)\]\s*(?:=\s*(\w+))?")
_ELEMENTS = {
    "LINESEG": ("line", 2), "TRIANGLE": ("triangle", 3), "QUADRILATERAL": ("quad", 4), "TETRAHEDRON": ("tetra", 4),
    "BRICK": ("hexahedron", 8),
}  # fmt: skip
_ZONE = "tecplot:zone"


@dataclass
class _Zone:
    """A zone.

    Attributes
    ----------
    name : str
    keys : dict
        In capitals.
    points : (n, d, 2) int64
        Spans of the coordinates.
    first : int
        Where its points are among those of all zones.
    elements : (m, k, 2) int64
        Spans of the vertices; of a block (0, 0, 2).
    """

    name: str
    keys: Mapping[str, str]
    points: Spans = field(default_factory=lambda: np.empty((0, 0, 2), dtype=np.int64))
    first: int = 0
    elements: Spans = field(default_factory=lambda: np.empty((0, 0, 2), dtype=np.int64))

    @property
    def kind(self) -> tuple[str, int]:
        """The type of its elements and their size; ("", 0): it is a block."""
        old = self.keys.get("F", self.keys.get("FORMAT", ""))
        kind = self.keys.get("ZONETYPE", self.keys.get("ET", "QUADRILATERAL") if old.startswith("FE") else "ORDERED")
        if kind == "ORDERED":
            return "", 0
        if kind.removeprefix("FE") not in _ELEMENTS:
            raise ReadError(f"has a zone of the type {kind}, which is not read")
        return _ELEMENTS[kind.removeprefix("FE")]

    @property
    def by_points(self) -> bool:
        """Whether its numbers stand point by point."""
        packing = self.keys.get("DATAPACKING", self.keys.get("F", self.keys.get("FORMAT", ""))).removeprefix("FE")
        if packing not in ("POINT", "BLOCK"):
            raise ReadError(f"has a zone {self.name!r} that does not tell its DATAPACKING, POINT or BLOCK")
        return packing == "POINT"

    @property
    def shape(self) -> tuple[int, ...]:
        """How many points it has along each index; of elements one number."""
        if self.kind[0]:
            return (self.count("N", "NODES"),)
        shape = [self.count(key) if key in self.keys else 1 for key in "IJK"]
        return tuple(shape) if shape[2] > 1 else tuple(shape[:2]) if shape[1] > 1 else tuple(shape[:1])

    @property
    def cells(self) -> int:
        """How many it has."""
        return self.count("E", "ELEMENTS") if self.kind[0] else int(np.prod([max(n - 1, 1) for n in self.shape]))

    def count(self, *keys: str) -> int:
        """Return the number that stands for one of some keys."""
        word = next((self.keys[key] for key in keys if key in self.keys), "")
        if not word.isdigit() or len(word) > 12:
            raise ReadError(f"has a zone {self.name!r} without a number {keys[0]}")
        return int(word)

    def shared(self, count: int) -> dict[int, int]:
        """Return which variables, from 0, are those of another zone, by its number from 0, or of none (-2)."""
        found = {one: -2 for one, _ in _numbered(self.keys.get("PASSIVEVARLIST", ""), count)}
        found |= {one: int(zone or 0) - 1 for one, zone in _numbered(self.keys.get("VARSHARELIST", ""), count)}
        return found | {int(one) - 1: -1 for one in re.findall(r"\d+", self.keys.get("D", ""))}

    def at_cells(self, count: int) -> set[int]:
        """Return the variables, from 0, that have a number for each cell."""
        text = self.keys.get("VARLOCATION", "")
        if "[" not in text:
            return {i for i, word in enumerate(re.findall(r"\w+", text)) if word == "CELLCENTERED"}
        return {one for one, where in _numbered(text, count) if where == "CELLCENTERED"}


def parse(data: bytes) -> Source:
    """Read zones; all have as many coordinates as the variables tell, and those that share all of these are one."""
    if data.startswith(BINARY):
        raise ReadError("is a binary file of Tecplot, which meshfix does not read")
    text = without(data, _COMMENT, b"#")
    zones = list(_zones(text))
    if not zones:
        raise ReadError("is truncated or not readable: it has no zone")
    own = [zone for zone in zones if len(zone.points)]
    coordinates = Places.of_text(np.concatenate([zone.points for zone in own]) if own else zones[0].points)
    runs, seen, several = Runs(), set[tuple[int, str, int]](), len(zones) > 1
    for number, zone in enumerate(zones, start=1):
        key, vertices, corners = _cells(text, zone)
        if several and (mark := (zone.first, key, hash(vertices.tobytes()))) in seen:  # as at another time
            continue
        seen |= {mark} if several else set()
        runs.add(Cells(key, vertices), corners, {_ZONE: number} if several else {}, (zone.name,) if several else ())
    untold = ("comments",) * (text is not data) + ("variables",)
    return Source(
        coordinates.read(text), runs.cells, InPlace(data, coordinates, runs.corners), runs.arrays,
        (_ZONE,) * several, untold=untold, apart=len(own) > 1,
        oriented=all(zone.kind[0] for zone in zones),  # in blocks the indices may run either way
    )  # fmt: skip


def _zones(text: bytes) -> Iterator[_Zone]:
    """Read the zones in their order."""
    names: list[str] = []
    zones: list[_Zone] = []
    at, before = 0, 0
    while record := _RECORD.search(text, at):
        if zones and before == at:
            check_blank(text, at, record.start())
        at = record.end()
        if record[1].upper() == b"VARIABLES":
            names, at = _names(text, at)
        elif record[1].upper() == b"ZONE":
            zone, at = _header(text, at, len(zones) + 1)
            at = before = _numbers(text, at, zone, names, zones)
            zones.append(zone)
            yield zone
    if zones and before == at:
        check_blank(text, at)


def _names(text: bytes, at: int) -> tuple[list[str], int]:
    """Read the names of variables, up to the next record."""
    names = []
    end = found.start() if (found := _RECORD.search(text, at)) else len(text)
    while name := _NAME.match(text, at, end):
        names.append((name[1] if name[2] is None else name[2]).decode("utf-8", "replace").strip())
        at = name.end()
    return names, at


def _header(text: bytes, at: int, number: int) -> tuple[_Zone, int]:
    keys, name = {}, ""
    while key := _KEY.match(text, at):
        value = key[2].decode("utf-8", "replace").strip('"')
        if key[1].upper() == b"T":
            name = value.strip()
        keys[key[1].decode().upper()] = value.upper().strip()
        at = key.end()
    return _Zone(name or f"zone {number}", keys), at


def _numbered(text: str, count: int) -> Iterator[tuple[int, str]]:
    """Give the numbers, from 0, of lists like ([1-3,5]=2, [4]), and what stands behind each list."""
    for listed, value in _SHARED.findall(text):
        for part in listed.replace(" ", "").split(","):
            first, _, last = part.partition("-")
            if first.isdigit() and (last.isdigit() or not last):
                yield from ((one, value) for one in range(int(first) - 1, min(int(last or first), count)))


def _axes(names: Sequence[str]) -> list[int]:
    """Return which of the variables are x, y and, perhaps, z."""
    found = {match[1].lower(): i for i, name in reversed([*enumerate(names)]) if (match := _AXIS.fullmatch(name))}
    if not {"x", "y"} <= found.keys():
        raise ReadError(f"has no variables X and Y (found: {', '.join(names) or 'none'})")
    return [found[axis] for axis in "xyz" if axis in found]


def _numbers(text: bytes, at: int, zone: _Zone, names: Sequence[str], others: Sequence[_Zone]) -> int:
    """Find the coordinates and the elements of a zone; return the offset behind its numbers."""
    axes, shared, at_cells = _axes(names), zone.shared(len(names)), zone.at_cells(len(names))
    n, m = int(np.prod([float(size) for size in zone.shape])), zone.cells
    present = [i for i in range(len(names)) if i not in shared]
    sizes = [m if i in at_cells else n for i in present]
    begin, (kind, size) = at, zone.kind
    sharing = zone.keys.get("CONNECTIVITYSHAREZONE", str(len(others)) if "FECONNECT" in zone.keys.get("D", "") else "")
    listed = m * size if kind and not sharing else 0
    if sum(sizes) + listed > len(text) - at:
        raise ReadError(f"is truncated: {sum(sizes) + listed:,} numbers of the zone {zone.name!r} are announced")
    spans = kernels.find_words(text, at, sum(sizes) + listed)
    at = int(spans[-1, 1]) if len(spans) else at
    if (repeated := text.find(b"*", begin, at)) >= 0:
        raise in_line(text, repeated, "a number is repeated by *, which is not read")
    if len(spans) < sum(sizes) + listed:
        raise ReadError(f"is truncated: {sum(sizes) + listed:,} numbers of the zone {zone.name!r} are announced")
    if wrong := [names[axis] for axis in axes if axis in at_cells or (axis in shared) != (axes[0] in shared)]:
        raise ReadError(f"has a zone {zone.name!r} that does not have {wrong[0]} for each point of its own")
    if axes[0] in shared:
        other = _other(others, shared[axes[0]])
        zone.first = other.first
        if other.shape != zone.shape:
            raise ReadError(f"has a zone {zone.name!r} that shares the coordinates of a zone of another size")
    else:
        starts, columns = np.cumsum([0, *sizes]), [present.index(axis) for axis in axes]
        if zone.by_points:
            zone.points = spans[: sum(sizes)].reshape(n, len(present), 2)[:, columns]
        else:
            zone.points = np.stack([spans[starts[i] : starts[i] + n] for i in columns], axis=1)
        zone.first = sum(len(one.points) for one in others)
    if kind and sharing:
        zone.elements = _shared_elements(others, sharing, zone)
    elif kind:
        zone.elements = spans[sum(sizes) :].reshape(m, size, 2)
    return at


def _other(zones: Sequence[_Zone], number: int) -> _Zone:
    if not -1 <= number < len(zones) or not zones:
        raise ReadError("has a zone that shares what another one has, and that does not stand before it")
    return zones[number]


def _shared_elements(zones: Sequence[_Zone], number: str, zone: _Zone) -> Spans:
    other = _other(zones, int(number) - 1 if number.isdigit() else -2)
    if other.kind != zone.kind:
        raise ReadError(f"has a zone {zone.name!r} that shares elements of another type")
    return other.elements


def _cells(text: bytes, zone: _Zone) -> tuple[str, Int64, partial[Places]]:
    """Return the type of the cells of a zone, their vertices, and what finds these in the file."""
    key, _ = zone.kind
    if not key:
        key, vertices = cells_of_block(zone.shape)
        return key, vertices + zone.first, partial(_not_turned)
    numbers = Numbering(np.arange(1, int(zone.shape[0]) + 1))
    vertices = numbers.points_of(integers_at(text, zone.elements)) + zone.first
    return key, vertices, partial(Places.of_text, zone.elements, "i8")


def _not_turned() -> Places:
    raise ReadError("has a zone of points in order, whose cells cannot be renumbered one by one")
