"""SU2's .su2 files: keywords `NAME= value`, of which NELEM, NPOIN and MARKER_ELEMS are followed by as many lines.

A line of NPOIN has the coordinates and, often, the number of the point, one of the others the number of VTK for the
type, the vertices and, often, the number of the element. Several zones, each with all of these, are parts of one mesh.
Elements of order p have that number and 100 (p - 1), and nodes whose coordinates run one after the other.

Source: SU2 documentation, "Mesh File"; SU2, "CSU2ASCIIMeshReaderBase.cpp" and, of higher order, "CPrimalGridFEM.cpp".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.lagrange import Kind, key_of, kinds
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places
from meshfix_cli.meshfile.tables import (
    Int64,
    IntegerLines,
    Lines,
    Numbering,
    Runs,
    alike,
    check_blank,
    integer_lines,
    lines,
    without,
)
from meshfix_cli.meshfile.text import Spans, in_line
from meshfix_cli.meshfile.vtk.cells import TYPES

_COMMENT = re.compile(rb"%[^\n\r]*")
_KEYWORD = re.compile(rb"([A-Za-z_]\w*)[ \t]*=[ \t]*([^\n\r]*)")
_SENDING = re.compile(rb"\s*SEND_RECV[ \t]*=[^\n\r]*")  # between the number of a marker's elements and these
_ZONE = "su2:zone"
_Order = list[int] | slice  # which node of the file stands in each place of VTK's
_Type = tuple[str, int, _Order]  # its name and number of nodes


@dataclass
class _Zone:
    """What the keywords of a zone announce; the elements of the mesh are those of the marker ""."""

    dimension: int = 0
    points: Lines | None = None
    markers: list[tuple[str, IntegerLines]] = field(default_factory=list)

    def coordinates(self) -> Spans:
        """(n, d, 2) int64."""
        if self.points is None or "" not in (name for name, _ in self.markers):
            raise ReadError("is truncated or not readable: a zone has no NPOIN, or no NELEM")
        return self.points.columns(0, self.dimension)


def parse(data: bytes) -> Source:
    """Read points, elements and markers of all zones; the facets of markers are cells of the file."""
    text = without(data, _COMMENT, b"%")
    zones = list(_zones(text))
    spans = [zone.coordinates() for zone in zones]
    if len({one.shape[1] for one in spans}) != 1:
        raise ReadError("has zones of two and of three dimensions" if spans else "is truncated: it has no NDIME")
    runs, point, element = Runs(), 0, 0
    for number, (zone, here) in enumerate(zip(zones, spans, strict=True), start=1):
        labels = {_ZONE: number} if len(zones) > 1 else {}
        for name, table in zone.markers:
            for (kind, size, order), rows in _by_type(table):
                ids = None if name else rows + element
                nodes = table.integers(1, 1 + size, rows)[:, order]
                vertices = Numbering(np.arange(len(here))).points_of(nodes, ids)
                corners = partial(_corners, table, size, order, rows)
                runs.add(Cells(kind, vertices + point, ids), corners, labels, (name,) if name else ())
            element += 0 if name else len(table.counts)
        point += len(here)
    coordinates = Places.of_text(np.concatenate(spans))
    untold = ("comments",) * (text is not data) + ("boxes for deformation",) * (b"FFD_" in text)
    return Source(
        coordinates.read(text), runs.cells, InPlace(data, coordinates, runs.corners), runs.arrays,
        (_ZONE,) * (len(zones) > 1), untold=untold, apart=len(zones) > 1,
    )  # fmt: skip


def _zones(text: bytes) -> Iterator[_Zone]:
    zone, name, at, behind = _Zone(), "", 0, 0
    while match := _KEYWORD.search(text, at):
        if behind == at:
            check_blank(text, at, match.start())
        keyword, at = match[1].upper(), match.end()
        if keyword == b"IZONE" or (keyword == b"NDIME" and zone.dimension):
            if zone.dimension:
                yield zone
            zone = _Zone()
        if keyword == b"NDIME":
            zone.dimension = _count(text, match)
            if zone.dimension not in (2, 3):
                raise in_line(text, at, f"NDIME is {zone.dimension}")
        elif keyword == b"NPOIN":
            zone.points = lines(text, at, _count(text, match), "point")
            at = behind = zone.points.end
        elif keyword == b"MARKER_TAG":
            name = match[2].strip().decode("latin-1")
        elif keyword in (b"NELEM", b"MARKER_ELEMS"):
            sending = _SENDING.match(text, at)
            table = integer_lines(text, sending.end() if sending else at, _count(text, match), "element")
            zone.markers.append(("" if keyword == b"NELEM" else name or "?", table))
            at = behind = table.end
    if behind == at:
        check_blank(text, at)
    if zone.dimension:
        yield zone


def _count(text: bytes, match: re.Match[bytes]) -> int:
    words = match[2].split()
    if not words or not words[0].isdigit():
        raise in_line(text, match.start(), f"{match[1].decode()} has no number")
    return int(words[0][:18])


def _by_type(table: IntegerLines) -> Iterator[tuple[_Type, Int64]]:
    """Give the types of elements and their rows."""
    types = table.integers(0, 1)[:, 0]
    for rows in alike(types):
        kind = _type_of(int(types[rows[0]]))
        if kind is None:
            at = table.place(int(rows[0]))
            raise in_line(table.text, at, f"elements of the type {types[rows[0]]} are not known")
        yield kind, rows


def _type_of(number: int) -> _Type | None:
    """Return a type by its number."""
    raised, linear = divmod(number, 100)
    name, size = TYPES.get(linear, ("", 0))
    if not raised:
        return (name, size, slice(None)) if size else None
    kind = Kind(name, raised + 1, True)
    if kind not in kinds().values():
        return None
    order = kind.order_of("rows")
    return key_of(kind), len(order), order


def _corners(table: IntegerLines, size: int, order: _Order, rows: Int64) -> Places:
    return Places.of_text(table.columns(1, 1 + size, rows)[:, order], "i8")
