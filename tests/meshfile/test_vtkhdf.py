"""VTKHDF files: what VTK's reader finds, parts, blocks, steps in time, and faults."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_medit import material
from files_vtkhdf import FILES, by_hand, by_vtk, read_independently
from shapes import block

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.vtk.cells import TYPES
from meshfix_cli.meshfile.vtk.vtkhdf import parse

h5py = pytest.importorskip("h5py")


def grids(path: Path) -> list[Any]:
    """The data sets that VTK reads, the parts of one after the other."""
    reader = pytest.importorskip("vtkmodules.vtkIOHDF").vtkHDFReader()
    reader.SetFileName(str(path))
    reader.Update()
    found: list[Any] = []

    def visit(one: Any) -> None:
        if hasattr(one, "GetNumberOfPartitions"):
            for i in range(one.GetNumberOfPartitions()):
                visit(one.GetPartition(i))
        elif hasattr(one, "GetNumberOfBlocks"):
            for i in range(one.GetNumberOfBlocks()):
                visit(one.GetBlock(i))
        else:
            found.append(one)

    visit(reader.GetOutputDataObject(0))
    return found


@pytest.mark.parametrize("variant", FILES)
def test_points_and_cells_are_those_that_vtk_reads(variant: str, tmp_path: Path) -> None:
    FILES[variant](tmp_path / variant)
    source = parse((tmp_path / variant).read_bytes())
    points: list[Any] = []
    cells = []
    for grid in grids(tmp_path / variant):
        before = len(points)
        points += [grid.GetPoint(i) for i in range(grid.GetNumberOfPoints())]
        for i in range(grid.GetNumberOfCells()):
            ids = grid.GetCell(i).GetPointIds()
            rows = [ids.GetId(k) + before for k in range(ids.GetNumberOfIds())]
            cells.append((TYPES[grid.GetCellType(i)][0], rows))
    np.testing.assert_array_equal(source.points, points)
    found: dict[int, Any] = {}
    for run in source.cells:
        assert run.ids is not None
        found |= {int(i): (run.type, row) for i, row in zip(run.ids, run.vertices.tolist(), strict=True)}
    assert [found[i] for i in range(len(found))] == cells


def test_data_of_cells_belong_to_them(tmp_path: Path) -> None:
    FILES["sheet.vtkhdf"](tmp_path / "in.vtkhdf")
    source = parse((tmp_path / "in.vtkhdf").read_bytes())
    for run, numbers in zip(source.cells, source.arrays.cell["number"], strict=True):
        np.testing.assert_array_equal(run.ids, numbers)
    assert source.arrays.point["height"].shape == (len(source.points),)


def test_blocks_are_regions_and_have_names(tmp_path: Path) -> None:
    FILES["blocks.vtkhdf"](tmp_path / "in.vtkhdf")
    source = read(tmp_path / "in.vtkhdf").source
    assert source.regions == ("vtkhdf:block", "MaterialIDs")
    assert list(groups_of(source)) == ["Block_1", "Block_2"]
    assert [set(labels.tolist()) for labels in source.arrays.cell["vtkhdf:block"]] == [{1}] * 3 + [{2}] * 3
    assert source.apart


@pytest.mark.parametrize("variant", ["by_hand.vtkhdf", "steps.vtkhdf"])
def test_material_is_that_of_the_first_step(variant: str, tmp_path: Path) -> None:
    FILES[variant](tmp_path / "in.vtkhdf")
    document = read(tmp_path / "in.vtkhdf")
    np.testing.assert_array_equal(document.source.arrays.cell["material"][0], material(*block()))
    assert ("steps in time" in " ".join(document.notes)) == (variant == "steps.vtkhdf")


def test_what_is_compressed_is_written_by_the_library(tmp_path: Path) -> None:
    by_hand(tmp_path / "in.vtkhdf", chunks=(64, 3), compression="gzip")
    document = read(tmp_path / "in.vtkhdf")
    write(document, untangle(document.mesh).after, tmp_path / "out.vtkhdf")
    assert read(tmp_path / "out.vtkhdf").mesh.check()[0] == 0
    (_, before), (_, after) = (read_independently(tmp_path / name) for name in ("in.vtkhdf", "out.vtkhdf"))
    np.testing.assert_equal(after, before)


def test_steps_of_other_points_are_refused(tmp_path: Path) -> None:
    by_hand(tmp_path / "in.vtkhdf", steps=(0, len(block()[0])))
    with pytest.raises(ReadError, match="has several steps in time with points or cells of their own"):
        read(tmp_path / "in.vtkhdf")


def image() -> Any:
    data = pytest.importorskip("vtkmodules.vtkCommonDataModel").vtkImageData()
    data.SetDimensions(3, 4, 5)
    return data


def test_points_without_coordinates_are_refused(tmp_path: Path) -> None:
    by_vtk(tmp_path / "in.vtkhdf", image)
    with pytest.raises(ReadError, match="ImageData, whose points stand in rows"):
        read(tmp_path / "in.vtkhdf")


def changed(change: Callable[[Any], None], path: Path) -> Path:
    by_hand(path)
    with h5py.File(path, "r+") as file:
        change(file["VTKHDF"])
    return path


def put(name: str, values: Any) -> Callable[[Any], None]:
    def change(top: Any) -> None:
        del top[name]
        if values is not None:
            top[name] = values

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda top: top.attrs.__setitem__("Type", np.bytes_("HyperTreeGrid")), "of the type 'HyperTreeGrid', which"),
        (lambda top: top.attrs.__delitem__("Type"), "of the type '', which"),
        (put("NumberOfPoints", np.array([10**6])), "has not the points that it announces"),
        (put("NumberOfPoints", np.array([-1])), "the NumberOfPoints of its /VTKHDF cannot be"),
        (put("NumberOfCells", np.array([10**6])), "its /VTKHDF/Offsets has 577 numbers for 1,000,001"),
        (put("NumberOfConnectivityIds", np.array([7])), "the offsets of its cells do not fit"),
        (put("Types", None), "its /VTKHDF has no Types"),
        (put("Connectivity", np.zeros(9)), "its /VTKHDF/Connectivity has 9 numbers for"),
        (put("Connectivity", np.zeros(2304)), "does not hold integers"),
        (put("Points", np.zeros((205, 3), dtype="i4")), "not all of single or of double precision"),
        (put("CellData", 1), "is not a readable VTKHDF file|there is no"),
    ],
)
def test_what_is_wrong_is_named(change: Callable[[Any], None], words: str, tmp_path: Path) -> None:
    path = changed(change, tmp_path / "in.vtkhdf")
    if "there is no" in words:
        assert read(path).source.arrays.cell == {}
        return
    with pytest.raises(ReadError, match=words):
        read(path)
