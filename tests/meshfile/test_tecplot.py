"""Files of Tecplot: dialects of their zones, what these share, VTK's reader beside ours, and what is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from elements import MESHES
from files_medit import rows
from files_tecplot import FILES
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.tecplot import parse

HEAD = "TITLE = a\nVARIABLES = X Y P\n"
ZONE = "ZONE N=5, E=4, F=FEPOINT, ET=TRIANGLE\n"
POINTS = "0 0 1\n1 0 1\n1 1 1\n0 1 1\n.5 .5 1\n"
CELLS = "1 2 5\n2 3 5\n3 4 5\n4 1 5\n"
SQUARE = HEAD + ZONE + POINTS + CELLS


def by_vtk(path: Path) -> list[tuple[np.ndarray, list[list[int]]]]:
    """Points, and the points of each cell, of each block in the order of VTK's reader."""
    reader: Any = pytest.importorskip("vtkmodules.vtkIOGeometry").vtkTecplotReader()
    reader.SetFileName(str(path))
    reader.Update()
    found = []
    for i in range(reader.GetOutput().GetNumberOfBlocks()):
        grid = reader.GetOutput().GetBlock(i)
        cells = []
        for j in range(grid.GetNumberOfCells()):
            cell = grid.GetCell(j)  # the same object for each
            cells.append([cell.GetPointId(k) for k in range(cell.GetNumberOfPoints())])
        found.append((np.array([grid.GetPoint(j) for j in range(grid.GetNumberOfPoints())]), cells))
    return found


@pytest.mark.parametrize("packing", ["POINT", "BLOCK"])
def test_vtk_reads_the_same_mesh(packing: str, tmp_path: Path) -> None:
    places, cells = block()
    table = places if packing == "POINT" else places.T
    head = f"VARIABLES = X, Y, Z\nZONE N={len(places)}, E={len(cells)}, F=FE{packing}, ET=TETRAHEDRON\n"
    (tmp_path / "in.tec").write_text(head + rows(table.tolist()) + rows(cells + 1))
    source = parse((tmp_path / "in.tec").read_bytes())
    ((points, corners),) = by_vtk(tmp_path / "in.tec")
    np.testing.assert_array_equal(source.points, places)
    np.testing.assert_allclose(places, points, atol=1e-6)
    assert source.cells[0].vertices.tolist() == corners == cells.tolist()


@pytest.mark.parametrize("name", ["tetra", "hexahedron", "quad", "triangle", "wedge", "pyramid"])
def test_elements_have_the_order_of_the_table(name: str, tmp_path: Path) -> None:
    """Wedges and pyramids are bricks that name points several times."""
    points, blocks = MESHES["quads and triangles" if name in ("quad", "triangle") else "every solid"]()
    cells = dict(blocks)[name][
        :, {"wedge": [0, 1, 2, 2, 3, 4, 5, 5], "pyramid": [0, 1, 2, 3, 4, 4, 4, 4]}.get(name, ...)
    ]
    kind = {3: "TRIANGLE", 8: "BRICK"}.get(cells.shape[1], "QUADRILATERAL" if name == "quad" else "TETRAHEDRON")
    head = (
        f"VARIABLES = {' '.join('XYZ'[: points.shape[1]])}\nZONE N={len(points)} E={len(cells)} F=FEPOINT ET={kind}\n"
    )
    (tmp_path / "in.tec").write_text(head + rows(map(repr, p) for p in points.tolist()) + rows(cells + 1))
    document = read(tmp_path / "in.tec")
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.check()[0] == 0
    assert [part.key for part in document.parts] == [name]


def test_blocks_of_points_are_those_of_vtk(tmp_path: Path) -> None:
    x, y, z = np.meshgrid([0, 1, 2], [0, 1, 3], [0, 2], indexing="ij")
    points = np.stack([axis.ravel(order="F") for axis in (x, y, z)], axis=1)
    (tmp_path / "in.tec").write_text(f"VARIABLES = X Y Z\nZONE I=3 J=3 K=2 F=POINT\n{rows(points)}")
    source = parse((tmp_path / "in.tec").read_bytes())
    ((places, cells),) = by_vtk(tmp_path / "in.tec")
    np.testing.assert_array_equal(source.points, places)
    assert source.cells[0].vertices.tolist() == cells
    assert read(tmp_path / "in.tec").mesh.check()[0] == 0


def test_zones_that_share_points_are_one_mesh(tmp_path: Path) -> None:
    FILES["zones.plt"](tmp_path / "in.plt")
    document = read(tmp_path / "in.plt")
    assert list(groups_of(document.source)) == ["left", "right", "zone 3"]
    assert document.source.regions == ("tecplot:zone",)
    labels = np.concatenate(document.source.arrays.cell["tecplot:zone"])
    held = document.mesh.topology.interface(labels)
    assert held.any()
    assert not document.mesh.movable[held].any()
    assert len(document.mesh.topology.blocks[-1].vertices) == 2


@pytest.mark.parametrize("sharing", ["VARSHARELIST=([1-2]=1) CONNECTIVITYSHAREZONE=1", "D=(1,2,FECONNECT)"])
def test_other_times_of_one_mesh_are_read_once(sharing: str) -> None:
    source = parse((SQUARE + ZONE.strip() + f" {sharing}\n" + "1 2 3 4 5\n").encode())
    assert len(source.points) == 5
    assert [len(run.vertices) for run in source.cells] == [4]
    assert not source.apart


def test_passive_variables_are_not_there() -> None:
    text = HEAD + ZONE.strip() + " PASSIVEVARLIST=[3]\n" + POINTS.replace(" 1\n", "\n") + CELLS
    assert parse(text.encode()).cells[0].vertices[3].tolist() == [3, 0, 4]


@pytest.mark.parametrize(
    "names", ["X Y P", '"x", "y", "p"', '"X [m]" "y(m)"\n "Rho"', "CoordinateX, CoordinateY, X_velocity"]
)
def test_names_of_coordinates(names: str) -> None:
    assert parse(SQUARE.replace("X Y P", names).encode()).points[4].tolist() == [0.5, 0.5]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("X Y P", "U V P", r"has no variables X and Y \(found: U, V, P\)"),
        ("X Y P", "X Y", "there are more lines than announced"),
        ("N=5", "N=6", "'1' is|is truncated"),
        ("E=4", "E=3", "line 12: there are more lines than announced"),
        ("E=4", "E=999999999", "is truncated: 3,000,000,012 numbers of the zone 'zone 1' are announced"),
        ("N=5, ", "", "has a zone 'zone 1' without a number N"),
        ("F=FEPOINT", "ZONETYPE=FETRIANGLE", "does not tell its DATAPACKING"),
        ("F=FEPOINT, ET=TRIANGLE", "ZONETYPE=FEPOLYGON DATAPACKING=BLOCK", "has a zone of the type FEPOLYGON, which"),
        ("4 1 5", "4 1 6", "the cell 3 names the point 6, and there is none"),
        (".5 .5 1", ".5 x 1", "line 8: 'x' is not a number"),
        (".5 .5 1", "2*.5 1", "a number is repeated by"),
        ("ET=TRIANGLE", "ET=TRIANGLE VARSHARELIST=([1,2]=3)", "shares what another one has, and that does not stand"),
        ("ET=TRIANGLE", "ET=TRIANGLE PASSIVEVARLIST=([1])", "does not have Y for each point of its own"),
        ("ET=TRIANGLE", "ET=TRIANGLE VARLOCATION=([2]=CELLCENTERED)", "does not have Y for each point of its own"),
        ("ZONE", "TEXT", "it has no zone"),
        ("TITLE", "#!TDV112 TITLE", "is a binary file of Tecplot, which meshfix does not read"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after, 1).encode())
