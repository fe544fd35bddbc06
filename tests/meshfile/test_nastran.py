"""Decks of Nastran: cards in all their fields, elements and what holds their points, coordinate systems."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from files_medit import material
from files_nastran import FILES, flat, number, real
from shapes import block, plate

from meshfix_cli import read, write
from meshfix_cli.errors import MeshfixError, ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.nastran import parse
from meshfix_cli.meshfile.solved import ids_of
from meshfix_cli.meshfile.source import Source

SQUARE = b"""GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,1.,1.,0.
GRID,4,,0.,1.,0.
GRID,5,,.4,.5,0.
CTRIA3,11,7,1,2,5
CTRIA3,12,7,2,3,5
CTRIA3,13,,3,4,5
CTRIA3,14,8,4,1,5
"""


def cube(size: int) -> list[np.ndarray]:
    """The nodes of VTK's hexahedron of 8 or 20 nodes, and those of a wedge of 15."""
    cells = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    cell = {8: cells.vtkHexahedron, 20: cells.vtkQuadraticHexahedron, 15: cells.vtkQuadraticWedge}[size]()
    return list(np.array([cell.GetParametricCoords()[i] for i in range(3 * size)]).reshape(-1, 3))


def grids(points: list[np.ndarray]) -> str:
    return "".join(f"GRID,{i},,{','.join(map(real, p))}\n" for i, p in enumerate(points, 1))


def types(source: Source) -> dict[str, list[list[int]]]:
    return {run.type: run.vertices.tolist() for run in source.cells}


def test_elements_have_their_numbers_and_properties() -> None:
    source = parse(SQUARE)
    assert [ids_of(run, 0).tolist() for run in source.cells] == [[11, 12, 13, 14]]
    assert source.regions == ("nastran:ref",)
    assert source.arrays.cell["nastran:ref"][0].tolist() == [7, 7, 13, 8], "a blank property is the element's number"


@pytest.mark.parametrize("name", FILES)
def test_what_stands_there_is_another_programs_mesh(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    source = parse((tmp_path / name).read_bytes())
    points, cells = plate() if name in ("free.bdf", "flat.dat", "tabs.dat") else block()
    few = name in ("small.bdf", "meshio.fem", "tabs.dat", "widths.blk")  # digits, as fields are small
    rough = 5e-5 if few else 5e-7
    np.testing.assert_allclose(source.points, points[:, : source.points.shape[1]], 0, rough)
    solved = next(run for run in source.cells if run.vertices.shape[1] == cells.shape[1])
    np.testing.assert_array_equal(solved.vertices, cells)
    if name in ("meshio.bdf", "flat.dat", "widths.blk"):
        at = source.cells.index(solved)
        np.testing.assert_array_equal(source.arrays.cell["nastran:ref"][at], material(points, cells))


@pytest.mark.parametrize(
    "card",
    [
        "GRID    5               .4      .5      0.",
        "GRID    5               .4      .5",
        "GRID*   5                               .4              .5\n*       0.0",
        "GRID*   5                               .4              .5",
        "GRID*   5                               .4              .5              *ABC\n$ between\n*ABC    0.0",
        "GRID*,5,,.4,.5,*A\n*A,0.",
        "GRID*,5,,.4,.5\n*,0.",
        "grid,5,,4.-1,.5",
        "GRID ,5, , 4.0E-1 , 5.D-1 ,  $ a comment, with commas",
        "GRID\t5\t\t.4\t.5\t0.",
        "GRID    5       0       +.4     0.5     0.0     0       123456  0",
        "GRID           5              .4      .5                                        ",
    ],
)
def test_cards_have_many_forms(card: str, tmp_path: Path) -> None:
    deck = SQUARE.replace(b"GRID,5,,.4,.5,0.", card.encode())
    for text in (deck, deck.replace(b"\n", b"\r\n"), deck.replace(b"\n", b"\r"), b"SOL 1\nBEGIN BULK\n" + deck):
        source = parse(text)
        assert source.points[4, :2].tolist() == [0.4, 0.5]
        (tmp_path / "in.bdf").write_bytes(text)
        document = read(tmp_path / "in.bdf")
        moved = document.mesh.points.copy()
        moved[4] = (0.123456789, 0.654321)
        write(document, document.mesh.with_points(moved), tmp_path / "out.bdf")
        again = parse((tmp_path / "out.bdf").read_bytes())
        np.testing.assert_allclose(again.points[:, :2], moved, 0, 1e-7)
        np.testing.assert_array_equal(again.points[:4], source.points[:4])
        assert types(again) == types(source)


def test_a_field_behind_the_end_of_its_line_is_held() -> None:
    source = parse(SQUARE.replace(b"GRID,5,,.4,.5,0.", b"GRID,5").replace(b"GRID,3,,1.,1.,0.", b"GRID,3,,1.,1.,.1"))
    assert source.points[4].tolist() == [0, 0, 0]
    assert source.held is not None
    assert source.held.tolist() == [False] * 4 + [True]


def test_nodes_of_second_order_stand_as_vtk_has_them() -> None:
    for size, name, order in (
        (20, "CHEXA", [*range(12), 16, 17, 18, 19, 12, 13, 14, 15]),
        (15, "CPENTA", [*range(9), 12, 13, 14, 9, 10, 11]),
    ):
        points = cube(size)
        nodes = ["1", "1", *(str(order[i] + 1) for i in range(size))]
        lines = ["\n,".join(",".join(nodes[i : i + 8]) for i in range(0, len(nodes), 8))]
        source = parse((grids(points) + f"{name},{lines[0]}\n").encode())
        key = {20: "hexahedron20", 15: "wedge15"}[size]
        assert types(source) == {key: [list(range(size))]}
        assert source.cells[0].type in ELEMENTS


def test_nodes_of_cards_are_those_of_the_manual() -> None:
    """The third edge of a CHEXA that has a node is vertical, and so is its thirteenth node; likewise of a CPENTA."""
    for size, name, corners, vertical in ((20, "CHEXA", 8, 12), (15, "CPENTA", 6, 9)):
        points = cube(size)
        middle = (points[0] + points[corners // 2]) / 2
        here = next(i for i, p in enumerate(points) if np.allclose(p, middle))
        numbers = [*range(1, corners + 1)] + [0] * (size - corners)
        numbers[vertical] = here + 1
        nodes = ["1", "1", *map(str, numbers)]
        text = "\n,".join(",".join(nodes[i : i + 8]) for i in range(0, len(nodes), 8))
        (run,) = parse((grids(points) + f"{name},{text}\n").encode()).cells
        assert run.type == f"{'hexahedron' if size == 20 else 'wedge'}_incomplete"
        assert run.vertices[0, vertical] == here
        assert (run.vertices[0, corners:] >= 0).sum() == 1


def test_edges_without_nodes_and_texts_behind_them() -> None:
    points = cube(8)
    corners = "CHEXA,1,1,1,2,3,4,5,6\n,7,8"
    for text in (corners, f"{corners},0,,0", f"{corners}\n,,,\n+,CORDM,3", f"{corners.replace('CHEXA', 'chexa')}$ 9"):
        assert types(parse((grids(points) + text + "\n").encode())) == {"hexahedron": [list(range(8))]}
    assert list(types(parse((grids(points) + corners + ",1,,3\n").encode()))) == ["hexahedron_incomplete"]
    one_line = "CHEXA,1,1,1,2,3,4,5,6,7,8\n"
    assert types(parse((grids(points) + one_line).encode())) == {"hexahedron": [list(range(8))]}
    along = "CTRIAX6,1,1,1,5,2,6,3,7\n"
    assert types(parse((grids(points) + along).encode())) == {"triangle6": [[0, 1, 2, 4, 5, 6]]}


@pytest.mark.parametrize(
    ("card", "held"),
    [
        ("CBAR,1,1,1,5,0.,1.,0.", [0, 4]),
        ("CONROD,1,5,2,1,1.", [1, 4]),
        ("CELAS1,1,1,5,1,2,1", [1, 4]),
        ("CELAS2,1,1.+5,5,1", [4]),
        ("CELAS1,1,1,99,,5,1", [4]),
        ("CONM2,1,5,,3.", [4]),
        ("RBE2,1,5,123,1,3,1.-5", [0, 2, 4]),
        ("RBE3,1,,5,123,1.,3,1,4\n,2.,2,2,UM,1,1", [0, 1, 3, 4]),
        ("RBAR,1,5,1,123456", [0, 4]),
        ("PLOTEL,1,5,1", [0, 4]),
    ],
)
def test_what_is_no_element_holds_its_points(card: str, held: list[int]) -> None:
    source = parse(SQUARE + f"{card}\n".encode())
    others = [run for run in source.cells if run.type != "triangle"]
    assert {run.type for run in others} <= {"line", "vertex"}
    assert sorted({int(v) for run in others for v in run.vertices.ravel()}) == held
    assert {int(i) for run in others for i in ids_of(run, 0)} == {1}


def test_constraints_are_sets_and_systems_hold_their_points() -> None:
    cards = b"SPC1,3,123456,1,2\nSPC1,3,12,4,THRU,900000000\nSPC,4,5,123,0.,1,12\nCORD1R,9,5,1,2\n"
    source = parse(SQUARE + cards)
    sets = {name: rows.tolist() for name, rows in source.arrays.point_sets.items()}
    assert sets == {"SPC 3": [0, 1, 3, 4], "SPC 4": [0, 4]}
    assert source.held is not None
    assert np.flatnonzero(source.held).tolist() == [0, 1, 4]


def test_systems_of_coordinates() -> None:
    inner = SQUARE.replace(b"GRID,5,,", b"GRID,5,2,")
    with pytest.raises(ReadError, match=r"has points in several coordinate systems \(0, 2\)"):
        parse(inner)
    everywhere = b"GRDSET,,2\n" + SQUARE
    with pytest.raises(ReadError, match="in the coordinate system 2, and does not define it"):
        parse(everywhere)
    assert len(parse(everywhere + b"CORD2R,2,,0.,0.,0.,0.,0.,1.\n,1.,0.,1.\n").points) == 5
    assert len(parse(everywhere + b"CORD1R,1,1,2,3,2,1,2,4\n").points) == 5
    with pytest.raises(ReadError, match=r"in a cylindrical system \(CORD2C 2\)"):
        parse(everywhere + b"CORD2C,2,,0.,0.,0.,0.,0.,1.\n,1.,0.,1.\n")
    assert len(parse(SQUARE + b"GRID,77,2,1.,1.,1.\nCONM2,1,77,,1.\n").points) == 6, "no element has it"


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (b"GRID,5,,.4", b"GRID,5,,x", "line 5: 'x' is not a number"),
        (b"GRID,5,,.4", b"GRID,,,.4", "line 5: GRID has no number"),
        (b"GRID,5,,.4", b"GRID,5.,,.4", "line 5: '5.' is not an integer"),
        (b"GRID,5,,.4", b"GRID,4,,.4", "the point 4 is defined twice"),
        (b"4,1,5", b"4,1,6", "the cell 14 names the point 6, and there is none"),
        (b"4,1,5", b"4,1", "line 9: CTRIA3 lacks a number of a point, or its own"),
        (b"4,1,5", b"4,1,0", "line 9: CTRIA3 lacks a number of a point, or its own"),
        (b"GRID,1,", b"INCLUDE 'a.bdf'\nGRID,1,", "line 1: includes other files, which meshfix does not read"),
        (b"GRID,1,", b"=,*(1),=,=\nGRID,1,", "line 1: repeats cards by =, which meshfix does not read"),
        (b"GRID,1,", b"BEGIN BULK\nGRID,1,,0.\nBEGIN SUPER=1\nGRID,1,", "several bulk data sections"),
        (b"GRID,5,,.4,.5,0.", b"GRID,5,,.4,.5,0.,,,,+A\n+B,1", "line 5: what follows the card bears the name"),
    ],
)
def test_what_is_wrong_is_named(before: bytes, after: bytes, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after))


def test_what_ends_too_early_is_named(tmp_path: Path) -> None:
    for text in (b"BEGIN BULK\n", b"BEGIN BULK\n$ no more\n", SQUARE.replace(b"GRID", b"ENDDATA\nGRID", 1)):
        with pytest.raises(ReadError, match="it has no GRID"):
            parse(text)
    flat(tmp_path / "in.dat")
    data = (tmp_path / "in.dat").read_bytes()
    whole = read(tmp_path / "in.dat").mesh.topology.m
    for cut in range(1, data.rindex(b"CTRIA3"), 997):
        (tmp_path / "in.dat").write_bytes(data[:cut])
        try:
            document = read(tmp_path / "in.dat")
        except MeshfixError:
            continue
        assert document.mesh.topology.m < whole


def test_a_section_that_does_not_end_may_have_been_cut(tmp_path: Path) -> None:
    path = tmp_path / "in.bdf"
    for before, after, told in (
        (b"", b"", False),
        (b"BEGIN BULK\n", b"ENDDATA\n", False),
        (b"BEGIN BULK\n", b"", True),
    ):
        path.write_bytes(before + SQUARE + after)
        assert any("no ENDDATA" in note for note in read(path).notes) is told


def test_elements_in_fields_of_different_widths_are_not_renumbered() -> None:
    source = parse(SQUARE.replace(b"CTRIA3,12,7,2,3,5", b"CTRIA3  12      7       2       3       5"))
    assert types(source) == types(parse(SQUARE))
    with pytest.raises(ReadError, match="in fields of different widths"):
        source.layout.corners[0]()  # type: ignore[union-attr]


def test_numbers_of_nastran() -> None:
    assert [number(word) for word in ("1.5-3", "-.5+2", "1.e5", "")] == [1.5e-3, -50.0, 1e5, 0.0]
