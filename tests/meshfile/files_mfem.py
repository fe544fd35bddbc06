"""MFEM meshes as MFEM writes them, and a reader of our own, word by word."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import surface
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import ELEMENTS

TYPES = {2: 1, 3: 2, 4: 4}  # of MFEM, by the number of vertices of a simplex
CORNERS = [1, 2, 3, 4, 4, 8, 6, 5]  # of each type
HEAD = "\n#\n# MFEM Geometry Types (see fem/geom.hpp):\n#\n# POINT       = 0\n# SEGMENT     = 1\n#\n\n"


def elements(cells: NDArray[np.int64], attributes: Sequence[int]) -> str:
    kind = TYPES[cells.shape[1]]
    rows = (f"{a} {kind} {' '.join(map(str, c))}\n" for a, c in zip(attributes, cells, strict=True))
    return f"{len(cells)}\n{''.join(rows)}"


def rows(points: NDArray[np.float64]) -> str:
    return "".join(" ".join(f"{x:.6f}" for x in p) + "\n" for p in points)


def text(
    points: NDArray[np.float64],
    cells: NDArray[np.int64],
    coordinates: str | None = None,
    version: str = "1.0",
    sets: tuple[str, str] = ("", ""),
) -> str:
    d = cells.shape[1] - 1
    skin = surface(cells)
    marks = [1 + 2 * i // len(skin) for i in range(len(skin))]
    return (
        f"MFEM mesh v{version}\n{HEAD}dimension\n{d}\n\nelements\n{elements(cells, [1] * len(cells))}\n{sets[0]}"
        f"boundary\n{elements(skin, marks)}\n{sets[1]}vertices\n{len(points)}\n"
    ) + (f"{d}\n{rows(points[:, :d])}" if coordinates is None else coordinates)


def nodes(points: NDArray[np.float64], order: int, collection: str) -> str:
    """The grid function of the nodes: by component, a number a line, or by point."""
    d = points.shape[1]
    values = "".join(f"{x:.6f}\n" for x in points.T.ravel()) if order == 0 else rows(points)
    return (
        f"\nnodes\nFiniteElementSpace\nFiniteElementCollection: {collection}\nVDim: {d}\nOrdering: {order}\n\n{values}"
    )


NUMBERS = {"line": 1, "triangle": 2, "quad": 3, "tetra": 4, "hexahedron": 5, "wedge": 6, "pyramid": 7}
# By hand from the list of geometries: the edges of each, and the faces that are squares.
EDGES = {
    "line": "01", "triangle": "01 12 20", "quad": "01 12 23 30", "tetra": "01 02 03 12 13 23",
    "hexahedron": "01 12 32 03 45 56 76 47 04 15 26 37", "wedge": "01 12 20 34 45 53 03 14 25",
}  # fmt: skip
SQUARES = {"quad": "0123", "hexahedron": "3210 0154 1265 2376 3047 4567", "wedge": "0143 1254 2035"}


def of_second_order(
    points: NDArray[np.float64], blocks: Sequence[tuple[str, NDArray[Any]]], order: int, collection: str
) -> str:
    """A mesh whose nodes of second order lie in the middle, counted one by one as MFEM counts them."""
    cells = [(key, row) for key, rows in blocks for row in rows.tolist()]
    d, middles = points.shape[1], [*points]
    met: set[frozenset[int]] = set()
    for some in (EDGES, SQUARES):
        for key, row in cells:
            for word in some.get(key, "").split() if key != "quad" or some is EDGES else ():
                corners = [row[int(one)] for one in word]
                if frozenset(corners) not in met:
                    met.add(frozenset(corners))
                    middles.append(points[corners].mean(axis=0))
    middles += [points[row].mean(axis=0) for key, row in cells if key in ("quad", "hexahedron")]
    skin = facets(cells)
    listed = ["".join(f"1 {NUMBERS[key]} {' '.join(map(str, row))}\n" for key, row in some) for some in (cells, skin)]
    return (
        f"MFEM mesh v1.0\n{HEAD}dimension\n{d}\n\nelements\n{len(cells)}\n{listed[0]}\n"
        f"boundary\n{len(skin)}\n{listed[1]}\nvertices\n{len(points)}\n{nodes(np.array(middles), order, collection)}"
    )


def facets(cells: Sequence[tuple[str, list[int]]]) -> list[tuple[str, list[int]]]:
    """The facets that one element has alone."""
    found: dict[frozenset[int], list[list[int]]] = {}
    for key, row in cells:
        for facet in ELEMENTS[key].shape.facets:
            found.setdefault(frozenset(row[i] for i in facet), []).append([row[i] for i in facet])
    kinds = {2: "line", 3: "triangle", 4: "quad"}
    return [(kinds[len(rows[0])], rows[0]) for rows in found.values() if len(rows) == 1]


def plane(path: Path) -> None:
    path.write_text(text(*shapes.plate()))


def sets(path: Path) -> None:
    """Version 1.3, with sets of attributes, and the end that a serial mesh in a parallel one has."""
    named = ('attribute_sets\n2\n"all" 1 1\n"none # of it" 0\n\n', 'bdr_attribute_sets\n1\n"the wall" 2 2 7\n\n')
    end = "\nmfem_serial_mesh_end\n\ncommunication_groups\nnumber_of_groups 2\n1 0\n2 0 1\n"
    path.write_bytes((text(*shapes.block(), version="1.3", sets=named) + end).replace("\n", "\r\n").encode())


def by_component(path: Path) -> None:
    points, cells = shapes.block()
    path.write_text(text(points, cells, nodes(points, 0, "H1_3D_P1")))


def by_point(path: Path) -> None:
    """Version 1.2, with the sign of its end."""
    points, cells = shapes.plate()
    path.write_text(text(points, cells, nodes(points[:, :2], 1, "Linear"), "1.2") + "\nmfem_mesh_end\n")


FILES: dict[str, Callable[[Path], None]] = {
    "plane.mesh": plane, "sets.mesh": sets, "by_component.mesh": by_component, "by_point.mesh": by_point,
}  # fmt: skip


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all words that are no coordinates."""
    body = path.read_text().split()
    rest: list[str] = []

    def take(count: int) -> list[str]:
        taken = body[:count]
        del body[:count]
        rest.extend(taken)
        return taken

    while take(1) != ["vertices"]:
        pass
    n = int(take(1)[0])
    d = int(take(1)[0]) if body[0] != "nodes" else 0
    by_component = False
    if not d:
        about = take(8)
        d, by_component = int(about[5]), about[7] == "0"
    values = np.array(body[: n * d], dtype=float)
    points = values.reshape(d, n).T if by_component else values.reshape(n, d)
    return np.column_stack([points, np.zeros((n, 3 - d))]), {"words": rest + body[n * d :]}
