"""Exodus files as programs write them: in each form of netCDF, by its own library, by scipy and by VTK."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapes
from numpy.typing import NDArray

from meshfix_cli.mesh.mesh import Mesh

COORDINATES = ("coordx", "coordy", "coordz", "coord")
SIDES_OF_TETRAHEDRA = ((0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 1))
Table = dict[str, tuple[Sequence[str], NDArray[Any]]]  # for each variable its dimensions and values


def text(*names: str) -> NDArray[np.bytes_]:
    """Names of 33 characters, with what is left filled up by zeros, as a table of characters."""
    return np.array([list(name.ljust(33, "\0")) for name in names]).astype("S1")


def tables(
    points: NDArray[np.float64], blocks: Sequence[tuple[str, NDArray[np.int64]]], **extra: tuple[Sequence[str], Any]
) -> tuple[Table, dict[str, str]]:
    """The variables of a mesh, and what each block calls its elements."""
    found: Table = {}
    for axis, name in enumerate(COORDINATES[: points.shape[1]]):
        found[name] = (("num_nodes",), points[:, axis])
    found["eb_prop1"] = (("num_el_blk",), np.arange(10, 10 + len(blocks), dtype="i4"))
    found["eb_status"] = (("num_el_blk",), np.ones(len(blocks), dtype="i4"))
    for i, (_, cells) in enumerate(blocks, 1):
        found[f"connect{i}"] = ((f"num_el_in_blk{i}", f"num_nod_per_el{i}"), (cells + 1).astype("i4"))
    types = {f"connect{i}": kind for i, (kind, _) in enumerate(blocks, 1)}
    return found | {name: (dims, np.asarray(values)) for name, (dims, values) in extra.items()}, types


def dimensions_of(table: Table) -> dict[str, int]:
    """Those that no variable needs to have."""
    cells = sum(len(values) for name, (_, values) in table.items() if name.startswith("connect"))
    axes = len(table["coord"][1]) if "coord" in table else sum(name in table for name in COORDINATES)
    return {"len_string": 33, "len_line": 81, "four": 4, "num_dim": axes, "num_elem": cells}


def halves(points: NDArray[np.float64], cells: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Cells without an interior vertex, and the others: of two materials, between which nothing inside is held."""
    movable = Mesh.build(points[:, : cells.shape[1] - 1], cells).movable
    inner = movable[cells].any(axis=1)
    return [cells[inner], cells[~inner]]


def with_scipy(path: Path, table: Table, types: Mapping[str, str], version: int, records: Sequence[str] = ()) -> None:
    from scipy.io import netcdf_file

    with netcdf_file(path, "w", version=version) as file:
        file.title, file.floating_point_word_size = "a block: coordx", np.int32(8)
        file.version = file.api_version = np.float32(5.1)
        file.file_size = np.int32("coord" not in table)
        file.createDimension("time_step", None)
        for name, size in dimensions_of(table).items():
            file.createDimension(name, size)
        for name, (dimensions, values) in table.items():
            for dimension, size in zip(dimensions, values.shape, strict=True):
                if dimension not in file.dimensions:
                    file.createDimension(dimension, size)
            kind = "c" if values.dtype.kind == "S" else values.dtype
            variable = file.createVariable(name, kind, tuple(dimensions))
            if name in types:
                variable.elem_type = types[name]
            if name not in records:
                variable[:] = values
        for name in records:
            for step, values in enumerate(table[name][1]):
                file.variables[name][step] = values


def with_library(path: Path, table: Table, types: Mapping[str, str], form: str, **stored: Any) -> None:
    netcdf = pytest.importorskip("netCDF4")
    with netcdf.Dataset(path, "w", format=form) as file:
        file.title, file.floating_point_word_size = "a block", np.int32(8)
        file.createDimension("time_step", None)
        for name, (dimensions, values) in table.items():
            for dimension, size in zip(dimensions, values.shape, strict=True):
                if dimension not in file.dimensions:
                    file.createDimension(dimension, size)
            options = stored if name in COORDINATES else {}
            variable = file.createVariable(name, values.dtype, tuple(dimensions), **options)
            if name in types:
                variable.elem_type = types[name]
            variable[:] = values


def solid(**extra: tuple[Sequence[str], Any]) -> tuple[Table, dict[str, str]]:
    """Two blocks of tetrahedra with sets, names and numbers."""
    points, cells = shapes.block()
    parts = halves(points, cells)
    sets = {
        "eb_names": (("num_el_blk", "len_name"), text("steel", "")),
        "elem_num_map": (("num_elem",), np.arange(len(cells), dtype="i4")[::-1] + 7),
        "node_num_map": (("num_nodes",), np.arange(len(points), dtype="i4") + 3),
        "ns_prop1": (("num_node_sets",), np.array([4, 5], dtype="i4")),
        "ns_names": (("num_node_sets", "len_name"), text("fixed", "")),
        "node_ns1": (("num_nod_ns1",), np.array([1, 5, 6], dtype="i4")),
        "node_ns2": (("num_nod_ns2",), np.array([2], dtype="i4")),
        "ss_prop1": (("num_side_sets",), np.array([8, 9], dtype="i4")),
        "elem_ss2": (("num_side_ss2",), np.array([1, len(parts[0]) + 1], dtype="i4")),
        "side_ss2": (("num_side_ss2",), np.array([4, 2], dtype="i4")),
        "dist_fact_ss2": (("num_df_ss2",), np.ones(6)),
    }
    return tables(points, [("TETRA4", parts[0]), ("tet", parts[1])], **{**sets, **extra})


def plane(kind: str, dimension: int = 2) -> tuple[Table, dict[str, str]]:
    points, cells = shapes.plate()
    return tables(points[:, :dimension], [(kind, part) for part in halves(points, cells)])


def cubit(path: Path) -> None:
    with_scipy(path, *solid(), version=2)


def first(path: Path) -> None:
    """All coordinates in one variable, in single precision, as the first files had them."""
    table, types = plane("TRIANGLE", 3)
    xyz = np.array([table.pop(name)[1] for name in COORDINATES[:3]], dtype="f4")
    with_scipy(path, {"coord": (("num_dim", "num_nodes"), xyz), **table}, types, version=1)


def results(path: Path) -> None:
    """Of a run in time: what changes in it stands behind all else, record by record."""
    n, m = (len(part) for part in shapes.block())
    m = len(halves(*shapes.block())[0])
    fields = {
        "time_whole": (("time_step",), np.array([0.0, 0.5, 2.0])),
        "name_nod_var": (("num_nod_var", "len_name"), text("load", "flag")),
        "vals_nod_var1": (("time_step", "num_nodes"), np.arange(3.0 * n).reshape(3, n)),
        "vals_nod_var2": (("time_step", "num_nodes"), np.ones((3, n), dtype="f4")),
        "name_elem_var": (("num_elem_var", "len_name"), text("stress")),
        "vals_elem_var1eb1": (("time_step", "num_el_in_blk1"), np.arange(3.0 * m).reshape(3, m)),
    }
    records = [name for name, (dimensions, _) in fields.items() if dimensions[0] == "time_step"]
    with_scipy(path, *solid(**fields), version=1, records=records)


def large(path: Path) -> None:
    """For more than 2^31 elements: all integers have 64 bits."""
    table, types = solid()
    wide = {name: (dims, v.astype("i8") if v.dtype.kind == "i" else v) for name, (dims, v) in table.items()}
    with_library(path, wide, types, "NETCDF3_64BIT_DATA")


def of_hdf5(path: Path, **stored: Any) -> None:
    with_library(path, *solid(), form="NETCDF4", **stored)


def vtk_writes(path: Path) -> None:
    """Write in a process of its own: where the whole of VTK has been imported, its writer is another, and crashes."""
    pytest.importorskip("vtkmodules")
    command = "import sys, files_exodus; files_exodus.by_vtk(sys.argv[1])"
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    subprocess.run([sys.executable, "-c", command, str(path)], env=paths, check=True)


def by_vtk(path: str) -> None:
    from vtkmodules import vtkIOExodus as writers
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkUnstructuredGrid

    points, cells = shapes.block()
    mesh, vtk_points = vtkUnstructuredGrid(), vtkPoints()
    vtk_points.SetData(numpy_to_vtk(points, deep=True))
    mesh.SetPoints(vtk_points)
    for cell in cells.tolist():
        mesh.InsertNextCell(10, 4, cell)
    blocks = vtkMultiBlockDataSet()
    blocks.SetBlock(0, mesh)
    writer = writers.vtkExodusIIWriter()
    writer.SetFileName(path)
    writer.SetStoreDoubles(1)
    writer.SetInputData(blocks)
    writer.Write()


FILES: dict[str, Callable[[Path], None]] = {
    "cubit.exo": cubit,
    "first.g": first,
    "results.e": results,
    "large.ex2": large,
    "vtk.exo": vtk_writes,
    "hdf5.e": of_hdf5,
    "chunks.e": partial(of_hdf5, chunksizes=(100,)),
}
# The library of HDF5 writes these anew.
COMPRESSED: dict[str, Callable[[Path], None]] = {"compressed.e": partial(of_hdf5, zlib=True)}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), all other variables, and the attributes of all."""
    data = path.read_bytes()
    if data[:4] in (b"CDF\1", b"CDF\2"):
        from scipy.io import netcdf_file

        with netcdf_file(path, "r", mmap=False) as file:
            values = {name: np.array(one[...]) for name, one in file.variables.items()}
            rest: dict[str, Any] = {name: dict(one._attributes) for name, one in file.variables.items()}
            rest["dimensions"] = dict(file.dimensions)
    else:
        netcdf = pytest.importorskip("netCDF4")
        with netcdf.Dataset(path) as file:
            file.set_auto_mask(False)
            values = {name: np.array(one[...]) for name, one in file.variables.items()}
            rest = {name: dict(one.__dict__) for name, one in file.variables.items()}
            rest["dimensions"] = {name: len(one) for name, one in file.dimensions.items()}
    found = [values.pop(name) for name in COORDINATES if name in values]
    columns = found if len(found) > 1 else list(found[0])
    points = np.zeros((len(columns[0]), 3), dtype=columns[0].dtype.newbyteorder("="))
    for axis, column in enumerate(columns):
        points[:, axis] = column
    return points, {**rest, "values": values}
