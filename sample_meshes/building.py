"""Elements of every type, made from triangles and tetrahedra, in layers and in boxes.

Cells are rows (m, nodes) in VTK's order, positive where what they are made of is.
"""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import ELEMENTS

Points = NDArray[np.float64]
Cells = NDArray[np.int32]
Blocks = list[tuple[str, Cells]]  # the elements of a mesh by their types, which are keys of the table


def stacked(plane: Points, cells: Cells, heights: NDArray[np.float64]) -> tuple[Points, Cells]:
    """Return the wedges or hexahedra between copies of a mesh of triangles or quads at some heights, layer by layer."""
    count = len(plane)
    points = np.concatenate([np.column_stack([plane, np.full(count, z)]) for z in heights])
    layers = range(len(heights) - 1)
    return points, np.concatenate([np.hstack([cells + k * count, cells + (k + 1) * count]) for k in layers])


def quads(points: Points, triangles: Cells) -> tuple[Points, Cells]:
    """Return the three quads of each triangle, around its centroid."""
    points, (ab, bc, ca, middle) = with_middles(points, triangles, (0, 1), (1, 2), (2, 0), (0, 1, 2))
    a, b, c = triangles.T
    corners = (a, ab, middle, ca), (b, bc, middle, ab), (c, ca, middle, bc)
    return points, np.concatenate([np.column_stack(four) for four in corners]).astype(np.int32)


def hexahedra(points: Points, tets: Cells) -> tuple[Points, Cells]:
    """Return the four hexahedra of each tetrahedron, around its centroid."""
    sets = [some for size in (2, 3, 4) for some in combinations(range(4), size)]
    points, numbers = with_middles(points, tets, *sets)
    at = dict(zip(map(frozenset, sets), numbers, strict=True)) | {frozenset([k]): tets[:, k] for k in range(4)}
    rows = []
    for v, a, b, c in ((0, 1, 2, 3), (1, 2, 0, 3), (2, 0, 1, 3), (3, 0, 2, 1)):
        corners = (v,), (v, a), (v, a, b), (v, b), (v, c), (v, a, c), (v, a, b, c), (v, b, c)
        rows.append(np.column_stack([at[frozenset(some)] for some in corners]))
    return points, np.concatenate(rows).astype(np.int32)


def with_middles(points: Points, rows: Cells, *corners: tuple[int, ...]) -> tuple[Points, list[NDArray[np.int64]]]:
    """Append the middles of these corners of each element, and return their numbers (m,).

    Neighbours share what has the same corners. Fewer corners come before more.
    """
    found, numbers, count = [points], [], len(points)
    for size in sorted({len(some) for some in corners}):
        sets = [np.sort(rows[:, some], axis=1) for some in corners if len(some) == size]
        distinct, inverse = np.unique(np.concatenate(sets), axis=0, return_inverse=True)
        found.append(points[distinct].mean(axis=1))
        numbers += list(count + inverse.reshape(len(sets), -1))
        count += len(distinct)
    return np.concatenate(found), numbers


# The corners of a cell in VTK's order, and what it is cut into; all cuts of its sides run from the lowest to the
# highest corner, so that neighbours agree.
_CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
_TETS = ((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6))
_WEDGES = ((0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7))


def box(kinds: NDArray[np.str_], *axes: NDArray[np.float64]) -> tuple[Points, Blocks]:
    """Return a box of elements of several types, whose cells have these coordinates.

    `kinds` (i, j, k) tells what each cell becomes: a "hexahedron", two of "wedge" side by side, six of "tetra", or a
    "pyramid" on each side with its tip in the middle, and two tetrahedra in its place where the neighbour's side is
    cut. Those of tetrahedra are cut, those of wedges above and below, those of hexahedra not; so only pyramids fit to
    all, and what else are neighbours have to agree.
    """
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points), dtype=np.int32).reshape([len(axis) for axis in axes])
    i, j, k = kinds.shape
    cells = np.stack([number[x : x + i, y : y + j, z : z + k] for x, y, z in _CORNERS], axis=-1)
    centred = cells[kinds == "pyramid"]
    pyramids, tets = _around_middles(kinds, centred, len(points))
    blocks = {
        "hexahedron": cells[kinds == "hexahedron"],
        "wedge": cells[kinds == "wedge"][:, _WEDGES].reshape(-1, 6),
        "pyramid": pyramids,
        "tetra": np.concatenate([tets, cells[kinds == "tetra"][:, _TETS].reshape(-1, 4)]),
    }
    points = np.concatenate([points, points[centred].mean(axis=1)])
    return points, [(key, rows) for key, rows in blocks.items() if len(rows)]


def _around_middles(kinds: NDArray[np.str_], cells: Cells, first: int) -> tuple[Cells, Cells]:
    """Return the pyramids and tets on the sides of cells, whose middles are numbered from `first` on."""
    within = np.full([size + 2 for size in kinds.shape], "", dtype=kinds.dtype)
    within[1:-1, 1:-1, 1:-1] = kinds
    at = np.argwhere(kinds == "pyramid") + 1
    middle = np.arange(first, first + len(cells), dtype=np.int32)
    pyramids, tets = [], []
    sides = product(range(3), (-1, 1))
    for (axis, step), facet in zip(sides, ELEMENTS["hexahedron"].shape.facets, strict=True):
        beside = within[tuple((at + step * np.eye(3, dtype=int)[axis]).T)]
        cut = (beside == "tetra") | ((beside == "wedge") & (axis == 2))
        a, b, c, d = cells[:, facet].T  # seen from outside; the lowest first
        pyramids.append(np.column_stack([a, d, c, b, middle])[~cut])
        tets += [np.column_stack([a, c, b, middle])[cut], np.column_stack([a, d, c, middle])[cut]]
    return np.concatenate(pyramids), np.concatenate(tets)


def outer_facets(cells: Blocks) -> list[Cells]:
    """Return the facets (k, nodes) that belong to one element, seen from outside, those of each number of nodes."""
    by_size: dict[int, list[Cells]] = {}
    for key, rows in cells:
        for facet in ELEMENTS[key].shape.facets:
            by_size.setdefault(len(facet), []).append(rows[:, facet])
    outer = []
    for several in by_size.values():
        rows = np.concatenate(several)
        _, index, count = np.unique(np.sort(rows, axis=1), axis=0, return_index=True, return_counts=True)
        outer.append(rows[index[count == 1]])
    return outer


def inner_vertices(count: int, cells: Blocks) -> NDArray[np.bool_]:
    """Return which of so many vertices are on no outer facet."""
    inner = np.ones(count, dtype=bool)
    for facets in outer_facets(cells):
        inner[facets] = False
    return inner


def scattered(points: Points, free: NDArray[np.bool_], percent: float, distance: float, seed: int = 0) -> Points:
    """Move so many percent of all points, of those that are free, by a distance in random directions."""
    random = np.random.default_rng(seed)
    chosen = random.permutation(np.flatnonzero(free))[: round(percent / 100 * len(points))]
    directions = random.standard_normal((len(chosen), points.shape[1]))
    moved = points.copy()
    moved[chosen] += distance * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return moved
