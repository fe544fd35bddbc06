"""The sections of MEDIT's files, which those in text and in binary share, and the order of nodes that a file may give.

Source: L. Maréchal, "Handling unstructured meshes and solutions: libMeshb" (the tables of keywords).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, element_of
from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.splice import InPlace, Places

CELLS = {
    "Edges": ("line", 2), "Triangles": ("triangle", 3), "Quadrilaterals": ("quad", 4), "Tetrahedra": ("tetra", 4),
    "Hexahedra": ("hexahedron", 8), "Hexaedra": ("hexahedron", 8), "Prisms": ("wedge", 6), "Pentahedra": ("wedge", 6),
    "Pyramids": ("pyramid", 5),
    "EdgesP2": ("line3", 3), "TrianglesP2": ("triangle6", 6), "QuadrilateralsQ2": ("quad9", 9),
    "TetrahedraP2": ("tetra10", 10),
    # Of these the order of nodes is not known, and they are held.
    "HexahedraQ2": ("hexahedron_of_27", 27), "PrismsP2": ("wedge_of_18", 18), "PyramidsP2": ("pyramid_of_14", 14),
    "EdgesP3": ("line_of_4", 4), "TrianglesP3": ("triangle_of_10", 10), "QuadrilateralsQ3": ("quad_of_16", 16),
    "TetrahedraP3": ("tetra_of_20", 20), "EdgesP4": ("line_of_5", 5), "TrianglesP4": ("triangle_of_15", 15),
    "QuadrilateralsQ4": ("quad_of_25", 25), "TetrahedraP4": ("tetra_of_35", 35),
}  # fmt: skip
# How many numbers tell where a node lies, by the shape.
ORDERS = {"line": 1, "triangle": 3, "quad": 2, "tetra": 4, "pyramid": 3, "wedge": 4, "hexahedron": 3}
_REF = "medit:ref"
_ORDERED = re.compile(r"(\w+?)(?:[PQ]1)?Ordering")


@dataclass(frozen=True, eq=False)
class Section:
    """A keyword and its rows.

    Attributes
    ----------
    name : str
    rows : (n, k) int64 or None
        Vertices of cells and the reference of each, or of vertices the reference; None: the keyword is not known.
    places : callable or None
        Gives where coordinates, or vertices of cells, stand.
    """

    name: str
    rows: Any = None
    places: Callable[[], Places] | None = None

    @property
    def marks(self) -> str | None:
        """The section whose rows its numbers name as fixed."""
        return marked_by(self.name)


def source_of(data: bytes, sections: Sequence[Section], comments: bool = False) -> Source:
    """Return what a file holds; vertices that are required or corners, alone or with their cell, are held."""
    vertices = [section for section in sections if section.name == "Vertices"]
    if len(vertices) != 1 or vertices[0].places is None:
        raise ReadError(f"is not a readable medit file: it has {len(vertices) or 'no'} sections of vertices")
    coordinates = vertices[0].places()
    runs, placed = [section for section in sections if section.name in CELLS], _orders(sections)
    if any(section.name == "BezierBasis" for section in sections) and any(_is_curved(run) for run in runs):
        raise ReadError("gives control points of Bezier's for nodes (BezierBasis), which meshfix does not read")
    cells, corners = _cells(runs, placed)
    arrays = Arrays({_REF: vertices[0].rows[:, 0]}, {_REF: [run.rows[:, -1] for run in runs]})
    layout, held = InPlace(data, coordinates, corners), _held(sections, len(coordinates.begin))
    return Source(coordinates.read(data), cells, layout, lambda: arrays, (_REF,), held, _untold(sections, comments))


def marked_by(name: str) -> str | None:
    """Return the section whose rows those of another name as fixed."""
    if name == "Corners":
        return "Vertices"
    return name.removeprefix("Required") if name.startswith("Required") else None


def columns_of(name: str, dimension: int) -> int:
    """Return how many integers a row has, without the coordinates; 0: the section is not known."""
    if name in CELLS:
        return CELLS[name][1] + 1
    if (found := _ORDERED.fullmatch(name)) and found[1] in CELLS:
        return ORDERS[_family(CELLS[found[1]][0])]
    return int(name == "Vertices" or marked_by(name) is not None)


def check_dimension(dimension: int) -> None:
    """Refuse, as a ReadError, what is neither plane nor space."""
    if dimension not in (2, 3):
        raise ReadError(f"is not a readable medit file: its dimension is {dimension}")


def _orders(sections: Sequence[Section]) -> dict[str, NDArray[np.int64]]:
    """Return the rows that tell where the nodes of elements lie, by the section of these."""
    found = {}
    for section in sections:
        match = _ORDERED.fullmatch(section.name)
        if match and section.rows is not None:
            found[match[1]] = section.rows
    return found


def _kind_of(name: str, orders: Mapping[str, NDArray[np.int64]]) -> tuple[str, Sequence[int] | None]:
    """Return the type of the cells of a section, and which node of the file stands in each place; None: all as they do.

    Nodes that a file places elsewhere than any type does are held.
    """
    key, nodes = CELLS[name]
    if name not in orders:
        return key, None
    family = _family(key)
    weights = [tuple(row) for row in _weights(family, orders[name]).round(6).tolist()]
    element = element_of(family if nodes == ELEMENTS[family].nodes else f"{family}{nodes}")
    if element is None or len(set(weights)) != nodes:
        return f"{family}_of_{nodes}", None
    corners = np.eye(element.shape.corners)
    wanted = np.concatenate([corners, np.array(element.weights).reshape(-1, len(corners))]).round(6).tolist()
    if {tuple(row) for row in wanted} != set(weights):
        return f"{family}_of_{nodes}", None
    return element.key, [weights.index(tuple(row)) for row in wanted]


def _family(key: str) -> str:
    return re.split(r"_of_|\d", key)[0]


def _weights(family: str, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return where nodes (n, k) lie, as weights (n, corners) of corners; k as `ORDERS` has it."""
    places = rows / max(int(rows.max(initial=0)), 1)
    if family in ("triangle", "tetra"):
        return places
    if family == "wedge":
        return np.concatenate([places[:, :3] * (1 - places[:, 3:]), places[:, :3] * places[:, 3:]], axis=1)
    if family == "pyramid":
        left = 1 - places[:, 2:]
        base = np.divide(places[:, :2], left, out=np.zeros((len(rows), 2)), where=left > 0)
        return np.concatenate([_along(base) * left, places[:, 2:]], axis=1)
    return _along(places)


def _along(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weights (n, 2^k) of the corners of a line, a quadrilateral, or a hexahedron."""
    weights = np.ones((len(places), 1))
    for axis, x in enumerate(places.T[:, :, None]):
        others = weights[:, ::-1] if axis == 1 else weights  # corners go around
        weights = np.concatenate([weights * (1 - x), others * x], axis=1)
    return weights


def _held(sections: Sequence[Section], n: int) -> NDArray[np.bool_]:
    """Mark the vertices (n,) that are corners or required, or belong to a cell that is required."""
    fixed = np.zeros(n, dtype=bool)
    for mark in sections:
        if mark.marks is None or mark.rows is None:
            continue
        marked = _marked(sections, mark.marks, n)
        named = mark.rows[:, 0]
        if named.size and not 1 <= named.min() <= named.max() <= len(marked):
            raise ReadError(f"is not a readable medit file: {mark.name} names what is not among its {mark.marks}")
        vertices = marked[named - 1]
        fixed[vertices[(vertices >= 1) & (vertices <= n)] - 1] = True
    return fixed


def _marked(sections: Sequence[Section], name: str, n: int) -> NDArray[np.int64]:
    """Vertices (k, c), from 1, of the rows of a section."""
    if name == "Vertices":
        return np.arange(1, n + 1)[:, None]
    rows = [run.rows[:, :-1] for run in sections if run.name == name and name in CELLS]
    return np.concatenate(rows) if rows else np.empty((0, 1), dtype=np.int64)


def _is_curved(run: Section) -> bool:
    return run.name[-2:-1] in ("P", "Q") and bool(len(run.rows))


def _cells(
    runs: Sequence[Section], orders: Mapping[str, NDArray[np.int64]]
) -> tuple[list[Cells], list[Callable[[], Places]]]:
    """Return the cells of each section, and what gives the places of their vertices."""
    cells, corners = [], []
    for run in runs:
        kind, order = _kind_of(run.name, orders)
        vertices = run.rows[:, :-1] - 1
        assert run.places is not None
        cells.append(Cells(kind, vertices if order is None else vertices[:, order]))
        corners.append(run.places if order is None else _in_order(run.places, order))
    return cells, corners


def _in_order(places: Callable[[], Places], order: Sequence[int]) -> Callable[[], Places]:
    return lambda: places().at((slice(None), list(order)))


def _untold(sections: Sequence[Section], comments: bool) -> tuple[str, ...]:
    names = dict.fromkeys(one.name for one in sections if one.name not in CELLS and one.name != "Vertices")
    return ("comments",) * comments + ((f"sections {', '.join(names)}",) if names else ())
