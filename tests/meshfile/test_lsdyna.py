"""Keyword files of LS-DYNA: degenerate solids, columns, sets and parts, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elements import MESHES
from files_lsdyna import FILES, nodes
from files_medit import material
from second_order import element, is_straight
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.lsdyna import parse

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]])
SHELLS = "".join(f"{i:8}{1:8}{a:8}{b:8}{5:8}{5:8}\n" for i, a, b in ((11, 1, 2), (12, 2, 3), (13, 3, 4), (14, 4, 1)))
SQUARE = f"*KEYWORD\n*NODE\n{nodes(POINTS)}*ELEMENT_SHELL\n{SHELLS}*END\n"
# As the manual has solids of fewer corners.
AS_SOLIDS = {"tetra": [0, 1, 2, 3, 3, 3, 3, 3], "pyramid": [0, 1, 2, 3, 4, 4, 4, 4], "wedge": [1, 0, 3, 4, 2, 2, 5, 5]}


def cards(*values: int, columns: int = 8) -> str:
    return "".join(f"{value:{columns}}" for value in values) + "\n"


def test_cells_have_their_numbers_and_parts() -> None:
    (run,) = parse(SQUARE.encode()).cells
    assert run.ids is not None
    assert (run.type, run.ids.tolist(), run.vertices[0].tolist()) == ("triangle", [11, 12, 13, 14], [0, 1, 4])


def test_parts_and_sets(tmp_path: Path) -> None:
    FILES["prepost.k"](tmp_path / "in.k")
    document = read(tmp_path / "in.k")
    labels = document.source.arrays.cell["lsdyna:part"][0]
    np.testing.assert_array_equal(labels, material(*block()))
    held = document.mesh.topology.interface(labels)
    assert held.any()
    assert not document.mesh.movable[held].any()
    groups = groups_of(document.source)
    assert list(groups) == ["a block of steel", "copper", "set_part 7", "set_solid 3", "clamped"]
    assert groups["copper"].counts == groups["set_part 7"].counts == {3: int((labels == 2).sum())}
    assert groups["set_solid 3"].counts == {3: 4}
    assert groups["clamped"].points.tolist() == [0, 1, 2]


@pytest.mark.parametrize("two", [False, True])
@pytest.mark.parametrize("columns", [8, 10, 20])
def test_solids_of_every_type(columns: int, two: bool, tmp_path: Path) -> None:
    points, blocks = MESHES["every solid"]()
    option, text, number = {8: "", 10: " I10=Y", 20: " LONG=Y"}[columns], "", 0
    for key, some in blocks:
        for row in some[:, AS_SOLIDS.get(key, ...)].tolist():
            number += 1
            head, rest = cards(number, 1, columns=columns), cards(*(one + 1 for one in row), columns=columns)
            text += head + rest if two else head.rstrip("\n") + rest
    body = nodes(points, columns, 20 if columns == 20 else 16)
    (tmp_path / "in.k").write_text(f"*KEYWORD{option}\n*NODE\n{body}*ELEMENT_SOLID\n{text}*END\n")
    document = read(tmp_path / "in.k")
    assert document.mesh.check()[0] == 0
    assert not document.mesh.topology.flipped.any()
    counts = dict.fromkeys((part.key for part in document.parts), 0)
    for part in document.parts:
        counts[part.key] += len(part.vertices)
    assert counts == {key: len(some) for key, some in blocks}


def test_numbers_that_touch_are_told_apart_by_their_columns() -> None:
    full = SQUARE.replace("      0.50000000      0.50000000", "-0.5000000000000-0.5000000000000")
    assert parse(full.encode()).points[4].tolist() == [-0.5, -0.5, 0.0]
    wide = SQUARE.replace(cards(14, 1, 4, 1, 5, 5), cards(12345678, 10000001, 4, 1, 5, 5))
    assert parse(wide.encode()).arrays.cell["lsdyna:part"][0].tolist() == [1, 1, 1, 10000001]


def test_a_plane_mesh_may_lack_the_third_coordinate(tmp_path: Path) -> None:
    lines = [line[:40].rstrip() if ".0" in line else line for line in SQUARE.splitlines()]
    (tmp_path / "in.k").write_text("\n".join(lines))
    assert read(tmp_path / "in.k").source.points.shape == (5, 2)


def test_what_is_no_solid_or_shell_holds_its_nodes(tmp_path: Path) -> None:
    for text in ("*ELEMENT_MASS\n" + cards(90, 5), "*ELEMENT_DISCRETE\n" + cards(90, 2, 5, 1),
                 "*ELEMENT_BEAM_ORIENTATION\n" + cards(90, 2, 5, 1) + "       1.0       0.0       0.0\n"):  # fmt: skip
        (tmp_path / "in.k").write_text(SQUARE.replace("*END", text + "*END"))
        assert read(tmp_path / "in.k").mesh.movable.sum() == 0
    assert read_text(tmp_path, SQUARE).mesh.movable.sum() == 1


def read_text(folder: Path, text: str):  # type: ignore[no-untyped-def]
    (folder / "in.k").write_text(text)
    return read(folder / "in.k")


def test_a_curved_element_among_others_is_judged_as_such(tmp_path: Path) -> None:
    points, blocks = MESHES["every solid"]()
    tetra = dict(blocks)["tetra"]
    text = "".join(cards(i, 1) + cards(*row, *[row[-1]] * 4) for i, row in enumerate((tetra + 1).tolist(), 1))
    text += cards(9999, 1) + cards(*range(1, 11))
    document = read_text(tmp_path, f"*KEYWORD\n*NODE\n{nodes(points)}*ELEMENT_SOLID\n{text}*END\n")
    assert document.mesh.quadratic is not None
    assert document.ids[document.mesh.quadratic.rows].tolist() == [9999]


@pytest.mark.parametrize("key", ["quad8", "tetra10"])
def test_nodes_of_second_order_come_in_the_order_of_vtk(key: str) -> None:
    """As in the manual; of shells and solids of ten nodes gmsh writes the same."""
    points = element(key)
    shell = cards(1, 1, *range(1, 9))
    text = f"*ELEMENT_SHELL\n{shell}" if key == "quad8" else f"*ELEMENT_SOLID\n{cards(1, 1)}{cards(*range(1, 11))}"
    (run,) = parse(f"*KEYWORD\n*NODE\n{nodes(points)}{text}*END\n".encode()).cells
    assert run.type == key
    assert is_straight(key, points[run.vertices], 1e-6)


def test_shells_that_lack_nodes_of_their_edges_are_held() -> None:
    for some in ((1, 2, 3, 4, 5, 6, 7, 0), (1, 2, 3, 3, 5, 6, 7, 7)):
        (run,) = parse(f"*NODE\n{nodes(element('quad8'))}*ELEMENT_SHELL\n{cards(1, 1, *some)}*END\n".encode()).cells
        assert run.type == "quad_of_8"


def test_included_files_are_told(tmp_path: Path) -> None:
    document = read_text(tmp_path, SQUARE.replace("*END", "*INCLUDE\nother.k\n*END"))
    assert "it includes other files, which are left where they are" in document.source.notes
    assert document.source.untold == ("keywords INCLUDE",)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("*NODE\n", "*NADE\n", "it has no"),
        ("      14       1", "      14       x", "line 12: '.*x' is not a number"),
        ("      14       1", "      14     1.5", "line 12: a field is not an integer"),
        (
            "       4       1       5       5",
            "       4       1       6       6",
            "the cell 14 names the point 6, and there",
        ),
        ("0.50000000", "0.5000000y", "line 7: '0.5000000y' is not a number"),
        ("       2      1.0", "       1      1.0", "the point 1 is defined twice"),
        ("ELEMENT_SHELL", "ELEMENT_SHELL_COMPOSITE", r"has \*ELEMENT_SHELL_COMPOSITE, which is not read"),
        ("ELEMENT_SHELL", "ELEMENT_PLOTEL", r"has \*ELEMENT_PLOTEL, which is not read"),
        ("ELEMENT_SHELL", "ELEMENT_SHELL_OFFSET_DOF", "there are not 3 cards for each element of"),
        ("       1      0.0", "1,0.0", "cards of .NODE are divided by commas in part"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after, 1).encode())


@pytest.mark.parametrize(("kind", "fewest"), [("SHELL", 3), ("SOLID", 4)])
def test_elements_between_commas_with_too_few_nodes_are_refused(tmp_path: Path, kind: str, fewest: int) -> None:
    text = f"*NODE\n1,0.,0.,0.\n2,1.,0.,0.\n3,0.,1.,0.\n*ELEMENT_{kind}\n1,1,1,2\n*END\n"
    with pytest.raises(ReadError, match=rf"there are fewer than {fewest} nodes of each element of \*ELEMENT_{kind}"):
        read_text(tmp_path, text)


def test_triangles_between_commas_may_name_three_nodes_alone(tmp_path: Path) -> None:
    text = "*NODE\n1,0.,0.,0.\n2,1.,0.,0.\n3,0.,1.,0.\n*ELEMENT_SHELL\n1,1,1,2,3\n*END\n"
    assert [run.type for run in read_text(tmp_path, text).source.cells] == ["triangle"]
