"""Elements of every type, in each format that has them: files of other programs, read, moved and written back."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from building import Blocks, Points
from elements import MESHES
from numpy.typing import NDArray
from written import SOLIDS, TEXT_4, Made, by_gmsh, by_vtk, surface_by_vtk

from meshfix_cli import read, write
from meshfix_cli.errors import WriteError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.document import Document
from meshfix_cli.meshfile.writing import write_cells
from meshfix_cli.solve.perturb import perturb

# Orders with the other orientation, by hand.
MIRRORED = {
    "tetra": [0, 2, 1, 3], "pyramid": [3, 2, 1, 0, 4], "wedge": [3, 4, 5, 0, 1, 2],
    "hexahedron": [4, 5, 6, 7, 0, 1, 2, 3],
}  # fmt: skip
Corners = dict[str, NDArray[np.float64]]


@cache
def made(name: str) -> tuple[Points, Blocks]:
    """Points (n, 3), of few digits."""
    points, cells = MESHES[name]()
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))]).round(5), cells


PLATES: dict[str, Made] = {**SOLIDS, "gmsh.mesh": by_gmsh, "faces.obj": surface_by_vtk, "faces.ply": surface_by_vtk}


def corners_of(points: NDArray[np.floating], cells: Any) -> Corners:
    """The places of the nodes of the elements of each type, in an order of the elements that does not depend on it."""
    found: dict[str, list[Any]] = {}
    for key, rows in cells:
        found.setdefault(key, []).append(points[rows].astype(np.float64))
    joined = {key: np.concatenate(places) for key, places in found.items()}
    return {key: places[np.lexsort(places.reshape(len(places), -1).round(3).T)] for key, places in joined.items()}


def assert_same(found: Corners, expected: Corners) -> None:
    assert found.keys() == expected.keys()
    for key, places in expected.items():
        np.testing.assert_allclose(found[key], places, atol=2e-5, err_msg=key)


def corners_in(document: Document) -> Corners:
    return corners_of(document.source.points, [(part.key, part.vertices) for part in document.parts])


CASES = [("every solid", name) for name in SOLIDS] + [("quads and triangles", name) for name in PLATES]


@pytest.mark.parametrize(("mesh", "name"), CASES)
def test_all_elements_are_read_and_written_back(mesh: str, name: str, tmp_path: Path) -> None:
    points, cells = made(mesh)
    path = tmp_path / name
    {**SOLIDS, **PLATES}[name](path, points, cells)
    document = read(path)
    assert document.not_judged == {}
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.check()[0] == 0
    assert_same(corners_in(document), corners_of(points, cells))
    moved, _ = perturb(document.mesh, 20, document.mesh.mean_edge_length(), seed=2)
    stored, dropped = write(document, moved, tmp_path / f"out_{name}")
    assert dropped == ()
    after = read(tmp_path / f"out_{name}")
    np.testing.assert_array_equal(after.mesh.points, stored.points)
    assert after.mesh.check()[0] == stored.check()[0] > 0
    assert after.ids.tolist() == document.ids.tolist()


CONVERSIONS = [
    ("every solid", suffix) for suffix in (".msh", ".inp", ".mesh", ".vtk", ".vtu", ".avs", ".bdf", ".su2", ".med")
] + [
    ("quads and triangles", suffix)
    for suffix in (".msh", ".inp", ".vtk", ".vtu", ".avs", ".bdf", ".xdmf", ".obj", ".ply")
]


@pytest.mark.parametrize(("mesh", "suffix"), CONVERSIONS)
def test_all_elements_are_converted(mesh: str, suffix: str, tmp_path: Path) -> None:
    points, cells = made(mesh)
    by_gmsh(tmp_path / "in.msh", points, cells, TEXT_4)
    document = read(tmp_path / "in.msh")
    write(document, document.mesh, tmp_path / f"out{suffix}")
    after = read(tmp_path / f"out{suffix}")
    assert_same(corners_in(after), corners_of(points, cells))
    assert not after.mesh.topology.flipped.any()
    if suffix == ".inp":
        types = ["C3D4", "C3D5", "C3D6", "C3D8"] if mesh == "every solid" else ["CPS3", "CPS4"]
        assert sorted(re.findall(r"TYPE=(\w+)", (tmp_path / "out.inp").read_text())) == types
    if suffix in (".vtk", ".vtu"):
        assert_same(corners_of(*in_vtk(tmp_path / f"out{suffix}")), corners_of(points, cells))


def in_vtk(path: Path) -> tuple[NDArray[np.float64], Blocks]:
    """The points and cells that VTK reads."""
    if path.suffix == ".vtu":
        reader = pytest.importorskip("vtkmodules.vtkIOXML").vtkXMLUnstructuredGridReader()
    else:
        reader = pytest.importorskip("vtkmodules.vtkIOLegacy").vtkUnstructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    points = np.array([grid.GetPoint(i) for i in range(grid.GetNumberOfPoints())])
    keys = {element.vtk: key for key, element in ELEMENTS.items()}
    rows = []
    for i in range(grid.GetNumberOfCells()):
        ids = grid.GetCell(i).GetPointIds()
        row = [ids.GetId(k) for k in range(ids.GetNumberOfIds())]
        rows.append((keys[grid.GetCellType(i)], np.array([row], dtype=np.int32)))
    return points, rows


def test_what_a_format_does_not_hold_is_not_left_out(tmp_path: Path) -> None:
    by_gmsh(tmp_path / "in.msh", *made("every solid"), TEXT_4)
    document = read(tmp_path / "in.msh")
    with pytest.raises(WriteError, match="cannot be written as cgns: that holds no"):
        write(document, document.mesh, tmp_path / "out.cgns")
    with pytest.raises(WriteError, match="can only contain triangle or quad cells"):
        write(document, document.mesh, tmp_path / "out.obj")


def test_elements_of_every_type_are_drawn(tmp_path: Path) -> None:
    """With a value for each, in the order of the file."""
    points, cells = made("every solid")
    by_vtk(tmp_path / "in.vtk", points, [*cells, *[(key, rows[:3]) for key, rows in cells]])  # which are repetitions
    document = read(tmp_path / "in.vtk")
    assert document.mesh.topology.m == sum(len(rows) for _, rows in cells)
    write_cells(document, document.mesh, str(tmp_path / "out.vtu"), {"element": document.ids}, {})
    drawn = read(tmp_path / "out.vtu").source
    assert_same(corners_of(drawn.points, [(run.type, run.vertices) for run in drawn.cells]), corners_of(points, cells))
    numbers = dict(zip((run.type for run in drawn.cells), drawn.arrays.cell["element"], strict=True))
    before = 0
    for key, rows in cells:
        assert numbers[key].tolist() == list(range(before, before + len(rows)))
        before += len(rows)


def test_materials_hold_the_facets_between_elements_of_several_types(tmp_path: Path) -> None:
    points, cells = made("every solid")
    labels = [(points[rows].mean(axis=1)[:, 1] > 1.0).astype(int) for _, rows in cells]
    meshio.Mesh(points, cells, cell_data={"material": labels}).write(tmp_path / "in.vtu")
    document = read(tmp_path / "in.vtu")
    here = np.zeros((2, len(points)), dtype=bool)
    for (_, rows), materials in zip(cells, labels, strict=True):
        for material in range(2):
            here[material, rows[materials == material]] = True
    assert document.fixed["between regions of material"] > 0
    held = document.mesh.topology.interface(np.concatenate(labels))
    np.testing.assert_array_equal(held, here.all(axis=0))
    assert not document.mesh.movable[held].any()


@pytest.mark.parametrize("name", ["text.vtk", "text.vtu", "text_2.msh", "binary_4.msh", "gmsh.inp", "meshio.mesh"])
def test_elements_of_every_type_are_turned(name: str, tmp_path: Path) -> None:
    """Some against the others, and of one type all."""
    points, cells = made("every solid")
    other = [(key, rows.copy()) for key, rows in cells]
    for key, rows in other:
        some = rows if key == "wedge" else rows[1:3]
        some[:] = some[:, MIRRORED[key]]
    SOLIDS[name](tmp_path / name, points, other)
    document = read(tmp_path / name)
    assert document.mesh.topology.misnumbered.sum() == 6
    assert any("300 wedges are numbered the other way round" in note for note in document.notes)
    mended = read(tmp_path / name, fix_orientation=True)
    assert not mended.mesh.topology.flipped.any()
    assert "renumbered 306 elements" in mended.notes
    write(mended, mended.mesh, tmp_path / f"out_{name}")
    assert not read(tmp_path / f"out_{name}").mesh.topology.flipped.any()


def test_concave_quadrilaterals_of_drawings_are_named(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nv 1.5 0.5 0\nv -3 1 0\nf 1 2 3 5\nf 1 5 3 4\nf 1 4 6\n"
    (tmp_path / "in.obj").write_text(text)
    document = read(tmp_path / "in.obj")
    assert document.mesh.check()[0] == 1
    assert "1 quadrilateral is concave, and a concave one is inverted" in document.notes


def test_quadrilaterals_of_a_curved_surface_are_read(tmp_path: Path) -> None:
    points, cells = made("graded quads")
    bent = points + np.outer(np.sin(points[:, 0]), [0, 0, 1])
    by_vtk(tmp_path / "in.vtk", bent, cells)
    mesh = read(tmp_path / "in.vtk").mesh
    assert mesh.surface is not None and mesh.check()[0] == 0


def test_facets_of_the_file_hold_their_vertices(tmp_path: Path) -> None:
    points, cells = made("every solid")
    by_vtk(tmp_path / "in.vtk", points, cells)
    free = np.flatnonzero(read(tmp_path / "in.vtk").mesh.movable)
    seven = free[[4, 5, 6, 6, 7, 8, 9, 10]]  # corners, of which no element is left
    facets: Blocks = [("quad", free[None, :4].astype(np.int32)), ("hexahedron", seven[None].astype(np.int32))]
    by_vtk(tmp_path / "in.vtk", points, [*facets, *cells])
    document = read(tmp_path / "in.vtk")
    assert not document.mesh.movable[free[:11]].any()
    assert document.fixed["on other cells of the file"] == 11
    assert document.not_judged == {"collapsed_hexahedron": 1}
    assert document.ids[0] == 2


# As LS-DYNA and Ansys write them among hexahedra.
AS_HEXAHEDRA = {
    "wedge": [0, 1, 2, 2, 3, 4, 5, 5],
    "pyramid": [0, 1, 2, 3, 4, 4, 4, 4],
    "tetra": [0, 1, 2, 2, 3, 3, 3, 3],
}


@pytest.mark.parametrize("name", ["text.vtk", "binary.vtu", "text_2.msh", "binary_4.msh", "gmsh.inp", "meshio.mesh"])
def test_collapsed_hexahedra_are_solved_as_what_they_are(name: str, tmp_path: Path) -> None:
    points, cells = made("every solid")
    collapsed = np.concatenate([rows[:, AS_HEXAHEDRA.get(key, range(8))] for key, rows in cells])
    turned = collapsed[:, [1, 0, 3, 2, 5, 4, 7, 6]]  # which keeps the places of repetitions
    turned[10:] = collapsed[10:]
    SOLIDS[name](tmp_path / name, points, [("hexahedron", turned[::-1])])
    document = read(tmp_path / name, fix_orientation=True)
    assert_same(corners_in(document), corners_of(points, cells))
    (run,) = document.source.cells
    np.testing.assert_array_equal(run.vertices, collapsed[::-1])
    assert document.mesh.check()[0] == 0
    ids = document.ids - document.ids.min()
    assert sorted(ids.tolist()) == list(range(len(collapsed)))
    for block in document.mesh.topology.blocks:
        for row, vertices in zip(ids[block.rows].tolist(), block.vertices.tolist(), strict=True):
            assert set(run.vertices[row]) == set(vertices)


def test_pieces_with_elements_of_every_type(tmp_path: Path) -> None:
    points, cells = made("every solid")
    for piece in range(2):
        own = [(key, rows[(points[rows].mean(axis=1)[:, 1] > 1.0) == bool(piece)]) for key, rows in cells]
        used = np.unique(np.concatenate([rows.ravel() for _, rows in own]))
        by_vtk(tmp_path / f"in_{piece}.vtu", points[used], [(key, np.searchsorted(used, rows)) for key, rows in own])
    (tmp_path / "in.pvtu").write_text(
        '<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid GhostLevel="0"><PPoints><PDataArray type="Float64" '
        'NumberOfComponents="3"/></PPoints><Piece Source="in_0.vtu"/><Piece Source="in_1.vtu"/></PUnstructuredGrid>'
        "</VTKFile>"
    )
    by_vtk(tmp_path / "single.vtu", points, cells)
    document, single = read(tmp_path / "in.pvtu"), read(tmp_path / "single.vtu")
    assert_same(corners_in(document), corners_of(points, cells))
    assert document.mesh.movable.sum() == single.mesh.movable.sum()
    moved, _ = perturb(document.mesh, 20, document.mesh.mean_edge_length(), seed=2)
    write(document, moved, tmp_path / "out.pvtu")
    np.testing.assert_array_equal(read(tmp_path / "out.pvtu").mesh.points, moved.points)


def test_points_that_are_joined_leave_other_elements(tmp_path: Path) -> None:
    """A pyramid whose tip is four points."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], *[[0.5, 0.5, 1]] * 4], dtype=float)
    by_vtk(tmp_path / "in.vtk", points, [("hexahedron", np.arange(8, dtype=np.int32)[None])])
    assert [part.key for part in read(tmp_path / "in.vtk").parts] == ["hexahedron"]
    assert [part.key for part in read(tmp_path / "in.vtk", join_points=True).parts] == ["pyramid"]
