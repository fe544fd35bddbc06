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
FACES = {
    "tetra": "123 032 013 021", "hexahedron": "3210 0154 1265 2376 3047 4567", "wedge": "021 345 0143 1254 2035",
}  # fmt: skip
# Along an edge from 0 to 1.
EVEN = {order: [i / order for i in range(order + 1)] for order in (2, 3, 4)}
LOBATTO = {
    3: [0, (1 - 0.2**0.5) / 2, (1 + 0.2**0.5) / 2, 1],
    4: [0, (1 - (3 / 7) ** 0.5) / 2, 0.5, (1 + (3 / 7) ** 0.5) / 2, 1]
}  # fmt: skip


def of_order(
    points: NDArray[np.float64],
    blocks: Sequence[tuple[str, NDArray[Any]]],
    ordering: int,
    collection: str,
    along: Sequence[float],
) -> str:
    """A mesh whose nodes lie in straight elements, counted one by one as MFEM counts them."""
    cells = [(key, row) for key, rows in blocks for row in rows.tolist()]
    d, found = points.shape[1], [*points]
    met: set[frozenset[int]] = set()
    for some in (EDGES, FACES):
        for key, row in cells:
            for word in some.get(key, "").split():
                corners = [row[int(one)] for one in word]
                if frozenset(corners) not in met:
                    met.add(frozenset(corners))
                    found += inside(points[sorted(corners) if some is EDGES else corners], along)
    for key, row in cells:
        found += inside(points[row], along, key)
    skin = facets(cells)
    listed = ["".join(f"1 {NUMBERS[key]} {' '.join(map(str, row))}\n" for key, row in some) for some in (cells, skin)]
    return (
        f"MFEM mesh v1.0\n{HEAD}dimension\n{d}\n\nelements\n{len(cells)}\n{listed[0]}\n"
        f"boundary\n{len(skin)}\n{listed[1]}\nvertices\n{len(points)}\n{nodes(np.array(found), ordering, collection)}"
    )


def inside(corners: NDArray[np.float64], along: Sequence[float], key: str = "") -> list[NDArray[np.float64]]:
    """The nodes inside of an edge, a face or an element, as loops over its coordinates make them."""
    g, p = along, len(along) - 1
    steps = range(1, p)
    key = key or ("line", "triangle", "quad")[len(corners) - 2]

    def simplex(*steps: int) -> list[float]:
        left = p - sum(steps)
        shares = [g[left], *(g[i] for i in steps)]
        return [share / sum(shares) for share in shares]

    def quad(i: int, j: int) -> list[float]:
        x, y = g[i], g[j]
        return [(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y]

    def up(base: list[float], k: int) -> list[float]:
        return [(1 - g[k]) * share for share in base] + [g[k] * share for share in base]

    weights = {
        "line": lambda: [[1 - g[i], g[i]] for i in steps],
        "triangle": lambda: [simplex(i, j) for j in steps for i in steps if i + j < p],
        "quad": lambda: [quad(i, j) for j in steps for i in steps],
        "tetra": lambda: [simplex(i, j, k) for k in steps for j in steps for i in steps if i + j + k < p],
        "wedge": lambda: [up(simplex(i, j), k) for k in steps for j in steps for i in steps if i + j < p],
        "hexahedron": lambda: [up(quad(i, j), k) for k in steps for j in steps for i in steps],
    }[key]()
    return [np.array(one) @ corners for one in weights]


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
