"""What a mesh in memory is, what it holds, and the same with other points."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.elements import ELEMENTS, element_of
from meshfix_cli.mesh.mesh import Mesh, regular
from meshfix_cli.meshfile.plane import plane_basis
from meshfix_cli.meshfile.source import Arrays, Cells, Source
from meshfix_cli.meshfile.vtk.cells import POLYDATA, TYPES, in_rows, markings, runs, types_of_sizes

# Elements that an array (m, k) names, by the coordinates of its points and by k.
_OF_ARRAY = {
    (2, 3): "triangle", (2, 4): "quad", (3, 3): "triangle", (3, 4): "tetra", (3, 5): "pyramid", (3, 6): "wedge",
    (3, 8): "hexahedron",
}  # fmt: skip
_POLYDATA = dict(zip(("Verts", "Lines", "Polys", "Strips"), POLYDATA.values(), strict=True))
_GHOSTS_DAMAGED = "its cell data {} cannot be read, and tell which cells are held"


@dataclass(frozen=True)
class Kind:
    """Meshes of one library.

    Attributes
    ----------
    name : str
        What an object is called in a report.
    source : callable
        Gives what an object holds; it is not changed, and not kept.
    moved : callable
        (object, points (n, d)) -> one of its kind with these points, and with all that it holds else.
    """

    name: str
    source: Callable[[Any], Source]
    moved: Callable[[Any, NDArray[np.floating[Any]]], Any]


def kind_of(mesh: object) -> Kind:
    """Return what an object is.

    Raises
    ------
    InvalidMeshError
        It is no mesh of a library that is known.
    """
    for cls in type(mesh).__mro__:
        library = cls.__module__.partition(".")[0]
        if (library, cls.__name__) == ("meshio", "Mesh"):
            return Kind("meshio.Mesh", _of_meshio, _moved_meshio)
        if cls.__name__ in ("vtkUnstructuredGrid", "vtkPolyData", "vtkStructuredGrid"):
            library = type(mesh).__module__.partition(".")[0]
            return Kind(f"{library}.{type(mesh).__name__}", _of_vtk, _moved_vtk)
    if isinstance(mesh, Mesh):
        return Kind("Mesh", _of_mesh, _moved_mesh)
    if isinstance(mesh, tuple | list) and len(mesh) == 2:
        return Kind("(points, cells)", _of_arrays, _moved_arrays)
    raise InvalidMeshError(
        f"{type(mesh).__module__}.{type(mesh).__qualname__} is no mesh that meshfix knows: it takes a meshio.Mesh, "
        "a pyvista.UnstructuredGrid, PolyData or StructuredGrid, one of VTK, a path, or points and cells as a pair; of "
        "other data sets of VTK what pyvista's cast_to_unstructured_grid gives"
    )


def _of_meshio(mesh: Any) -> Source:
    from meshfix_cli.meshfile.through_meshio import source_of

    return source_of(mesh)


def _moved_meshio(mesh: Any, points: NDArray[np.floating[Any]]) -> Any:
    moved = mesh.copy()
    moved.points = points
    return moved


def _of_mesh(mesh: Mesh) -> Source:
    return Source(mesh.points, [Cells(block.element.key, block.vertices) for block in mesh.topology.blocks])


def _moved_mesh(mesh: Mesh, points: NDArray[np.floating[Any]]) -> Mesh:
    return mesh.with_points(points.astype(np.float64))


def points_of(given: Any) -> NDArray[np.floating[Any]]:
    """Return points (n, d) that a user gives.

    Raises
    ------
    InvalidMeshError
        They are none.
    """
    points = regular(given, "the points are")
    if points.ndim != 2 or points.dtype.kind not in "fiu":
        raise InvalidMeshError(f"the points are an array of shape {points.shape}, and not of (n, 2) or (n, 3) numbers")
    return points if points.dtype.kind == "f" else points.astype("f8")


def _of_arrays(mesh: Any) -> Source:
    points = points_of(mesh[0])
    return Source(points, [*_runs_of(points, mesh[1])])


def _runs_of(points: NDArray[np.floating[Any]], cells: Any) -> Iterable[Cells]:
    """Give the runs of cells that an array, a dict, pairs of types and arrays or meshio's blocks name."""
    pairs, dimension = _pairs(cells), points.shape[1]
    if pairs is None:
        array = regular(cells, "the cells are")
        key = _OF_ARRAY.get((dimension, array.shape[-1])) if array.ndim == 2 else None
        if key is None:
            known = ", ".join(f"(m, {k}) of {name}" for (d, k), name in _OF_ARRAY.items() if d == dimension)
            raise InvalidMeshError(
                f"the cells are an array of shape {array.shape}; known are {known}; others by their types, as in "
                "{'quad': array}"
            )
        if key == "tetra" and _are_flat(points, array):
            raise InvalidMeshError("the cells, an array (m, 4), are in a plane: quadrilaterals are {'quad': array}")
        pairs = [(key, array)]
    for key, rows in pairs:
        array = regular(rows, f"the {key} cells are")
        if array.ndim != 2 or array.dtype.kind not in "iu":
            raise InvalidMeshError(f"the {key} cells are not an array (m, k) of whole numbers")
        name = TYPES[int(key)][0] if isinstance(key, Integral) and int(key) in TYPES else str(key)
        if element_of(name) is None and name.isalpha():  # those of other libraries have numbers, or begin with VTK_
            raise InvalidMeshError(f"there is no type of cells called {name!r}; there are {', '.join(ELEMENTS)}")
        yield Cells(name, array)


def _pairs(cells: Any) -> list[tuple[Any, Any]] | None:
    """Return the types of cells, by names or numbers of VTK, and their arrays; None: they are none."""
    if isinstance(cells, Mapping):
        return [*cells.items()]
    if not isinstance(cells, list | tuple):
        return None
    if all(isinstance(getattr(one, "type", None), str) and hasattr(one, "data") for one in cells):
        return [(one.type, one.data) for one in cells]
    if all(isinstance(one, list | tuple) and len(one) == 2 and isinstance(one[0], str) for one in cells):
        return [(key, rows) for key, rows in cells]
    return None


def _are_flat(points: NDArray[np.floating[Any]], rows: NDArray[np.integer[Any]]) -> bool:
    """Whether cells lie in a plane; those that name other points, or none that are finite, are refused elsewhere."""
    used = np.unique(rows)
    if not len(used) or used.dtype.kind not in "iu" or used[0] < 0 or used[-1] >= len(points):
        return False
    corners = points[used].astype(np.float64)
    spread = np.ptp(corners, axis=0)
    return bool((spread > 0).sum() > 1 and np.isfinite(corners).all() and plane_basis(corners) is not None)


def _moved_arrays(mesh: Any, points: NDArray[np.floating[Any]]) -> Any:
    moved = points, mesh[1]
    return mesh._make(moved) if hasattr(mesh, "_make") else type(mesh)(moved)  # a named tuple takes two arguments


def _numpy(array: Any) -> Any:
    """Return a copy of an array of VTK."""
    return import_module("vtkmodules.util.numpy_support").vtk_to_numpy(array).copy()


def _of_vtk(grid: Any) -> Source:
    """Return what an unstructured or a structured grid or polygons hold; cells of one type are one run."""
    points = _numpy(grid.GetPoints().GetData()) if grid.GetNumberOfPoints() else np.empty((0, 3))
    structured = grid.IsA("vtkStructuredGrid")
    cells_of = _cells_of_polygons if grid.IsA("vtkPolyData") else _cells_in_rows if structured else _cells_of_grid
    types, offsets, connectivity = cells_of(grid)
    found = runs(types, offsets, connectivity) if len(types) else []
    point, cell = _arrays(grid.GetPointData()), _arrays(grid.GetCellData())
    arrays = Arrays(point=point, cell={name: [values[run.rows] for run in found] for name, values in cell.items()})
    regions, cells = markings(arrays.cell.keys(), [run.cells for run in found], lambda: arrays.cell, _GHOSTS_DAMAGED)
    return Source(
        points if points.dtype.kind == "f" else points.astype("f8"), cells, load=lambda: arrays,
        regions=regions, oriented=not structured,  # whose indices may run either way
    )  # fmt: skip


def _arrays(data: Any) -> dict[str, NDArray[Any]]:
    """Return the arrays of numbers by their names."""
    several = [data.GetArray(i) for i in range(data.GetNumberOfArrays())]  # None: texts
    return {one.GetName(): _numpy(one) for one in several if one is not None and one.GetName()}


def _cells_of_grid(grid: Any) -> tuple[NDArray[Any], NDArray[np.int64], NDArray[Any]]:
    """Return types (m,), offsets (m+1,) and connectivity."""
    if not grid.GetNumberOfCells():
        return (np.empty(0, dtype=np.int64),) * 3
    try:
        types = grid.GetCellTypes()
    except TypeError:  # before VTK 9.6
        types = grid.GetCellTypesArray()
    return _numpy(types), *_cell_array(grid.GetCells())


def _cells_in_rows(grid: Any) -> tuple[NDArray[Any], NDArray[np.int64], NDArray[Any]]:
    """Return the same of a structured grid."""
    shape = [0, 0, 0]
    grid.GetDimensions(shape)
    return in_rows(shape)


def _cell_array(cells: Any) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    return _numpy(cells.GetOffsetsArray()).astype("i8"), _numpy(cells.GetConnectivityArray()).astype("i8")


def _cells_of_polygons(grid: Any) -> tuple[NDArray[Any], NDArray[np.int64], NDArray[Any]]:
    """Return the same of vertices, lines, polygons and strips, in which order VTK numbers them."""
    types, sizes, vertices = [np.empty(0, dtype=np.int64)], [np.zeros(1, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    for name, of_sizes in _POLYDATA.items():
        cells = getattr(grid, f"Get{name}")()
        if cells is None or not cells.GetNumberOfCells():
            continue
        offsets, connectivity = _cell_array(cells)
        sizes.append(np.diff(offsets))
        types.append(types_of_sizes(sizes[-1], *of_sizes))
        vertices.append(connectivity)
    return np.concatenate(types), np.cumsum(np.concatenate(sizes)), np.concatenate(vertices)


def _moved_vtk(grid: Any, points: NDArray[np.floating[Any]]) -> Any:
    """Return a deep copy with other points, of the class of the object where that is one of pyvista."""
    moved = grid.copy() if hasattr(grid, "copy") else grid.NewInstance()
    if not hasattr(grid, "copy"):
        moved.DeepCopy(grid)
    changed = grid.GetPoints().NewInstance()
    changed.SetData(import_module("vtkmodules.util.numpy_support").numpy_to_vtk(points, deep=1))
    moved.SetPoints(changed)
    return moved
