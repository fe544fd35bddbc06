"""How a binary file of UGRID is laid out, as its counts and its length tell. Light to import.

Source: Mississippi State University, SimCenter, "UG_IO: file formats".
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshfix_cli.mesh.elements import ELEMENTS

SURFACE, VOLUME = ("triangle", "quad"), ("tetra", "pyramid", "wedge", "hexahedron")
MARKER = 4  # bytes in front of and behind a record of Fortran
_FORMS = [(order, size, real) for order in "<>" for size in (4, 8) for real in (8, 4)]


@dataclass(frozen=True)
class Binary:
    """How numbers are held, and where those behind the counts begin and end."""

    counts: tuple[int, ...]
    integer: np.dtype[Any]
    real: np.dtype[Any]
    begin: int
    end: int


def sizes(counts: tuple[int, ...]) -> list[int]:
    """Return how many integers the surface, its numbers and the elements of each type take."""
    faces, cells = counts[1:3], counts[3:]
    corners = [n * ELEMENTS[key].nodes for key, n in zip((*SURFACE, *VOLUME), (*faces, *cells), strict=True)]
    return [*corners[:2], *faces, *corners[2:]]


def binary(data: bytes) -> Binary | None:
    """Return how a binary file is laid out, by its counts and its length; None: it is none."""
    found = None
    for order, size, real in _FORMS:
        words = f"{order}7{'i' if size == 4 else 'q'}"
        for marker in (0, MARKER):
            begin = 7 * size + 3 * marker
            if len(data) < begin:
                continue
            counts = struct.unpack_from(words, data, marker)
            whole = 3 * counts[0] * real + size * sum(sizes(counts))
            if min(counts) < 0 or counts[0] < 3 or sum(counts[1:]) < 1 or not _is_marked(data, order, marker, begin):
                continue
            more = len(data) - begin - whole - marker
            if not 0 <= more <= size * (sum(counts[3:]) + 8) or (more and marker) or more % size:
                continue
            one = Binary(counts, np.dtype(f"{order}i{size}"), np.dtype(f"{order}f{real}"), begin, begin + whole)
            if not more:
                return one
            found = found or (one if _names_its_nodes(data, one) else None)
    return found


def _is_marked(data: bytes, order: str, marker: int, begin: int) -> bool:
    """Whether the record of the counts has its length in front of it and behind it."""
    length = (begin - 3 * marker).to_bytes(MARKER, "little" if order == "<" else "big")
    return not marker or data[:marker] == length == data[begin - 2 * marker : begin - marker]


def _names_its_nodes(data: bytes, one: Binary) -> bool:
    """Whether what would be the elements of a file names nodes that there are."""
    at = one.begin + 3 * one.counts[0] * one.real.itemsize
    listed = np.frombuffer(data, one.integer, sum(sizes(one.counts)), at)
    parts = sizes(one.counts)
    ids = slice(sum(parts[:2]), sum(parts[:4]))
    nodes = np.delete(listed, ids) if ids.stop > ids.start else listed
    return bool(nodes.min() >= 1 and nodes.max() <= one.counts[0])
