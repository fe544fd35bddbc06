"""The elements of Exodus: what they are called, in which order their nodes stand, and which of these are on a side.

A name tells the shape, in any case and spelling; the number of nodes tells the rest.

Source: L. A. Schoof, V. R. Yarberry, "EXODUS II: a finite element data model", SAND92-2137, section 4.8; "Exodus
Element Types", of the documentation of SEACAS.
"""

from __future__ import annotations

import re

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, Rows, counted

POLYGON, POLYHEDRON = "nsided", "nfaced"

# How names begin, the first that fits, and the shape.
_SHAPES = {
    "trishell": "triangle", "tshell": "triangle", "shellline": "line", "shell": "quad", "she": "quad",
    "tri": "triangle", "qua": "quad", "tet": "tetra", "pyr": "pyramid", "wed": "wedge", "pri": "wedge", "pen": "wedge",
    "hex": "hexahedron", "bar": "line", "bea": "line", "tru": "line", "edg": "line", "lin": "line", "spr": "line",
    "rod": "line", "sph": "vertex", "cir": "vertex", "nod": "vertex", "poi": "vertex", "par": "vertex",
}  # fmt: skip
_PREFIX = re.compile(r"(?:solid|shell|cell)_(?=[a-z])")  # of names as the library IOSS has them: solid_hex_8_3d
_SHELLS = {2: "line", 3: "triangle", 6: "triangle", 7: "triangle"}  # by the number of nodes, where it is not 4, 8, 9
_LINES = (2, 3)  # nodes of a shell in the plane

# Where the order is not that of the table of elements: which of the file's nodes stands there.
ORDER = {
    "hexahedron20": (*range(12), 16, 17, 18, 19, 12, 13, 14, 15),
    "hexahedron27": (*range(12), 16, 17, 18, 19, 12, 13, 14, 15, 23, 24, 25, 26, 21, 22, 20),
    "wedge15": (*range(9), 12, 13, 14, 9, 10, 11),
    "wedge18": (*range(9), 12, 13, 14, 9, 10, 11, 15, 16, 17),
}

# The corners of the sides, from side 1, and the edges in the order in which the nodes on them follow the corners.
_SIDES: dict[str, Rows] = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 1)),
    "pyramid": ((0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 4, 3), (0, 3, 2, 1)),
    "wedge": ((0, 1, 4, 3), (1, 2, 5, 4), (0, 3, 5, 2), (0, 2, 1), (3, 4, 5)),
    "hexahedron": ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 4, 7, 3), (0, 3, 2, 1), (4, 5, 6, 7)),
}
_EDGES: dict[str, Rows] = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    "pyramid": ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)),
    "wedge": ((0, 1), (1, 2), (2, 0), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (5, 3)),
    "hexahedron": (
        (0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 4),
    ),
}  # fmt: skip
_IN_FACES = {  # the node inside of each side
    "hexahedron27": (25, 24, 26, 23, 21, 22), "wedge18": (15, 16, 17), "pyramid14": (-1, -1, -1, -1, 13),
    "pyramid19": (14, 15, 16, 17, 13),
}  # fmt: skip


def key_of(name: str, nodes: int, dimension: int) -> str:
    """Return the type of elements as `elements.ELEMENTS` has it, or a name of the same kind.

    Parameters
    ----------
    name : str
        As the file has it.
    nodes : int
        Of an element.
    dimension : int
        Of the coordinates.

    Raises
    ------
    ReadError
        The name is not known, or its shape has more corners.
    """
    shape = _shape(name, nodes, dimension)
    corners = ELEMENTS[shape].nodes
    if nodes < corners:
        raise ReadError(f"is not a readable exodus file: its {name} elements have {counted(nodes, 'node', 'nodes')}")
    if nodes == corners:
        return shape
    return f"{shape}{nodes}" if f"{shape}{nodes}" in ELEMENTS else f"{shape}_of_{nodes}"


def _shape(name: str, nodes: int, dimension: int) -> str:
    word = name.lower()
    word = word if word.startswith("shell") else _PREFIX.sub("", word)
    begin = next((begin for begin in _SHAPES if word.startswith(begin)), None)
    if begin is None:
        raise ReadError(f"has elements called {name!r}, which are not known")
    if begin.startswith("she") and begin != "shellline":
        return "line" if dimension == 2 and nodes in _LINES else _SHELLS.get(nodes, "quad")
    return _SHAPES[begin]


def sides_of(key: str, name: str, dimension: int) -> Rows:
    """Return for each side of elements of a type, from side 1, which of the file's nodes are on it.

    A shell has two faces before its edges.
    """
    shape = next((shape for shape in _SIDES if key.startswith(shape)), None)
    nodes = tuple(range(_nodes(key)))
    if shape is None:
        return (nodes,) * (0 if not nodes else 6)
    sides = tuple(_with_middles(key, shape, i, corners) for i, corners in enumerate(_SIDES[shape]))
    shell = name.lower().startswith(("she", "trishell", "tshell"))
    return (nodes, nodes, *sides) if shell or (shape == "triangle" and dimension == 3) else sides


def _nodes(key: str) -> int:
    size = re.search(r"\d+$", key)
    return int(size[0]) if size else ELEMENTS[key].nodes


def _with_middles(key: str, shape: str, side: int, corners: tuple[int, ...]) -> tuple[int, ...]:
    """Return the corners of a side and the nodes on its edges and inside of it."""
    first, size, inside = ELEMENTS[shape].nodes, _nodes(key), _IN_FACES.get(key, ())
    edges = _EDGES[shape] if size >= first + len(_EDGES[shape]) else ()
    middles = (first + i for i, ends in enumerate(edges) if set(ends) <= set(corners))
    centre = inside[side : side + 1] if inside[side : side + 1] != (-1,) else ()
    return (*corners, *middles, *centre)
