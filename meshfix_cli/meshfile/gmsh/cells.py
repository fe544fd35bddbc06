"""The cells of gmsh: the numbers of their types, their names and nodes.

Source: "Gmsh Reference Manual", section "Legacy formats", table of `elm-type`; gmsh, "GmshDefines.h".
"""

from __future__ import annotations

from functools import cache

from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.lagrange import kinds

_HIGHER = {  # beside those of the table of elements the number of each type: how many nodes it has
    "line": {84: 1, 27: 5, 28: 6, 62: 7, 63: 8, 64: 9, 65: 10, 66: 11},
    "triangle": {
        85: 1, 20: 9, 21: 10, 22: 12, 23: 15, 24: 15, 25: 21, 42: 28, 43: 36, 44: 45, 45: 55, 46: 66,
        52: 18, 53: 21, 54: 24, 55: 27, 56: 30,
    },
    "quad": {
        86: 1, 36: 16, 37: 25, 38: 36, 39: 12, 40: 16, 41: 20, 47: 49, 48: 64, 49: 81, 50: 100,
        51: 121, 57: 24, 58: 28, 59: 32, 60: 36, 61: 40,
    },
    "tetra": {
        87: 1, 29: 20, 30: 35, 31: 56, 32: 22, 33: 28, 71: 84, 72: 120, 73: 165, 74: 220, 75: 286,
        79: 34, 80: 40, 81: 46, 82: 52, 83: 58, 137: 16,
    },
    "hexahedron": {
        88: 1, 92: 64, 93: 125, 94: 216, 95: 343, 96: 512, 97: 729, 98: 1000, 99: 32, 100: 44,
        101: 56, 102: 68, 103: 80, 104: 92, 105: 104,
    },
    "wedge": {89: 1, 90: 40, 91: 75, 106: 126, 107: 196, 108: 288, 109: 405, 110: 550},
    "pyramid": {
        132: 1, 118: 30, 119: 55, 120: 91, 121: 140, 122: 204, 123: 285, 124: 385, 125: 21,
        126: 29, 127: 37, 128: 45, 129: 53, 130: 61, 131: 69,
    },
}  # fmt: skip
_INCOMPLETE = (24, 40, 53, 60)  # as many nodes as a complete type of the family has

# The name and the number of nodes.
TYPES = {
    kind: (f"{family}{size}{'i' if kind in _INCOMPLETE else ''}", size)
    for family, sizes in _HIGHER.items()
    for kind, size in sizes.items()
} | {element.gmsh: (key, element.nodes) for key, element in ELEMENTS.items() if element.gmsh is not None}


@cache
def order_of(key: str) -> list[int] | None:
    """Return which of gmsh's nodes stands in each place of the table of elements, which follows VTK; None: its own."""
    kind = kinds().get(key)
    order = [] if kind is None else kind.order_of("gmsh")
    return order if order != [*range(len(order))] else None
