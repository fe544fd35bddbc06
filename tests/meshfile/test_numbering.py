"""Numbers of nodes and elements: other formats have them, other programs find them there, and what is lost is named."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from commands import error_line
from laden import box, document_of, elements_of, laden, nodes_of, places, with_numbers, written
from named_groups import named
from programs import gmsh_session
from splicing import MODULES, make

from meshfix_cli import read, write
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.source import Arrays, Cells

GMSH = [Format(name, binary) for name in ("gmsh22", "gmsh") for binary in (False, True)]
NUMBERED = [*GMSH, Format("abaqus"), Format("nastran"), Format("exodus")]
LARGEST = {"gmsh22": 2**31 - 1, "gmsh": 2**31 - 1, "abaqus": 10**9 - 1, "nastran": 10**8 - 1, "exodus": 2**31 - 1}
BOTH = ("numbers of nodes", "numbers of elements")


def in_gmsh(path: Path) -> tuple[dict[Any, int], dict[Any, int]]:
    with gmsh_session() as gmsh:
        gmsh.open(str(path))
        tags, points, _ = gmsh.model.mesh.getNodes()
        at = dict(zip(tags.tolist(), map(tuple, (points.reshape(-1, 3).round(5) + 0.0).tolist()), strict=True))
        elements = {}
        for kind, mine, nodes in zip(*gmsh.model.mesh.getElements(), strict=True):
            for number, row in zip(mine.tolist(), nodes.reshape(len(mine), -1).tolist(), strict=True):
                elements[kind, tuple(sorted(at[node] for node in row))] = number
        return {place: tag for tag, place in at.items()}, elements


@pytest.mark.parametrize("form", [*GMSH, Format("nastran")])
def test_gmsh_finds_the_numbers(form: Format, tmp_path: Path) -> None:
    source = with_numbers(laden())
    document = document_of(source)
    _, dropped = write(document, document.mesh, tmp_path / ("out.bdf" if form.name == "nastran" else "out.msh"), form)
    assert not {*BOTH} & {*dropped}
    nodes, elements = in_gmsh(next(tmp_path.iterdir()))
    assert nodes == nodes_of(source)
    assert {key[1]: number for key, number in elements.items()} == {
        key[1:]: number for key, number in elements_of(source).items()
    }


def test_lines_of_abaqus_have_the_numbers(tmp_path: Path) -> None:
    """meshio, which does not tell them, finds elements and sets by them."""
    source = with_numbers(named())
    back, dropped = written(source, Format("abaqus"), tmp_path / "out.inp")
    assert not {*BOTH} & {*dropped}
    text = (tmp_path / "out.inp").read_text()
    sections = re.findall(r"(?m)^\*(?:NODE|ELEMENT)\b.*\n((?:[^*].*\n)+)", text)
    listed = [[int(line.split(",")[0]) for line in lines.splitlines()] for lines in sections]
    ids = [run.ids.tolist() for run in source.cells if run.ids is not None]
    assert listed == [[*nodes_of(source).values()], *ids]
    mesh = meshio.read(tmp_path / "out.inp")
    for run, block in zip(source.cells, mesh.cells, strict=True):
        np.testing.assert_array_equal(block.data, run.vertices)
    np.testing.assert_array_equal(np.sort(mesh.cell_sets["both"][0]), source.arrays.cell_sets["both"][0])
    np.testing.assert_array_equal(np.sort(mesh.point_sets["corner"]), source.arrays.point_sets["corner"])
    assert nodes_of(back) == nodes_of(source)


def test_maps_of_exodus_have_the_numbers(tmp_path: Path) -> None:
    netcdf = pytest.importorskip("netCDF4")
    source = with_numbers(laden())
    _, dropped = written(source, Format("exodus"), tmp_path / "out.e")
    assert not {*BOTH} & {*dropped}
    at, elements = places(source), {key[1:]: number for key, number in elements_of(source).items()}
    with netcdf.Dataset(tmp_path / "out.e") as file:
        assert file["node_num_map"][:].tolist() == source.numbers().tolist()  # type: ignore[union-attr]
        tables = [file[f"connect{i}"][:] - 1 for i in range(1, file.dimensions["num_el_blk"].size + 1)]
        rows = [tuple(sorted(at[i] for i in row)) for table in tables for row in table.tolist()]
        assert [elements[row] for row in rows] == file["elem_num_map"][:].tolist()


@pytest.mark.parametrize("form", NUMBERED)
def test_the_largest_numbers_are_kept_and_larger_ones_are_not(form: Format, tmp_path: Path) -> None:
    most = LARGEST[form.name]
    back, dropped = written(box([most, 5, 7, 3, 1], [most, 2], [9, 4]), form, tmp_path / "out")
    assert dropped == ()
    assert [*nodes_of(back).values()] == [most, 5, 7, 3, 1]
    assert {*elements_of(back).values()} == {most, 2, 9, 4}
    back, dropped = written(box([most + 1, 5, 7, 3, 1], [most, 2], [9, 4]), form, tmp_path / "out")
    assert dropped == ("numbers of nodes",) and {*elements_of(back).values()} == {most, 2, 9, 4}
    assert [*nodes_of(back).values()] == [8, 5, 7, 3, 1]
    back, dropped = written(box([most, 5, 7, 3, 2**40], [2**40, 2], [9, 4]), form, tmp_path / "out")
    assert dropped == BOTH and sorted(elements_of(back).values()) == [2, 4, 9, 10]
    assert [*nodes_of(back).values()] == [most, 5, 7, 3, 1]  # there is no larger one


@pytest.mark.parametrize("form", [*NUMBERED, Format("vtu"), Format("medit"), Format("su2")])
@pytest.mark.parametrize("name", ["none", "counted", "of each type", "places"])
def test_numbers_that_only_count_are_not_missed(name: str, form: Format, tmp_path: Path) -> None:
    source = {
        "none": box(None, None, None),
        "counted": box([1, 2, 3, 4, 5], [1, 2], [3, 4]),
        "of each type": box([1, 2, 3, 4, 5], [1, 2], [1, 2]),
        "places": box([0, 1, 2, 3, 4], [0, 3], [2, 1]),
    }[name]
    _, dropped = written(source, form, tmp_path / "out")
    assert not {*BOTH} & {*dropped}


@pytest.mark.parametrize("form", NUMBERED)
def test_of_a_number_that_stands_twice_the_solid_keeps_it(form: Format, tmp_path: Path) -> None:
    """As the elements of several parts of Abaqus, or a rigid element of Nastran, whose bars have its number."""
    source = box([9, 2, 3, 3, -4], [3, 2], [2, 7])
    source = replace(source, cells=source.cells[::-1])
    back, dropped = written(source, form, tmp_path / "out")
    assert dropped == BOTH
    assert [*nodes_of(back).values()] == [9, 2, 3, 10, 11]
    numbers: dict[str, list[int]] = {}
    for (key, *_), number in elements_of(back).items():
        numbers[key] = sorted([*numbers.get(key, []), number])
    assert numbers == {"tetra": [2, 3], "triangle": [7, 8]}


@pytest.mark.parametrize("form", NUMBERED)
def test_cells_without_numbers_come_behind_those_that_have_some(form: Format, tmp_path: Path) -> None:
    source = box([9, 8, 7, 6, 5], [20, 10], None)
    more = replace(source, cells=[*source.cells, Cells("tetra", np.array([[0, 2, 3, 4]]))])
    back, dropped = written(more, form, tmp_path / "out")
    assert dropped == ()
    assert sorted(elements_of(back).values()) == [10, 20, 21, 22, 23]


@pytest.mark.parametrize("form", NUMBERED)
def test_numbers_that_ascend_in_each_type_are_not_missed(form: Format, tmp_path: Path) -> None:
    """Also where a file has elements of one type in several places."""
    labels = Arrays(cell={"material": [np.array([1, 2]), np.array([1, 1])]})
    source = replace(box([1, 3, 5, 7, 9], [10, 20], [4, 30], arrays=labels), regions=("material",))
    _, dropped = written(source, form, tmp_path / "out")
    assert not {*BOTH} & {*dropped}


@pytest.mark.parametrize("form", [Format("vtu"), Format("vtk"), Format("medit"), Format("su2"), Format("xdmf")])
def test_formats_without_numbers_lose_them(form: Format, tmp_path: Path) -> None:
    _, dropped = written(box([2, 1, 3, 4, 5], [1, 2], [3, 4]), form, tmp_path / "out")
    assert dropped == ("numbers of nodes",)
    _, dropped = written(box([1, 2, 3, 4, 5], [1, 2], [4, 3]), form, tmp_path / "out")
    assert dropped == ("numbers of elements",)


@pytest.mark.parametrize(
    "reader", ["abaqus", "adcirc", "avsucd", "febio", "gambit", "getfem", "gmsh", "lsdyna", "mapdl", "mdpa",
               "nastran", "unv"],
)  # fmt: skip
def test_files_of_other_programs_have_numbers(reader: str, tmp_path: Path) -> None:
    """Of all points; gmsh has them all, or their loss is named, but for places, which begin with 0."""
    document = read(make(reader, next(iter(MODULES[reader].FILES)), tmp_path))
    numbers = document.source.numbers()
    assert numbers is not None and len(numbers) == len(document.source.points)
    _, dropped = write(document, document.mesh, tmp_path / "converted.msh", Format("gmsh", True))
    found = read(tmp_path / "converted.msh").source.numbers()
    assert found is not None
    counts = np.array_equal(numbers, numbers[0] + np.arange(len(numbers)))
    assert np.array_equal(found, numbers) or "numbers of nodes" in dropped or (counts and numbers[0] == 0)


@pytest.mark.parametrize("stray", [-1, 7, 2**31])
@pytest.mark.parametrize(
    "form", [*NUMBERED, Format("vtu"), Format("vtk"), Format("medit"), Format("su2"), Format("xdmf"), Format("med")]
)
def test_cells_that_name_points_that_are_not_there_are_left_out_and_told(
    form: Format, stray: int, tmp_path: Path
) -> None:
    """Those that are held: other programs would refuse the file, or read beyond its points. Others of the type stay."""
    source = box([1, 2, 3, 4, 5], [1, 2], [3, 4])
    arrays = Arrays(cell={"a": [np.array([1.0, 2.0]), np.array([3.0, 4.0]), np.array([5.0, 6.0])]})
    astray = Cells("triangle", np.array([[0, 1, stray], [1, 2, 3]]))
    back, dropped = written(replace(source, cells=[*source.cells, astray], load=lambda: arrays), form, tmp_path / "out")
    told, *others = dropped
    assert told == "1 cell that named points that are not there"
    assert set(others) <= {"cell data a"}
    assert [len(back.vertices_of(key, corners)) for key, corners in (("tetra", 4), ("triangle", 3))] == [2, 3]


@pytest.mark.parametrize("row", ["1 1 99", "1 0 0", "-3 -3 1", "99 99 99"])
def test_a_collapsed_element_names_points_that_are_there(row: str, tmp_path: Path) -> None:
    """As any other element does, or the file is damaged."""
    head = "MeshVersionFormatted 2\nDimension 2\nVertices 4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
    (tmp_path / "in.mesh").write_text(f"{head}Triangles 3\n1 2 3 0\n1 3 4 0\n{row} 0\nEnd\n")
    said = error_line("untangle", tmp_path / "in.mesh", tmp_path / "out.inp")
    assert re.search(r"in.mesh: a triangle refers to vertices \[.*\], but there are 4 points$", said)
