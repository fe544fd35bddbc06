"""What elements of Ansys are: by the number of their type, how many nodes they have, and which of these repeat.

The nodes of a hexahedron have VTK's order: bottom, top, and of second order those between in the bottom, in the top and
between both. Prisms, tetrahedra and pyramids are hexahedra that repeat nodes.

Source: Ansys, "Mechanical APDL Element Reference", the figures of SOLID185, SOLID186, SOLID187, PLANE183, SHELL281 and
MESH200.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import ELEMENTS, straight_key
from meshfix_cli.meshfile.tables import Int64

_MESH_ONLY = 200  # whose first option tells what it is
_POINTS = frozenset({21, 71, 166})
_LINES = frozenset({
    1, 3, 4, 8, 9, 10, 11, 12, 14, 16, 17, 18, 20, 23, 24, 26, 27, 31, 32, 33, 34, 36, 37, 38, 39, 40, 44, 48, 49, 50,
    51, 52, 54, 59, 60, 61, 68, 81, 94, 111, 116, 124, 125, 126, 129, 151, 153, 156, 160, 161, 165, 167, 169, 171, 172,
    175, 176, 177, 178, 179, 180, 184, 188, 189, 208, 209, 214, 251, 288, 289, 290,
})  # fmt: skip
_CURVED_LINES = frozenset({172, 189, 209, 289, 290})  # which have their third node in the middle
_PLANES = frozenset({
    2, 6, 13, 15, 25, 28, 29, 35, 41, 42, 43, 53, 55, 56, 57, 63, 67, 74, 75, 77, 78, 79, 82, 83, 84, 86, 88, 91, 93,
    99, 106, 108, 110, 115, 118, 121, 130, 131, 132, 136, 138, 139, 141, 143, 145, 146, 150, 152, 154, 155, 157, 162,
    163, 170, 173, 174, 181, 182, 183, 192, 193, 202, 203, 212, 213, 223, 230, 233, 238, 271, 272, 273, 281, 292, 293,
})  # fmt: skip
_SOLIDS = frozenset({
    5, 7, 30, 45, 46, 58, 62, 64, 65, 69, 70, 72, 73, 76, 80, 85, 87, 89, 90, 92, 95, 96, 97, 98, 100, 107, 117, 119,
    120, 122, 123, 127, 128, 140, 142, 147, 148, 158, 164, 168, 185, 186, 187, 190, 191, 194, 195, 204, 205, 215, 216,
    217, 218, 220, 221, 225, 226, 227, 228, 231, 232, 236, 237, 239, 240, 278, 279, 285, 291,
})  # fmt: skip
_OF_SOLIDS = {
    4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10", 13: "pyramid13", 15: "wedge15",
    20: "hexahedron20",
}  # fmt: skip
_OF_PLANES = {1: "vertex", 2: "line", 3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8"}
# What is left of elements that repeat nodes: which of them are the same, and which are those of the type.
_REPEATED: dict[str, Sequence[tuple[str, Sequence[tuple[int, int]], Sequence[int]]]] = {
    "hexahedron20": (
        ("tetra10", ((2, 3), (4, 5), (4, 6), (4, 7)), (0, 1, 2, 4, 8, 9, 11, 16, 17, 18)),
        ("pyramid13", ((4, 5), (4, 6), (4, 7)), (0, 1, 2, 3, 4, 8, 9, 10, 11, 16, 17, 18, 19)),
        ("wedge15", ((2, 3), (6, 7)), (0, 1, 2, 4, 5, 6, 8, 9, 11, 12, 13, 15, 16, 17, 18)),
    ),
    "hexahedron": (
        ("tetra", ((2, 3), (4, 5), (4, 6), (4, 7)), (0, 1, 2, 4)),
        ("pyramid", ((4, 5), (4, 6), (4, 7)), (0, 1, 2, 3, 4)),
        ("wedge", ((2, 3), (6, 7)), (0, 1, 2, 4, 5, 6)),
    ),
    "quad8": (("triangle6", ((2, 3),), (0, 1, 2, 4, 5, 7)),),
    "quad": (("triangle", ((2, 3),), (0, 1, 2)),),
}
_SECOND = ("tetra10", "pyramid13", "wedge15", "hexahedron20", "triangle6", "quad8")  # that may have corners alone


class Some(NamedTuple):
    """Elements of a type: which ones, and the columns of their nodes; without columns, each has the nodes it has."""

    key: str
    rows: Int64
    columns: Sequence[int] = ()


def types(number: int, option: int, nodes: Int64) -> Iterator[Some]:
    """Give what elements (m, k) of a type of Ansys, by its number (0: unknown) and first option, are; node 0: none."""
    key = _key(number, option, nodes.shape[1])
    left = np.arange(len(nodes))
    for other, same, columns in _REPEATED.get(key, ()):
        mask = np.all([nodes[left, a] == nodes[left, b] for a, b in same], axis=0)
        yield from _of_any_order(other, columns, left[mask], nodes)
        left = left[~mask]
    size = 2 if key == "line" else 3 if key == "line3" else nodes.shape[1]
    yield from _of_any_order(key, range(size), left, nodes)


def _key(number: int, option: int, size: int) -> str:
    if number == _MESH_ONLY:
        number = 188 if option < 4 and size < 3 else 189 if option < 4 else 181 if option < 8 else 185
    if number in _LINES and size > 1:
        return "line3" if number in _CURVED_LINES and size > 2 else "line"
    if number in _SOLIDS or (number not in _PLANES and size in (10, 20)):
        return _OF_SOLIDS.get(size, f"hexahedron_of_{size}")
    if number in _PLANES or size < 3:
        return _OF_PLANES.get(size, f"quad_of_{size}")
    return f"unknown_of_{size}" if number not in _POINTS else "vertex"


def _of_any_order(key: str, columns: Sequence[int], rows: Int64, nodes: Int64) -> Iterator[Some]:
    """Give elements that have all their nodes, those of second order that have their corners alone, and the others."""
    linear = straight_key(key) if key in _SECOND else None
    if linear is None:
        yield from _whole(key, columns, rows, nodes)
        return
    corners = ELEMENTS[linear].nodes
    straight = (nodes[rows][:, columns[corners:]] == 0).all(axis=1)
    yield from _whole(linear, columns[:corners], rows[straight], nodes)
    yield from _whole(key, columns, rows[~straight], nodes)


def _whole(key: str, columns: Sequence[int], rows: Int64, nodes: Int64) -> Iterator[Some]:
    """Give those elements to which no node is lacking, and then, under another name, those to which one is."""
    lacking: NDArray[np.bool_] = (nodes[rows][:, list(columns)] == 0).any(axis=1)
    if not lacking.all():
        yield Some(key, rows[~lacking], list(columns))
    if lacking.any():
        yield Some(f"{key.rstrip('0123456789')}_of_some", rows[lacking])
