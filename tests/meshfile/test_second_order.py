"""Nodes of elements of second order come in VTK's order, whoever has written the file, and can be turned there."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from programs import gmsh_session
from second_order import SECOND, element, is_straight, reference

from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.lagrange import kinds, lattice
from meshfix_cli.meshfile import anew, formats, reading, through_meshio
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Cells, Source
from meshfix_cli.meshfile.splice import Turned
from meshfix_cli.meshfile.vtk.cells import TYPES


def source_of(path: Path) -> Source:
    """What a file holds."""
    data = path.read_bytes()
    form = formats.sniff(data) or formats.by_name(path)
    assert form is not None
    return reading.parse(data, form, path)


def gmsh_writes(path: Path, key: str, **options: float) -> None:
    """Let gmsh write an element whose nodes it makes, straight, of those of the linear one."""
    nodes, shape = element(key), ELEMENTS[key].shape
    linear = next(one for one in ELEMENTS.values() if one.shape is shape and one.linear)
    incomplete = key in ("quad8", "pyramid13", "wedge15", "hexahedron20")
    with gmsh_session(SaveAll=1, SecondOrderIncomplete=incomplete, **options) as gmsh:
        gmsh.model.addDiscreteEntity(shape.dimension, 1)
        numbers = np.arange(shape.corners) + 1
        gmsh.model.mesh.addNodes(shape.dimension, 1, numbers, nodes[: shape.corners].ravel())
        gmsh.model.mesh.addElementsByType(1, linear.gmsh, [], numbers)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(path))


LINES, PLANES, SOLIDS = ["line3"], ["triangle6", "quad8"], ["tetra10", "wedge15", "hexahedron20"]
FULL = [key for key in SECOND if key not in ("pyramid13", "pyramid14")]
# What gmsh writes as its programs have it: the ending, its options, and the types.
BY_GMSH: dict[str, tuple[str, dict[str, float], Iterable[str]]] = {
    "1": ("msh", {"MshFileVersion": 1}, SECOND),
    "2.2": ("msh", {"MshFileVersion": 2.2}, SECOND),
    "2.2 binary": ("msh", {"MshFileVersion": 2.2, "Binary": 1}, SECOND),
    "4.1": ("msh", {"MshFileVersion": 4.1}, SECOND),
    "4.1 binary": ("msh", {"MshFileVersion": 4.1, "Binary": 1}, SECOND),
    "vtk": ("vtk", {}, FULL),
    "med": ("med", {}, [*FULL, "pyramid13"]),
    "unv": ("unv", {}, [*LINES, *PLANES, *SOLIDS]),
    "inp": ("inp", {}, [*PLANES, *SOLIDS]),
    "bdf free": ("bdf", {"BdfFieldFormat": 0}, [*PLANES, *SOLIDS]),
    "bdf": ("bdf", {"BdfFieldFormat": 1}, [*PLANES, *SOLIDS]),
    "bdf wide": ("bdf", {"BdfFieldFormat": 2}, [*PLANES, *SOLIDS]),
    "mesh": ("mesh", {}, [*LINES, "triangle6", "tetra10"]),
    "cgns": ("cgns", {}, [*FULL, "pyramid14"]),
}  # fmt: skip


@pytest.mark.parametrize(("name", "key"), [(name, key) for name, (_, _, keys) in BY_GMSH.items() for key in keys])
def test_gmsh_writes_elements_whose_nodes_come_in_the_order_of_vtk(name: str, key: str, tmp_path: Path) -> None:
    ending, options, _ = BY_GMSH[name]
    gmsh_writes(path := tmp_path / f"one.{ending}", key, **options)
    check(path, key, 1e-3 if ending == "bdf" else 1e-6)


@pytest.mark.parametrize("key", [key for key in SECOND if ELEMENTS[key].vtk])
@pytest.mark.parametrize("name", ["vtk", "vtk binary", "vtu", "vtu ascii"])
def test_vtk_writes_elements_whose_nodes_come_in_its_order(name: str, key: str, tmp_path: Path) -> None:
    kind = ELEMENTS[key].vtk
    assert kind is not None
    vtk_writes(path := tmp_path / f"one.{name[:3]}", kind, element(key), name)
    check(path, key)


def vtk_writes(path: Path, kind: int, nodes: NDArray[np.float64], how: str = "") -> None:
    """Let VTK write a cell, binary or ascii."""
    pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid

    grid, points = vtkUnstructuredGrid(), vtkPoints()
    points.SetData(numpy_to_vtk(nodes, deep=True))
    grid.SetPoints(points)
    grid.InsertNextCell(kind, len(nodes), list(range(len(nodes))))
    module, prefix = {".vtk": ("Legacy", ""), ".vtu": ("XML", "XML")}[path.suffix]
    writer = getattr(pytest.importorskip(f"vtkmodules.vtkIO{module}"), f"vtk{prefix}UnstructuredGridWriter")()
    if how == "vtk binary":
        writer.SetFileTypeToBinary()
    if how == "vtu ascii":
        writer.SetDataModeToAscii()
    writer.SetFileName(str(path))
    writer.SetInputData(grid)
    writer.Write()


LAGRANGE = {68: "line", 69: "triangle", 70: "quad", 71: "tetra", 72: "hexahedron", 73: "wedge"}


@pytest.mark.parametrize("number", LAGRANGE)
@pytest.mark.parametrize("suffix", ["vtk", "vtu"])
def test_lagrange_cells_are_elements_of_their_order(suffix: str, number: int, tmp_path: Path) -> None:
    family = LAGRANGE[number]
    for order in (1, 2, 3, 5):
        nodes = np.zeros((len(lattice(family, order, "vtk")), 3))
        nodes[:, : len(lattice(family, 1)[0])] = lattice(family, order, "vtk")
        vtk_writes(path := tmp_path / f"one.{suffix}", number, nodes)
        (run,) = source_of(path).cells
        assert run.type == (family if order == 1 else f"{family}{len(nodes)}")
        assert run.vertices.tolist() == [[*range(len(nodes))]]


@pytest.mark.parametrize("number", [70, 74, 79])
@pytest.mark.parametrize("suffix", ["vtk", "vtu"])
def test_cells_whose_nodes_are_not_known_have_the_names_of_vtk(suffix: str, number: int, tmp_path: Path) -> None:
    """Pyramids, Bezier's, and those that have another order along each axis."""
    nodes = np.random.default_rng(1).random(({70: 12, 74: 30}.get(number, 64), 3))
    vtk_writes(path := tmp_path / f"one.{suffix}", number, nodes)
    (run,) = source_of(path).cells
    assert run.type == TYPES[number][0]


@pytest.mark.parametrize("size", [27, 64, 125])
@pytest.mark.parametrize("suffix", ["vtk", "vtu"])
def test_hexahedra_of_old_files_are_those_that_vtk_reads(suffix: str, size: int, tmp_path: Path) -> None:
    """It tells by the version; and they can be turned there."""
    vtk_writes(path := tmp_path / f"one.{suffix}", 72, np.random.default_rng(1).random((size, 3)), f"{suffix} ascii")
    data = path.read_bytes().replace(b"Version 5.1", b"Version 5.0")
    path.write_bytes(re.sub(rb'(<VTKFile[^>]* version=")2', rb"\g<1>1", data))
    module, prefix = {"vtk": ("Legacy", ""), "vtu": ("XML", "XML")}[suffix]
    reader = getattr(pytest.importorskip(f"vtkmodules.vtkIO{module}"), f"vtk{prefix}UnstructuredGridReader")()
    reader.SetFileName(str(path))
    reader.Update()
    ids = reader.GetOutput().GetCell(0).GetPointIds()
    source = source_of(path)
    (run,) = source.cells
    assert run.type == f"hexahedron{size}"
    assert run.vertices.tolist() == [[ids.GetId(i) for i in range(size)]] != [[*range(size)]]
    assert source.layout is not None
    order = np.random.default_rng(2).permutation(size)
    path.write_bytes(source.layout.rewritten(source.points, source.points, {0: Turned(np.array([0]), order.tolist())}))
    np.testing.assert_array_equal(source_of(path).cells[0].vertices, run.vertices[:, order])


@pytest.mark.parametrize("order", [3, 4])
def test_elements_of_more_than_second_order_by_gmsh(order: int, tmp_path: Path) -> None:
    for family in ("triangle", "quad", "tetra", "pyramid", "wedge", "hexahedron"):
        nodes, shape = reference(family), ELEMENTS[family].shape
        with gmsh_session(SaveAll=1) as gmsh:
            gmsh.model.addDiscreteEntity(shape.dimension, 1)
            gmsh.model.mesh.addNodes(shape.dimension, 1, np.arange(shape.corners) + 1, nodes.ravel())
            gmsh.model.mesh.addElementsByType(1, ELEMENTS[family].gmsh, [], np.arange(shape.corners) + 1)
            gmsh.model.mesh.setOrder(order)
            gmsh.write(str(path := tmp_path / "one.msh"))
        source = source_of(path)
        (run,) = source.cells
        found, weights = source.points[run.vertices[0]], np.array(kinds()[run.type].weights)
        np.testing.assert_allclose(found, weights @ found[: shape.corners], atol=1e-12, err_msg=run.type)


def check(path: Path, key: str, tolerance: float = 1e-6) -> None:
    """The one element has nodes where VTK has them, and the file, turned, has them where its own order has them."""
    source = source_of(path)
    (run,) = (run for run in source.cells if run.type == key)
    at = next(i for i, one in enumerate(source.cells) if one is run)
    assert is_straight(key, source.points[run.vertices], tolerance)
    assert source.layout is not None
    order = np.random.default_rng(5).permutation(ELEMENTS[key].nodes)
    turned = source.layout.rewritten(source.points, source.points, {at: Turned(np.array([0]), order.tolist())})
    path.write_bytes(turned)
    np.testing.assert_array_equal(source_of(path).cells[at].vertices, run.vertices[:, order])


WRITTEN = ["triangle6", "quad8", "quad9", "tetra10", "hexahedron20", "hexahedron27"]
FURTHER = {"gmsh": ["wedge18", "pyramid14"], "gmsh22": ["wedge18", "pyramid14"], "vtu": ["wedge18"], "exodus": []}


@pytest.mark.parametrize(("name", "key"), [(name, key) for name, more in FURTHER.items() for key in (*WRITTEN, *more)])
def test_what_is_written_in_another_format_has_the_order_of_that(name: str, key: str, tmp_path: Path) -> None:
    points = element(key)
    path = tmp_path / {"exodus": "one.e", "vtu": "one.vtu"}.get(name, "one.msh")
    form = Format(name, None if name == "exodus" else False)
    source = Source(points, [Cells(key, np.arange(len(points))[None])])
    if name in anew.WRITERS:
        path.write_bytes(anew.written(source, points, form))
    else:
        through_meshio.write(path, source, points, form)
    check(path, key)
