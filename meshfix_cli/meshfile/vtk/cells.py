"""The cells of VTK, which its legacy and XML files share: their numbers, names and runs.

Source: VTK, "vtkCellType.h"; for what is older "vtkXMLUnstructuredDataReader.cxx" and "vtkUnstructuredGridReader.cxx".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, counted
from meshfix_cli.mesh.lagrange import kinds
from meshfix_cli.meshfile.blocks import cells_of_block
from meshfix_cli.meshfile.source import Cells, regions_among
from meshfix_cli.meshfile.tables import alike

# The name and the number of vertices; 0: any.
TYPES = {element.vtk: (key, element.nodes) for key, element in ELEMENTS.items() if element.vtk is not None} | {
    0: ("empty", 0), 2: ("poly_vertex", 0), 4: ("poly_line", 0), 15: ("penta_prism", 10), 16: ("hexa_prism", 12),
    36: ("polygon_quadratic", 0), 41: ("polyhedron", 0), 68: ("VTK_LAGRANGE_CURVE", 0),
    69: ("VTK_LAGRANGE_TRIANGLE", 0), 70: ("VTK_LAGRANGE_QUADRILATERAL", 0), 71: ("VTK_LAGRANGE_TETRAHEDRON", 0),
    72: ("VTK_LAGRANGE_HEXAHEDRON", 0), 73: ("VTK_LAGRANGE_WEDGE", 0), 74: ("VTK_LAGRANGE_PYRAMID", 0),
    75: ("VTK_BEZIER_CURVE", 0), 76: ("VTK_BEZIER_TRIANGLE", 0), 77: ("VTK_BEZIER_QUADRILATERAL", 0),
    78: ("VTK_BEZIER_TETRAHEDRON", 0), 79: ("VTK_BEZIER_HEXAHEDRON", 0), 80: ("VTK_BEZIER_WEDGE", 0),
    81: ("VTK_BEZIER_PYRAMID", 0),
}  # fmt: skip
# Of any order, by the number of nodes; Bezier's have nodes that lie elsewhere, and VTK knows no pyramids of these.
_LAGRANGE = {68: "line", 69: "triangle", 70: "quad", 71: "tetra", 72: "hexahedron", 73: "wedge"}
_HEXAHEDRON = 72
# The types of cells that polydata do not tell: that of any number of vertices, and those of some numbers.
POLYDATA: dict[bytes, tuple[int, dict[int, int]]] = {
    b"vertices": (2, {1: 1}), b"lines": (4, {2: 3}), b"polygons": (7, {3: 5, 4: 9}), b"triangle_strips": (6, {})
}  # fmt: skip
# What VTK calls the types that can be told by their vertices alone: polyhedra have faces as well.
_NUMBERS = {name: number for number, (name, _) in TYPES.items() if name not in ("empty", "polyhedron")}
_OF_FAMILY = {family: number for number, family in _LAGRANGE.items()}
GHOSTS = frozenset({"vtkGhostType", "vtkGhostLevels"})  # arrays that mark cells which other pieces have as well


class Run(NamedTuple):
    """Cells of one type with the same number of vertices.

    Attributes
    ----------
    type : str
    rows : (k,) int64
        Which cells of the file they are.
    vertices : (k, size) int
        In the order of VTK.
    order : sequence of int or None
        Which of the file's vertices stands in each place, where that is another.
    """

    type: str
    rows: NDArray[np.int64]
    vertices: NDArray[np.integer[Any]]
    order: Sequence[int] | None = None

    @property
    def cells(self) -> Cells:
        """The run as sources hold it; its `ids` are `rows`."""
        return Cells(self.type, self.vertices, self.rows)


def runs(
    types: NDArray[np.integer[Any]],
    offsets: NDArray[np.int64],
    connectivity: NDArray[np.integer[Any]],
    old: bool = False,
) -> list[Run]:
    """Cut cells into runs, in the order of the file where they are not too many.

    Parameters
    ----------
    types : (m,) int
        Numbers of VTK.
    offsets : (m+1,) int64
        Cell i has the vertices `connectivity[offsets[i]:offsets[i + 1]]`.
    connectivity : (k,) int
    old : bool
        The file is of VTK 8 or before, where hexahedra of any order have another order of nodes.

    Raises
    ------
    ReadError
        The offsets do not fit, or a cell has more or fewer vertices than its type.
    """
    sizes = np.diff(offsets)
    if len(sizes) != len(types) or offsets[0] < 0 or (sizes < 0).any() or offsets[-1] > len(connectivity):
        raise ReadError("is not a readable VTK file: the offsets of its cells do not fit their vertices")
    found = []
    for rows in alike(types, sizes):
        number, size = int(types[rows[0]]), int(sizes[rows[0]])
        name, expected = TYPES.get(number, (f"vtk{number}", 0))
        if name == "polygon":
            name = {3: "triangle", 4: "quad"}.get(size, name)
        name = (_lagrange(_LAGRANGE[number], size) if number in _LAGRANGE else None) or name
        if expected not in (0, size):
            corners = counted(size, "vertex", "vertices")
            raise ReadError(f"is not a readable VTK file: its cell {rows[0]} is a {name} with {corners}")
        if rows[-1] - rows[0] == len(rows) - 1:  # they stand one behind the other
            vertices = connectivity[offsets[rows[0]] : offsets[rows[-1] + 1]].reshape(len(rows), size)
        else:
            vertices = connectivity[offsets[rows][:, None] + np.arange(size)]
        order = order_of(name, number) if old else None
        found.append(Run(name, rows, vertices if order is None else vertices[:, order], order))
    return found


def number_of(key: str) -> int | None:
    """Return VTK's number of a type; None: it has none, or cells of it cannot be told by their vertices."""
    kind = None if key in _NUMBERS else kinds().get(key)
    return _OF_FAMILY.get(kind.family) if kind and kind.complete else _NUMBERS.get(key)


def order_of(key: str, number: int) -> list[int] | None:
    """Return which of the vertices in an old file stands in each place, where that is another order."""
    return kinds()[key].order_of("vtk 8") if number == _HEXAHEDRON and key in kinds() else None


def types_of_sizes(sizes: NDArray[np.int64], other: int, known: Mapping[int, int]) -> NDArray[np.int64]:
    """Return the types of cells of which a section tells only how many vertices each has; see `POLYDATA`."""
    types = np.full(len(sizes), other)
    for size, kind in known.items():
        types[sizes == size] = kind
    return types


def in_rows(shape: Sequence[int]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the types, offsets and connectivity, as `runs` takes them, of a grid with points along each index."""
    along = [size for size in shape if size > 1]
    if not along or 0 in shape:
        return np.empty(0, np.int64), np.zeros(1, np.int64), np.empty(0, np.int64)
    key, vertices = cells_of_block(along)
    types = np.full(len(vertices), ELEMENTS[key].vtk)
    return types, np.arange(len(vertices) + 1) * vertices.shape[1], vertices.ravel()


def no_points(kind: str) -> ReadError:
    """Return the error for a grid whose points follow from a few numbers."""
    return ReadError(f"holds a grid ({kind}) whose points have no coordinates of their own that could change")


def _lagrange(family: str, size: int) -> str | None:
    """Return the type of elements of any order; None: their nodes are not known."""
    if size == ELEMENTS[family].nodes:
        return family
    kind = kinds().get(f"{family}{size}")
    return f"{family}{size}" if kind and kind.complete else None


def groups_among(about: Mapping[str, NDArray[Any]], regions: Sequence[str]) -> dict[str, list[int]]:
    """Return which field data are names of regions: those of two integers, its number and its dimension."""
    return {name: values.tolist() for name, values in about.items() if regions and is_of_group(values)}


def is_of_group(values: NDArray[Any]) -> bool:
    """Whether field data may be the number and the dimension of a group."""
    return values.dtype.kind in "iu" and values.size == 2 and values.ravel()[1] in range(4)


def sets_among(arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[np.int64]]:
    """Return the rows of what bytes of 0 and 1 mark, as programs write selections; no materials and no ghosts."""
    regions = regions_among(list(arrays))
    return {
        name: np.flatnonzero(values)
        for name, values in arrays.items()
        if values.dtype == np.uint8 and values.ndim == 1 and values.max(initial=0) < 2
        if name not in regions and not name.startswith("vtk")
    }


def sets_of_runs(
    cell: Mapping[str, Sequence[NDArray[Any]]],
) -> dict[str, list[NDArray[np.int64]]]:
    """Return the same of cells, in each run."""
    joined = {name: np.concatenate(runs) for name, runs in cell.items() if runs}
    return {name: [np.flatnonzero(mask) for mask in cell[name]] for name in sets_among(joined)}


def markings(
    names: Set[str],
    cells: Sequence[Cells],
    cell: Callable[[], Mapping[str, Sequence[NDArray[Any]]]],
    damaged: str,
) -> tuple[tuple[str, ...], list[Cells]]:
    """Return which cell arrays tell materials apart, and the runs of cells with their ghosts marked.

    Parameters
    ----------
    names : set of str
        All cell arrays; `cell` reads them, if one of them matters.
    damaged : str
        What is said of one that matters and cannot be read: else an interface would be free to move.
    """
    regions, marks = regions_among(sorted(names)), GHOSTS & names
    for name in (*regions, *marks):
        if name not in cell():
            raise ReadError(damaged.format(repr(name)))
    if not marks:
        return regions, list(cells)
    ghosts = [np.any([cell()[name][i] != 0 for name in marks], axis=0) for i in range(len(cells))]
    return regions, [replace(run, ghosts=mask) for run, mask in zip(cells, ghosts, strict=True)]
