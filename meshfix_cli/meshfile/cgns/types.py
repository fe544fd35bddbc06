"""The elements of CGNS: their numbers, names and nodes, and how sections of several types are cut.

Source: CGNS, "Standard Interface Data Structures", section 3.3, "Unstructured Grid Element Numbering Conventions", and
7.3, "Elements Structure Definition".
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError

Int64 = NDArray[np.int64]
MIXED = 20
_POLYHEDRA = {22: "NGON_n", 23: "NFACE_n"}
_FAMILIES = {
    "vertex": {2: 1},
    "line": {3: 2, 4: 3, 24: 4, 40: 5},
    "triangle": {5: 3, 6: 6, 25: 9, 26: 10, 41: 12, 42: 15},
    "quad": {7: 4, 8: 8, 9: 9, 27: 12, 28: 16, 43: 16, 44: 25},
    "tetra": {10: 4, 11: 10, 29: 16, 30: 20, 45: 22, 46: 34, 47: 35},
    "pyramid": {12: 5, 13: 14, 21: 13, 31: 21, 32: 29, 33: 30, 48: 29, 49: 50, 50: 55},
    "wedge": {14: 6, 15: 15, 16: 18, 34: 24, 35: 38, 36: 40, 51: 33, 52: 66, 53: 75},
    "hexahedron": {17: 8, 18: 20, 19: 27, 37: 32, 38: 56, 39: 64, 54: 44, 55: 98, 56: 125},
}
_LINEAR = (2, 3, 5, 7, 10, 12, 14, 17)
_SECOND = (4, 6, 8, 9, 11, 13, 15, 16, 18, 19, 21)
# The name and the number of nodes; those of more than second order have an order of their own.
TYPES = {
    number: (family if number in _LINEAR else f"{family}{'' if number in _SECOND else '_of_'}{size}", size)
    for family, sizes in _FAMILIES.items()
    for number, size in sizes.items()
}
# Where the order is not that of the table of elements: which of the file's nodes stands there.
ORDER = {
    "hexahedron20": (*range(12), 16, 17, 18, 19, 12, 13, 14, 15),
    "hexahedron27": (*range(12), 16, 17, 18, 19, 12, 13, 14, 15, 24, 22, 21, 23, 20, 25, 26),
    "wedge15": (*range(9), 12, 13, 14, 9, 10, 11),
    "wedge18": (*range(9), 12, 13, 14, 9, 10, 11, 15, 16, 17),
}


def type_of(number: int, section: str) -> tuple[str, int]:
    """Return the name of a type and the number of its nodes; ReadError where it is not known."""
    if number in _POLYHEDRA or number > max(TYPES):
        raise ReadError(f"has polygons or polyhedra ({_POLYHEDRA.get(number, 'NGON_n')}), which meshfix does not read")
    if number not in TYPES:
        raise ReadError(f"is not a readable cgns file: {section!r} has elements of type {number}")
    return TYPES[number]


def runs(nodes: NDArray[np.integer[Any]], section: str) -> Iterator[tuple[str, Int64, Int64]]:
    """Cut a section of several types, in which each element has the number of its type before its nodes.

    Yields
    ------
    type : str
    rows : (m,) int64
        Which elements of the section they are.
    at : (m, k) int64
        Where their nodes stand in the section.
    """
    found: dict[int, list[tuple[int, Int64]]] = {}
    begin = row = 0
    while begin < len(nodes):
        number = int(nodes[begin])
        _, size = type_of(number, section)
        count = _alike(nodes, begin, size + 1)
        starts = begin + (size + 1) * np.arange(count)
        found.setdefault(number, []).append((row, starts))
        begin, row = begin + count * (size + 1), row + count
    if begin != len(nodes):
        raise ReadError(f"is not a readable cgns file: {section!r} ends within an element")
    for number, parts in found.items():
        key, size = TYPES[number]
        rows = np.concatenate([first + np.arange(len(starts)) for first, starts in parts])
        yield key, rows, np.concatenate([starts for _, starts in parts])[:, None] + np.arange(1, size + 1)


def _alike(nodes: NDArray[np.integer[Any]], begin: int, step: int) -> int:
    """Count the elements of one type from an offset on; each look goes twice as far as the last."""
    count, far = 1, 16
    while True:
        numbers = nodes[begin + count * step : begin + (count + far) * step : step]
        other = np.flatnonzero(numbers != nodes[begin])
        if len(other) or len(numbers) < far:
            return count + int(other[0] if len(other) else len(numbers))
        count, far = count + far, far * 2
