"""VTKHDF files as VTK writes them, and as programs do by h5py; h5py reads them back, data set by data set."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_medit import material
from files_vtp import sheet
from files_vtu import filled
from numpy.typing import NDArray
from shapes import block, plate

pytest.importorskip("h5py")


def by_vtk(path: Path, data: Callable[[], Any], **settings: Any) -> None:
    """Write by VTK; its settings by the names of their methods."""
    io = pytest.importorskip("vtkmodules.vtkIOHDF")
    writer = io.vtkHDFWriter()
    writer.SetInputDataObject(data())
    writer.SetFileName(str(path))
    for name, value in settings.items():
        getattr(writer, name)(value)
    assert writer.Write()


def single() -> Any:
    points, cells = block()
    return filled(points.astype("f4"), cells)


def parts() -> Any:
    """The same twice, one beside the other."""
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    points, cells = block()
    data = model.vtkPartitionedDataSet()
    data.SetPartition(0, filled(points, cells))
    data.SetPartition(1, filled(points + np.array([9.0, 0, 0]), cells))
    return data


def blocks() -> Any:
    """A plate and another beside it."""
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    points, cells = plate()
    data = model.vtkMultiBlockDataSet()
    for i in range(2):
        data.SetBlock(i, filled(points + np.array([9.0 * i, 0, 0]), cells))
    return data


def by_hand(path: Path, kinds: str = "i4", steps: Sequence[int] = (), **options: Any) -> None:
    """Version 1, or 2 with steps, whose points begin at some rows."""
    import h5py

    points, cells = block()
    n, m = len(points), len(cells)
    with h5py.File(path, "w") as file:
        top = file.create_group("VTKHDF")
        top.attrs["Version"] = [2 if steps else 1, 0]
        top.attrs["Type"] = np.bytes_("UnstructuredGrid")
        for name, count in (("Points", n), ("Cells", m), ("ConnectivityIds", 4 * m)):
            top[f"NumberOf{name}"] = np.array([count] * max(len(steps), 1), dtype="i8")
        many = max([0, *steps]) // n + 1
        top.create_dataset("Points", data=np.concatenate([points] * many), **options)
        top["Connectivity"], top["Offsets"] = cells.ravel().astype(kinds), 4 * np.arange(m + 1).astype(kinds)
        top["Types"] = np.full(m, 10, dtype="u1")
        top.create_group("CellData")["material"] = np.concatenate([material(points, cells)] * max(len(steps), 1))
        if steps:
            group = top.create_group("Steps")
            group.attrs["NSteps"] = len(steps)
            group["Values"] = np.linspace(0, 1, len(steps))
            group["PartOffsets"] = np.zeros(len(steps), dtype="i8")
            group["NumberOfParts"] = np.ones(len(steps), dtype="i8")
            group["PointOffsets"] = np.array(steps, dtype="i8")
            group["CellOffsets"] = group["ConnectivityIdOffsets"] = np.zeros((len(steps), 1), dtype="i8")
            group["CellDataOffsets/material"] = m * np.arange(len(steps))


FILES: dict[str, Callable[[Path], None]] = {
    "solid.vtkhdf": partial(by_vtk, data=lambda: filled(*block())),
    "single.vtkhdf": partial(by_vtk, data=single),
    "sheet.vtkhdf": partial(by_vtk, data=lambda: sheet("f8")),
    "parts.vtkhdf": partial(by_vtk, data=parts),
    "blocks.vtkhdf": partial(by_vtk, data=blocks),
    "by_hand.vtkhdf": by_hand,
    "steps.vtkhdf": partial(by_hand, kinds="i8", steps=(0, 0, 0), chunks=(64, 3)),
}


def read_independently(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    """The points of all groups that have some, and all other data sets."""
    import h5py

    found: dict[str, Any] = {}
    points: list[NDArray[Any]] = []

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            values = item[()]
            if name.endswith("/Points"):
                points.append(values)
            else:
                found[name] = values

    with h5py.File(path) as file:
        file.visititems(visit)
    return np.concatenate(points), found
