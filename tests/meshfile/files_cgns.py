"""CGNS files as gmsh writes them, and as they are by the description of the format: nodes of a tree in HDF5."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapes
from files_exodus import halves
from files_medit import surface, write_with_gmsh
from numpy.typing import NDArray

REPEATED = 2  # a coordinate that two zones have
NUMBERS = {"line": 3, "triangle": 5, "quad": 7, "tetra": 10, "pyramid": 12, "wedge": 14, "hexahedron": 17}
AXES = ("CoordinateX", "CoordinateY", "CoordinateZ")
KINDS = {"int32": "I4", "int64": "I8", "float32": "R4", "float64": "R8", "int8": "C1"}
Range = Sequence[Sequence[int]]


def describe(found: Any, name: str, label: str, kind: str) -> None:
    """Texts of the length that other programs expect."""
    for key, text, size in (("name", name, 33), ("label", label, 33), ("type", kind, 3)):
        found.attrs.create(key, text.encode(), dtype=f"S{size}")


def node(parent: Any, name: str, label: str, data: Any = None) -> Any:
    """A node of the tree; texts are bytes."""
    found = parent.create_group(name, track_order=True)
    values = np.frombuffer(data.encode(), np.int8) if isinstance(data, str) else data
    kind = "MT" if values is None else KINDS[np.asarray(values).dtype.name]
    describe(found, name, label, kind)
    found.attrs["flags"] = np.array([1], dtype=np.int32)
    if values is not None:
        found.create_dataset(" data", data=values)
    return found


def tree(path: Path, fill: Callable[[Any], None]) -> None:
    """A file with a version, and what fills it."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", track_order=True, libver=("earliest", "v108")) as file:
        describe(file, "HDF5 MotherNode", "Root Node of HDF5 File", "MT")
        for name, text, size in ((" format", "IEEE_LITTLE_32", 15), (" hdf5version", "HDF5 Version 1.8.0", 33)):
            file.create_dataset(name, data=np.frombuffer(text.ljust(size, "\0").encode(), np.int8))
        node(file, "CGNSLibraryVersion", "CGNSLibraryVersion_t", np.array([3.4], dtype=np.float32))
        fill(file)


def base(file: Any, cells: int, space: int = 3, name: str = "Base") -> Any:
    return node(file, name, "CGNSBase_t", np.array([cells, space], dtype=np.int32))


def zone(parent: Any, name: str, points: NDArray[Any], shape: Sequence[int] = (), cells: int = 0) -> Any:
    """A zone of points, which are in the order of Fortran where they are a block of some shape."""
    shape = tuple(shape)
    sizes = np.array([shape, [n - 1 for n in shape], [0] * len(shape)] if shape else [[len(points)], [cells], [0]])
    found = node(parent, name, "Zone_t", sizes.astype(np.int32))
    node(found, "ZoneType", "ZoneType_t", "Structured" if shape else "Unstructured")
    grid = node(found, "GridCoordinates", "GridCoordinates_t")
    for axis, values in zip(AXES, points.T, strict=False):
        node(grid, axis, "DataArray_t", np.ascontiguousarray(values).reshape(shape[::-1] or -1))
    return found


def section(parent: Any, name: str, number: int, first: int, nodes: NDArray[np.int64], count: int = 0) -> Any:
    found = node(parent, name, "Elements_t", np.array([number, 0], dtype=np.int32))
    last = first + (count or len(nodes)) - 1
    node(found, "ElementRange", "IndexRange_t", np.array([first, last], dtype=np.int32))
    node(found, "ElementConnectivity", "DataArray_t", nodes.ravel().astype(np.int32))
    return found


def condition(
    parent: Any, name: str, *, box: Range | None = None, points: Range | None = None, family: str = "", at: str = ""
) -> None:
    """A boundary condition on a range of indices, or on some of these."""
    table = parent.get("ZoneBC") or node(parent, "ZoneBC", "ZoneBC_t")
    found = node(table, name, "BC_t", "FamilySpecified" if family else "BCWall")
    if box is not None:
        node(found, "PointRange", "IndexRange_t", np.array(box, dtype=np.int32))
    if points is not None:
        node(found, "PointList", "IndexArray_t", np.array(points, dtype=np.int32))
    if at:
        node(found, "GridLocation", "GridLocation_t", at)
    if family:
        node(found, "FamilyName", "FamilyName_t", family)


def interface(
    parent: Any, name: str, donor: str, mine: Range, theirs: Range, transform: Sequence[int], **more: Any
) -> Any:
    table = parent.get("ZoneGridConnectivity") or node(parent, "ZoneGridConnectivity", "ZoneGridConnectivity_t")
    found = node(table, name, "GridConnectivity1to1_t", donor)
    node(found, "Transform", '"int[IndexDimension]"', np.array(transform, dtype=np.int32))
    node(found, "PointRange", "IndexRange_t", np.array(mine, dtype=np.int32))
    node(found, "PointRangeDonor", "IndexRange_t", np.array(theirs, dtype=np.int32))
    return found


def of_gmsh(path: Path) -> None:
    write_with_gmsh(path, *shapes.block())


def plane(path: Path) -> None:
    """Single precision, in the plane, with a section and a condition for the boundary."""
    points, cells = shapes.plate()
    edges = surface(cells)

    def fill(file: Any) -> None:
        found = zone(base(file, 2, 2), "plate", points[:, :2].astype(np.float32), cells=len(cells))
        section(found, "inside", 5, 1, cells + 1)
        section(found, "rim", 3, len(cells) + 1, edges + 1)
        condition(found, "wall", box=[[len(cells) + 1], [len(cells) + len(edges)]], at="EdgeCenter")

    tree(path, fill)


def mixed(path: Path) -> None:
    """Tetrahedra and the triangles of their boundary in one section, one after another."""
    points, cells = shapes.block()
    skin = surface(cells)
    rows = [[5, *row] for row in (skin + 1).tolist()] + [[10, *row] for row in (cells + 1).tolist()]
    order = np.random.default_rng(2).permutation(len(rows))

    def fill(file: Any) -> None:
        found = zone(base(file, 3), "block", points, cells=len(cells))
        node(found, "FlowSolution", "FlowSolution_t").create_dataset("beside", data=np.arange(3))
        numbers = np.concatenate([rows[i] for i in order.tolist()])
        starts = np.cumsum([0, *(len(rows[i]) for i in order.tolist())])
        one = section(found, "all", 20, 1, numbers, len(rows))
        node(one, "ElementStartOffset", "DataArray_t", starts)

    tree(path, fill)


def two_zones(path: Path) -> None:
    """Each with the points of its cells: those between them stand twice."""
    points, cells = shapes.block()

    def fill(file: Any) -> None:
        parent = base(file, 3)
        for name, part in zip("ab", halves(points, cells), strict=True):
            used, inverse = np.unique(part, return_inverse=True)
            found = zone(parent, name, points[used], cells=len(part))
            section(found, "tets", 10, 1, inverse.reshape(part.shape) + 1)

    tree(path, fill)


FILES: dict[str, Callable[[Path], None]] = {
    "gmsh.cgns": of_gmsh,
    "plane.cgns": plane,
    "mixed.cgns": mixed,
    "two_zones.cgns": two_zones,
}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3) of all zones, each place once, and all other data sets and attributes."""
    h5py = pytest.importorskip("h5py")
    zones: dict[str, list[NDArray[Any]]] = {}
    rest: dict[str, Any] = {}

    def visit(name: str, one: Any) -> None:
        rest[f"{name} attributes"] = {key: np.array(value) for key, value in one.attrs.items()}
        if isinstance(one, h5py.Dataset):
            parent = name.rpartition("/")[0]
            if parent.rpartition("/")[2] in AXES:
                zones.setdefault(parent.rpartition("/GridCoordinates")[0], []).append(one[()].ravel())
            else:
                rest[name] = one[()]

    with h5py.File(path) as file:
        file.visititems(visit)
    copies = np.concatenate([np.stack(columns, axis=1) for columns in zones.values()])
    first = np.sort(np.unique(copies, axis=0, return_index=True)[1])
    points = np.zeros((len(first), 3), dtype=copies.dtype)
    points[:, : copies.shape[1]] = copies[first]
    return points, rest


def numbers_of(table: Mapping[str, Any], name: str) -> NDArray[np.int64]:
    """The one data set whose path ends so."""
    (found,) = (values for path, values in table.items() if path.endswith(f"{name}/ data"))
    return np.asarray(found)
