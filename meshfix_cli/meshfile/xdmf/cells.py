"""The cells of an XDMF grid: of one type, or of several whose numbers stand before their vertices.

Source: XDMF, "XDMF Model and Format", section Topology, and the numbers in "XdmfTopologyType".
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.vtk.xml import Element
from meshfix_cli.meshfile.xdmf.items import Contents, Item, item_of
from meshfix_cli.meshfile.xdmf.tree import Tree, said

# By the number that stands before a cell among others: what it is, and how many nodes it has; 0: the next number says.
_NUMBERS = {
    1: ("vertex", 0), 2: ("poly_line", 0), 3: ("polygon", 0), 4: ("triangle", 3), 5: ("quad", 4), 6: ("tetra", 4),
    7: ("pyramid", 5), 8: ("wedge", 6), 9: ("hexahedron", 8), 34: ("line3", 3), 35: ("quad9", 9),
    36: ("triangle6", 6), 37: ("quad8", 8), 38: ("tetra10", 10), 39: ("pyramid13", 13), 40: ("wedge15", 15),
    41: ("wedge18", 18), 48: ("hexahedron20", 20), 49: ("hexahedron24", 24), 50: ("hexahedron27", 27),
    51: ("hexahedron_of_64", 64), 52: ("hexahedron_of_125", 125),
}  # fmt: skip
# The other way round: what stands before each cell of a type. Of what is named by its number of nodes the order is not
# known.
HEADS = {
    key: [number] if nodes else [number, ELEMENTS[key].nodes]
    for number, (key, nodes) in {**_NUMBERS, 2: ("line", 0)}.items()
    if key in ELEMENTS and ELEMENTS[key].nodes
}
_POLYHEDRON = 16  # its faces follow, each with the number of its vertices
_SHAPES = {
    "edge": "line", "line": "line", "interval": "line", "tri": "triangle", "triangle": "triangle", "quad": "quad",
    "quadrilateral": "quad", "tet": "tetra", "tetra": "tetra", "tetrahedron": "tetra", "pyramid": "pyramid",
    "wedge": "wedge", "hex": "hexahedron", "hexahedron": "hexahedron",
}  # fmt: skip
_TITLES = {
    "line": "Edge", "triangle": "Triangle", "quad": "Quadrilateral", "tetra": "Tetrahedron", "pyramid": "Pyramid",
    "wedge": "Wedge", "hexahedron": "Hexahedron",
}  # fmt: skip
_STRUCTURED = re.compile("[23]d(smesh|rectmesh|corectmesh)")


class Run(NamedTuple):
    """Cells of one type.

    Attributes
    ----------
    key : str
    rows : (m,) int64
        Their positions among the cells of the grid.
    at : (m, k) int64, or a list of arrays
        Where their vertices stand among the numbers of the grid's topology.
    """

    key: str
    rows: NDArray[np.int64]
    at: Any


class Topology(NamedTuple):
    """The cells of a grid: their numbers, which of these they are, and the number of the first point."""

    item: Item
    values: NDArray[Any]
    runs: Sequence[Run]
    base: int

    @property
    def cells(self) -> int:
        """How many there are."""
        return sum(len(run.rows) for run in self.runs)

    def vertices(self, run: Run) -> Any:
        """Return the vertices (m, k) of a run; a list of arrays where cells have different numbers of them."""
        if isinstance(run.at, list):
            return [self.values[at] - self.base for at in run.at]
        dense = run.at.size == len(self.values)
        found = self.values.reshape(run.at.shape) if dense else self.values[run.at]
        return found - self.base if self.base else found


def topology_of(tree: Tree, element: Element, contents: Contents) -> Topology:
    """Read the cells of a grid."""
    kind = said(element, "TopologyType", "Type")
    if _STRUCTURED.fullmatch(kind):
        raise ReadError("holds a structured grid, which meshfix does not read from xdmf files")
    if element.attributes.get("Order", "").split() not in ([], [str(i) for i in range(_nodes(element) or 0)]):
        raise ReadError("has cells whose vertices have an order of their own, which meshfix does not read")
    item = item_of(tree, element)
    values = contents.read(item)
    if values.dtype.kind == "f":
        raise ReadError("is not a readable xdmf file: the vertices of its cells are not integers")
    if values.dtype.kind == "u":
        values = values.astype(np.int64)
    base = said(element, "BaseOffset") or "0"
    if kind == "mixed":
        runs = list(_mixed(values))
    else:
        key, nodes = _type(kind, element)
        if item.size % nodes:
            raise ReadError(f"is not a readable xdmf file: {item.size:,} vertices are no cells of {nodes} each")
        runs = [Run(key, np.arange(item.size // nodes), np.arange(item.size).reshape(-1, nodes))]
    topology = Topology(item, values, runs, int(base) if base.isdecimal() else 0)
    announced = said(element, "NumberOfElements", "Dimensions").split()
    if announced and all(map(str.isdecimal, announced)) and math.prod(map(int, announced)) != topology.cells:
        text = " ".join(announced)
        raise ReadError(f"is not a readable xdmf file: it announces {text} cells and has {topology.cells:,}")
    return topology


def titled(key: str) -> str:
    """Return the attributes of a topology whose cells all are of a type in `HEADS`."""
    if key in ("vertex", "line"):
        return f'TopologyType="Poly{key}" NodesPerElement="{ELEMENTS[key].nodes}"'
    shape = next(shape for shape in _TITLES if key.startswith(shape))
    nodes = key[len(shape) :]
    return f'TopologyType="{_TITLES[shape]}{"_" if nodes else ""}{nodes}"'


def _nodes(element: Element) -> int | None:
    text = said(element, "NodesPerElement")
    return int(text) if text.isdecimal() and 0 < int(text) < 1000 else None


def _type(kind: str, element: Element) -> tuple[str, int]:
    """Return what cells of a type are, and how many nodes each has."""
    nodes = _nodes(element)
    simple = {"polyvertex": ("vertex", 1), "polyline": ("line", 2), "polygon": ("polygon", 0)}
    if kind in simple:
        key, usual = simple[kind]
        nodes = nodes or usual
        if not nodes:
            raise ReadError("is not a readable xdmf file: its polygons have no NodesPerElement")
        if kind == "polygon":
            return {3: "triangle", 4: "quad"}.get(nodes, "polygon"), nodes
        return (key if nodes == usual else f"poly_{key}"), nodes
    name, _, count = kind.partition("_")
    shape = _SHAPES.get(name)
    if shape is None or (count and not re.fullmatch("[1-9][0-9]{0,2}", count)):
        raise ReadError(f"has cells of the type {kind!r}, which is not known")
    corners = ELEMENTS[shape].nodes
    size = int(count) if count else nodes or corners
    if size == corners:
        return shape, size
    return (f"{shape}{size}" if f"{shape}{size}" in ELEMENTS else f"{shape}_of_{size}"), size


def _mixed(values: NDArray[Any]) -> list[Run]:
    """Find the cells among numbers of types, counts and vertices, those of one type and size together."""
    found: dict[tuple[str, int], list[tuple[int, NDArray[np.int64], int]]] = {}
    loose: dict[str, list[tuple[int, NDArray[np.int64]]]] = {}
    at = cells = 0
    while at < len(values):
        number = int(values[at])
        if number == _POLYHEDRON:
            end = _behind_polyhedron(values, at)
            loose.setdefault("polyhedron", []).append((cells, _of_faces(values, at, end)))
            at, cells = end, cells + 1
            continue
        if number not in _NUMBERS:
            raise ReadError(f"is not a readable xdmf file: there is no type of cells with the number {number}")
        key, nodes = _NUMBERS[number]
        head = 1
        if not nodes:
            head, nodes = 2, int(values[at + 1]) if at + 1 < len(values) else 0
            if not 0 < nodes <= len(values):
                raise ReadError("is truncated: a cell has no vertices")
        step = head + nodes
        count = _alike(values, at, step, head)
        if at + count * step > len(values):
            raise ReadError("is truncated: its last cell has too few vertices")
        found.setdefault((_sized(key, nodes), nodes), []).append((cells, at + head + step * np.arange(count), count))
        at, cells = at + count * step, cells + count
    runs = []
    for (key, nodes), parts in found.items():
        rows = np.concatenate([np.arange(first, first + count) for first, _, count in parts])
        begin = np.concatenate([begin for _, begin, _ in parts])
        runs.append(Run(key, rows, begin[:, None] + np.arange(nodes)))
    for key, ones in loose.items():
        runs.append(Run(key, np.array([row for row, _ in ones]), [at for _, at in ones]))
    return runs


def _alike(values: NDArray[Any], at: int, step: int, head: int) -> int:
    """Return how many cells with the same head stand one behind the other."""
    count, window = 1, 8
    while True:
        heads = values[at + count * step :][: window * step]
        whole = len(heads) // step
        same = (heads[: whole * step].reshape(whole, step)[:, :head] == values[at : at + head]).all(axis=1)
        more = whole if same.all() else int(same.argmin())
        count += more
        if more < window:
            return count
        window *= 2


def _sized(key: str, nodes: int) -> str:
    """What a cell is that tells how many vertices it has."""
    named = {("vertex", 1): "vertex", ("poly_line", 2): "line", ("polygon", 3): "triangle", ("polygon", 4): "quad"}
    if key == "vertex" and nodes > 1:
        return "poly_vertex"
    return named.get((key, nodes), key)


def _behind_polyhedron(values: NDArray[Any], at: int) -> int:
    faces, end = int(values[at + 1]) if at + 1 < len(values) else 0, at + 2
    for _ in range(max(faces, 0)):
        size = int(values[end]) if end < len(values) else -1
        if size < 1:
            break
        end += 1 + size
    else:
        if faces > 0 and end <= len(values):
            return end
    raise ReadError("is truncated: a polyhedron has too few vertices")


def _of_faces(values: NDArray[Any], at: int, end: int) -> NDArray[np.int64]:
    """Where the vertices of the faces of a polyhedron stand."""
    found, here = [], at + 2
    while here < end:
        size = int(values[here])
        found.append(np.arange(here + 1, here + 1 + size))
        here += 1 + size
    return np.concatenate(found)
