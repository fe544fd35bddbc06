"""Abaqus files: numbers, sets and sections of every scope, in the dialects of the programs that write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from files_abaqus import FILES, elements, nodes, read_independently
from files_medit import interior, material, surface
from shapes import block, plate

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import dimension_of
from meshfix_cli.meshfile.abaqus import parse
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.meshfile.source import Source

NODES = b"*NODE\n1, 0., 0.\n2, 1., 0.\n3, 1., 1.\n4, 0., 1.\n50, .5, .25\n"
SMALL = NODES + b"*ELEMENT, TYPE=CPS3, ELSET=All\n1, 1, 2, 50\n2, 2, 3, 50\n3, 3, 4, 50\n4, 4, 1, 50\n"


def parsed(data: bytes) -> Source:
    source = parse(data)
    assert source is not None
    return source


def made(name: str, folder: Path) -> bytes:
    FILES[name](folder / name)
    return (folder / name).read_bytes()


def cells_of(source: Source, kind: str) -> list[list[int]]:
    return source.vertices_of(kind, {"triangle": 3, "tetra": 4}[kind]).tolist()


@pytest.mark.parametrize("name", FILES)
def test_points_are_those_of_the_other_reader(name: str, tmp_path: Path) -> None:
    source = parsed(made(name, tmp_path))
    points, _ = read_independently(tmp_path / name)
    np.testing.assert_array_equal(source.points, points[:, : source.points.shape[1]])
    assert source.points.dtype == np.float64


@pytest.mark.parametrize("name", ["cae.inp", "calculix.inp", "gmsh.inp", "meshio.inp", "continued.inp"])
def test_solids(name: str, tmp_path: Path) -> None:
    source = parsed(made(name, tmp_path))
    points, cells = block()
    np.testing.assert_allclose(source.points[: len(points)], points, atol=1e-15)
    found = np.array(cells_of(source, "tetra"))
    order = {"calculix.inp": range(len(cells))[::-1], "cae.inp": np.argsort(material(points, cells), kind="stable")}
    expected = cells[np.asarray(order.get(name, range(len(cells))))]
    np.testing.assert_array_equal(np.sort(found), np.sort(expected))  # gmsh turns those that are inverted
    if name in ("calculix.inp", "gmsh.inp", "continued.inp"):
        np.testing.assert_array_equal(np.sort(cells_of(source, "triangle")), np.sort(surface(cells)))


def test_plane_nodes(tmp_path: Path) -> None:
    source = parsed(made("plane.inp", tmp_path))
    points, cells = plate()
    np.testing.assert_array_equal(source.points, [*points[:, :2], [1.0, 1.0]])
    assert cells_of(source, "triangle") == cells.tolist()
    assert source.arrays.cell["abaqus:section"][0].tolist() == [1] * len(cells)
    with pytest.raises(ReadError, match="some nodes have two coordinates, and others three"):
        parse((tmp_path / "plane.inp").read_bytes().replace(b"1., 1., 0.", b"1., 1., 2."))


def test_scopes_of_parts(tmp_path: Path) -> None:
    source = parsed(made("parts.inp", tmp_path))
    n, cells = len(plate()[0]), plate()[1]
    assert source.points.shape == (2 * n, 3)
    assert cells_of(source, "triangle") == [*cells.tolist(), *(cells + n).tolist()]
    connectors = source.cells[2]
    assert [row.tolist() for row in connectors.vertices] == [[0, n], [1]]
    assert {name: rows.tolist() for name, rows in source.arrays.point_sets.items()} == {"N": [2, n + 3]}
    numbers = [run.tolist() for run in source.arrays.cell["abaqus:section"]]
    assert numbers == [[1] * len(cells), [2] * len(cells), [0, 0]]
    sets = {name: [len(run) for run in runs] for name, runs in source.arrays.cell_sets.items()}
    assert sets == {"E": [len(cells), 0, 0], "INSTANCE B-1 E": [0, len(cells), 0], "ASSEMBLY E": [2, 0, 0]}


def test_sections_and_sets_of_cae(tmp_path: Path) -> None:
    source = parsed(made("cae.inp", tmp_path))
    points, cells = block()
    solids, spring, mass = source.arrays.cell["abaqus:section"]
    assert source.regions == ("abaqus:section",)
    assert solids.tolist() == sorted(material(points, cells))
    assert [*spring, *mass] == [0, 0]
    assert source.cells[1].type == "line"
    assert source.cells[1].vertices.tolist() == [[len(points), interior(points, cells)[2]]]
    assert source.cells[2].vertices.tolist() == [[len(points)]]
    assert source.arrays.point_sets["RP"].tolist() == [len(points)]
    assert source.arrays.point_sets["Set-1"].tolist() == list(range(len(points)))
    assert source.arrays.point_sets["ASSEMBLY Set-1"].tolist() == [0, 1, 2]
    assert source.arrays.cell_sets["Top"][0].tolist() == [4, 5]
    assert source.untold[0] == "comments"
    assert source.untold[1].startswith("keywords *HEADING, *PREPRINT, *PART, *SOLID SECTION, *ASSEMBLY, *INSTANCE, ")
    assert "*MATERIAL, *ELASTIC, *STEP" in source.untold[1]
    assert "instances are not moved to their places" in source.notes[0]


def test_numbers_of_calculix(tmp_path: Path) -> None:
    source = parsed(made("calculix.inp", tmp_path))
    _, cells = block()
    assert source.cells[0].ids is not None
    assert source.cells[0].ids.tolist() == list(range(1000, 1000 + len(cells)))
    assert all((run == 1).all() for run in source.arrays.cell["abaqus:section"])
    assert [len(run) for run in source.arrays.cell_sets["Both"]] == [len(cells), len(surface(cells))]
    assert len(source.arrays.point_sets["Fixed"]) == 6
    assert len(source.arrays.point_sets["Nall"]) == len(source.points)


def test_lines_that_are_continued(tmp_path: Path) -> None:
    source = parsed(made("continued.inp", tmp_path))
    kinds = [run.type for run in source.cells]
    assert kinds == ["tetra", "triangle", "abaqus:B31", "abaqus:U7", "hexahedron"]
    assert [row.tolist() for row in source.cells[2].vertices] == [[0, 1], [1, 2, 3]]
    assert [row.tolist() for row in source.cells[3].vertices] == [[4, 5, 6, 7, 8], [9]]
    assert sorted(source.arrays.point_sets) == ["HIGH", "LOW"]
    assert sorted(source.arrays.cell_sets) == ["A", "S"]
    np.testing.assert_array_equal(source.arrays.cell["abaqus:section"][1], 1)


@pytest.mark.parametrize("name", FILES)
def test_reversed_cells_read_back(name: str, tmp_path: Path) -> None:
    source = parsed(made(name, tmp_path))
    run = max(
        range(len(source.cells)), key=lambda i: (dimension_of(source.cells[i].type), len(source.cells[i].vertices))
    )
    rows = np.array([0, 3, 7])
    assert source.layout is not None
    back = parsed(source.layout.rewritten(source.points, source.points, turned(source.cells, {run: rows})))
    expected = source.cells[run].vertices.copy()
    expected[rows, :2] = expected[rows, 1::-1]
    np.testing.assert_array_equal(back.cells[run].vertices, expected)
    np.testing.assert_array_equal(back.cells[run].ids, source.cells[run].ids)


def test_numbers_have_twenty_characters() -> None:
    source = parsed(SMALL)
    assert source.layout is not None
    points = source.points.copy()
    points[4] = [-1.2345678901234567e-101, 1 / 3]
    rounded = source.layout.rounded(points)
    data = source.layout.rewritten(source.points, rounded, {})
    written = data.splitlines()[5].split(b", ")
    assert max(map(len, written)) <= 20
    np.testing.assert_array_equal(parsed(data).points, rounded)
    np.testing.assert_allclose(rounded, points, rtol=1e-12)
    assert data.replace(b", ".join(written), b"50, .5, .25") == SMALL


@pytest.mark.parametrize("name", ["cae.inp", "parts.inp"])
def test_truncated(name: str, tmp_path: Path) -> None:
    data = made(name, tmp_path)
    for cut in {*range(3, len(data) - 10, len(data) // 80), len(data) - 4}:
        try:
            assert parse(data[:cut]).notes == ("its last line does not end, as if the file had been cut there",)
        except ReadError:
            continue
        assert data[:cut].rpartition(b"\n")[2].count(b",") == data[:cut].splitlines()[-2].count(b",")


def test_truncated_within_a_line_or_an_element() -> None:
    assert parsed(SMALL[:-1]).notes == ("its last line does not end, as if the file had been cut there",)
    for cut in range(2, 12):
        with pytest.raises(ReadError, match=r"is truncated"):
            parse(SMALL[:-cut])
    with pytest.raises(ReadError, match="the element 2 names the node 50"):
        parse(SMALL.replace(b"50, .5, .25\n", b"").replace(b"1, 1, 2, 50\n", b""))


@pytest.mark.parametrize(
    ("extra", "keyword"),
    [
        (b"*NGEN\n1, 4\n", "NGEN"),
        (b"*NCOPY, OLD SET=A\n", "NCOPY"),
        (b"*nfill\n", "NFILL"),
        (b"*ELGEN\n1, 4\n", "ELGEN"),
        (b"*ELCOPY\n", "ELCOPY"),
        (b"*SYSTEM\n1., 0.\n", "SYSTEM"),
        (b"*NODE, INPUT=nodes.txt\n", "NODE"),
        (b"*NODE, SYSTEM=C\n60, 1., 30.\n", "NODE"),
    ],
)
def test_nodes_that_stand_elsewhere_are_not_passed_over(extra: bytes, keyword: str) -> None:
    with pytest.raises(ReadError, match=rf"uses \*{keyword}"):
        parse(SMALL + extra)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"5 4 0 0 0\n1 0. 0. 0.\n", "not an Abaqus file"),
        (b"** only this\n", "no nodes"),
        (SMALL.replace(b"50, .5", b"4, .5"), "the node 4 is defined twice"),
        (SMALL.replace(b"2, 1., 0.", b"2, 1."), "without all coordinates"),
        (SMALL.replace(b"2, 1., 0.", b"2, , 1., 0."), "without all coordinates"),
        (SMALL.replace(b".25", b"x25"), "line 6: 'x25' is not a number"),
        (SMALL.replace(b"50, .5", b"5o, .5"), "line 6: '5o.* is not an integer"),
        (SMALL.replace(b"TYPE", b"TIPE"), "without TYPE"),
        (SMALL.replace(b"2, 2, 3, 50\n", b"2, 2, 3\n"), "a CPS3 element has not 3 nodes"),
        (SMALL.replace(b"2, 3, 50", b"2, 3,, 50"), "a CPS3 element has not 3 nodes"),
        (SMALL.replace(b"CPS3", b"CPS4"), "a CPS4 element has not 4 nodes"),
        (SMALL.replace(b"4, 1, 50", b"4, 1, 5"), "the element 4 names the node 5, and there is none"),
        (SMALL + b"*ELEMENT, TYPE=SPRINGA\n9, 1, Other-1.2\n", "the element 9 names the node 2"),
        (SMALL + b"*STEP\n*STATIC\n", r"\*STEP without \*END STEP"),
    ],
)
def test_malformed(data: bytes, message: str) -> None:
    with pytest.raises(ReadError, match=message):
        parse(data)


def test_a_section_of_no_set_would_hide_a_material() -> None:
    source = parsed(SMALL + b"*SHELL SECTION, ELSET=Nothing, MATERIAL=M\n")
    with pytest.raises(ReadError, match="names the element set Nothing"):
        source.load()


def test_sets() -> None:
    extra = (
        b"*ELSET, ELSET=odd, GENERATE\n1, 3, 2\n*ELSET, ELSET=Odd\n2, 99\n*ELSET, ELSET=mixed\nODD, 4\n"
        b"*ELSET, ELSET=range, GENERATE\n2, 3\n4, 999999999999\n*NSET, NSET=far, GENERATE\n4, 50\n"
    )
    arrays = parsed(SMALL + extra).arrays
    sets = {name: [run.tolist() for run in runs] for name, runs in arrays.cell_sets.items()}
    assert sets == {"All": [[0, 1, 2, 3]], "odd": [[0, 1, 2]], "mixed": [[0, 1, 2, 3]], "range": [[1, 2, 3]]}
    assert arrays.point_sets["far"].tolist() == [3, 4]
    with pytest.raises(ReadError, match="names the element set NOTHING, and there is none"):
        _ = parsed(SMALL + b"*ELSET, ELSET=odd\n1, nothing\n").arrays


def test_words_may_be_shortened_and_names_have_dots() -> None:
    extra = b"*ELSET, ELS=A.1, GEN\n1, 3\n*ELSET, ELSET=B\nA.1\n*SOLID SECTION, ELS=b, MATERIAL=m\n"
    arrays = parsed(SMALL + extra).arrays
    assert arrays.cell_sets["B"][0].tolist() == [0, 1, 2]
    assert arrays.cell["abaqus:section"][0].tolist() == [1, 1, 1, 0]
    for refused in (b"*NODE, SYS=C\n9, 1., 0.\n", b"*NODE, INP=x.txt\n"):
        with pytest.raises(ReadError, match="which meshfix does not read"):
            parsed(SMALL + refused)


def test_sets_of_elements_are_materials_where_no_section_says_so() -> None:
    deck = SMALL.replace(b"ELSET=All\n", b"ELSET=L\n")
    half = deck.replace(b"3, 3, 4, 50\n", b"*ELEMENT, TYPE=CPS3, ELSET=R\n3, 3, 4, 50\n")
    assert parsed(half).regions == ("abaqus:section",)
    assert np.concatenate(parsed(half).arrays.cell["abaqus:section"]).tolist() == [1, 1, 2, 2]


def test_other_sets_are_materials_where_each_element_is_in_one() -> None:
    for sets, labels in (
        (b"*ELSET, ELSET=L\n1, 2\n*ELSET, ELSET=R\n3, 4\n", [1, 1, 2, 2]),
        (b"*ELSET, ELSET=L\n1, 2\n", [0, 0, 0, 0]),
        (b"*ELSET, ELSET=L\n1, 2\n*ELSET, ELSET=R\n2, 3, 4\n", [0, 0, 0, 0]),
    ):
        assert np.concatenate(parsed(SMALL + sets).arrays.cell["abaqus:section"]).tolist() == labels


def test_elements_whose_faces_are_named_are_not_renumbered() -> None:
    source = parsed(SMALL + b"*SURFACE, TYPE=ELEMENT, NAME=Load\n1, S2\n")
    assert source.layout is not None
    with pytest.raises(ReadError, match="names faces of elements"):
        source.layout.rewritten(source.points, source.points, turned(source.cells, {0: np.array([0])}))


def test_files_may_be_included_by_steps() -> None:
    assert len(parsed(SMALL + b"*STEP\n*INCLUDE, INPUT=loads.inp\n*END STEP\n").points) == 5
    with pytest.raises(ReadError, match=r"includes mesh\.inp, which is beside it"):
        parsed(SMALL + b"*INCLUDE, INPUT=mesh.inp\n")


def test_a_set_may_name_itself() -> None:
    arrays = parsed(SMALL + b"*ELSET, ELSET=A\nAll, A\n" * 60).arrays
    assert arrays.cell_sets["A"][0].tolist() == [0, 1, 2, 3]


def test_a_mark_of_byte_order_and_blanks_before_stars() -> None:
    source = parsed(b"\xef\xbb\xbf" + SMALL.replace(b"*ELEMENT", b"  ** no\n \t*ELEMENT"))
    assert len(source.points) == 5
    assert source.cells[0].vertices.tolist() == [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    assert source.untold == ("comments",)


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("C3D4H", ("tetra", 4)),
        ("DC3D4E", ("tetra", 4)),
        ("AC3D4", ("tetra", 4)),
        ("C3D10MH", ("tetra10", 10)),
        ("C3D8R", ("hexahedron", 8)),
        ("C3D20R", ("hexahedron20", 20)),
        ("C3D15", ("wedge15", 15)),
        ("C3D5", ("pyramid", 5)),
        ("F3D8", ("hexahedron", 8)),
        ("SC8R", ("hexahedron", 8)),
        ("SC6R", ("wedge", 6)),
        ("STRI3", ("triangle", 3)),
        ("S3RT", ("triangle", 3)),
        ("CPEG3H", ("triangle", 3)),
        ("CGAX3", ("triangle", 3)),
        ("DCCAX4", ("quad", 4)),
        ("R3D3", ("triangle", 3)),
        ("DC2D3", ("triangle", 3)),
        ("STRI65", ("triangle6", 6)),
        ("CPS6M", ("triangle6", 6)),
        ("S8R5", ("quad8", 8)),
        ("DS4", ("quad", 4)),
        ("CIN3D8", ("abaqus:CIN3D8", 3)),
        ("C3D27R", ("hexahedron:C3D27R", 3)),
        ("C3D15VH", ("wedge:C3D15VH", 3)),
        ("SPRING1", ("vertex", 1)),
        ("CONN3D2", ("line", 2)),
    ],
)
def test_types(name: str, shape: tuple[str, int]) -> None:
    kind, corners = shape
    row = b", ".join(b"%d" % (1 + i % 4) for i in range(corners))
    source = parsed(SMALL + b"*ELEMENT, TYPE=%b\n77, %b\n" % (name.encode(), row))
    assert source.cells[1].type == kind
    assert source.cells[1].vertices.tolist() == [[i % 4 for i in range(corners)]]


def split_up(folder: Path) -> Path:
    """A file that includes its nodes, the second half of which these include, and its elements; and the whole of it."""
    points, cells = block()
    ids = np.arange(1, len(points) + 1)
    rows = nodes(points, ids).splitlines(keepends=True)
    half, body = len(rows) // 2, elements(cells, ids)
    step = "*STEP\n*INCLUDE, INPUT=loads.inc\n*END STEP\n"
    head, type_ = "** a job\n*NODE, NSET=Nall\n", "*ELEMENT, TYPE=C3D4, ELSET=Eall\n"
    (folder / "whole.inp").write_text(head + "".join(rows) + type_ + body + step)
    (folder / "nodes.inc").write_text("".join(rows[:half]) + '*Include, Input="more nodes.inc"\n** the end\n')
    (folder / "more nodes.inc").write_text("*NODE, NSET=Nall\n" + "".join(rows[half:]).rstrip("\n"))
    (folder / "job_elements.inc").write_text(type_ + body)
    included = "*INCLUDE,INPUT=nodes.inc\n*include, input = job_elements.inc\n"
    (folder / "nodes.inc").write_text(head + (folder / "nodes.inc").read_text())
    (folder / "job.inp").write_text(included + step)
    return folder / "job.inp"


def test_files_that_are_included_are_written_back_one_by_one(tmp_path: Path) -> None:
    path = split_up(tmp_path)
    before = {one.name: one.read_bytes() for one in tmp_path.iterdir()}
    whole, document = read(tmp_path / "whole.inp"), read(path)
    np.testing.assert_array_equal(document.source.points, whole.source.points)
    np.testing.assert_array_equal(document.source.cells[0].vertices, whole.source.cells[0].vertices)
    (tmp_path / "there").mkdir()
    result = untangle(document.mesh).after
    write(document, result, tmp_path / "there" / "out.inp")
    assert {one.name for one in (tmp_path / "there").iterdir()} == {
        "out.inp", "out_nodes.inc", "out_more nodes.inc", "out_elements.inc",
    }  # fmt: skip
    back = read(tmp_path / "there" / "out.inp")
    np.testing.assert_array_equal(back.source.points, document.file_points(result))
    main = before["job.inp"].replace(b"=nodes.inc", b"=out_nodes.inc").replace(b"job_elements.inc", b"out_elements.inc")
    assert (tmp_path / "there" / "out.inp").read_bytes() == main
    assert b'Input="out_more nodes.inc"\n' in (tmp_path / "there" / "out_nodes.inc").read_bytes()
    assert (tmp_path / "there" / "out_elements.inc").read_bytes() == before["job_elements.inc"]
    write(document, result, path)
    after = {one.name: one.read_bytes() for one in tmp_path.iterdir() if one.is_file()}
    assert {name for name in before if before[name] != after[name]} == {"nodes.inc", "more nodes.inc"}
    assert not after["more nodes.inc"].endswith(b"\n")


def test_what_is_included_must_be_there(tmp_path: Path) -> None:
    path = split_up(tmp_path)
    (tmp_path / "more nodes.inc").rename(tmp_path / "elsewhere")
    with pytest.raises(ReadError, match=r"includes more nodes\.inc: No such file"):
        read(path)
    (tmp_path / "more nodes.inc").write_bytes(b"*INCLUDE, INPUT=nodes.inc\n")
    with pytest.raises(ReadError, match=r"includes nodes\.inc twice"):
        read(path)
    path.write_bytes(SMALL + b"*INCLUDE\n")
    with pytest.raises(ReadError, match=r"uses \*INCLUDE without INPUT="):
        read(path)
