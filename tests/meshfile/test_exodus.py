"""Exodus files in each form of netCDF: elements, blocks, sets and fields, as other programs read them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_exodus import COMPRESSED, FILES, halves, read_independently, solid, tables, text, with_library, with_scipy
from shapes import block, plate
from splicing import repaired

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile import exodus, netcdf
from meshfix_cli.meshfile.exodus.types import key_of
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.meshfile.source import Source

ALL = {**FILES, **COMPRESSED}
CLASSIC = [name for name in FILES if not name.startswith(("hdf5", "chunks"))]
TETRAHEDRON = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])


def made(name: str, folder: Path) -> bytes:
    ALL[name](folder / name)
    return (folder / name).read_bytes()


def written(path: Path, points: np.ndarray, blocks: list[tuple[str, np.ndarray]], **extra: Any) -> Source:
    with_scipy(path, *tables(points, blocks, **extra), version=2)
    return exodus.parse(path.read_bytes())


def with_vtk(path: Path) -> Any:
    """VTK's reader of a file, with all of its sets."""
    module = pytest.importorskip("vtkmodules.vtkIOExodus")
    reader = module.vtkExodusIIReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    for kind in (reader.ELEM_BLOCK, reader.SIDE_SET, reader.NODE_SET):
        for i in range(reader.GetNumberOfObjects(kind)):
            reader.SetObjectStatus(kind, i, 1)
    reader.Update()
    return reader


def grids(reader: Any, kind: int) -> dict[str, Any]:
    """What it makes of the blocks or sets of a kind."""
    order = ("ELEM_BLOCK", "FACE_BLOCK", "EDGE_BLOCK", "ELEM_SET", "SIDE_SET", "FACE_SET", "EDGE_SET", "NODE_SET")
    found = reader.GetOutput().GetBlock([getattr(reader, name) for name in order].index(kind))
    return {reader.GetObjectName(kind, i): found.GetBlock(i) for i in range(found.GetNumberOfBlocks())}


def positions(grid: Any) -> np.ndarray:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return vtk_to_numpy(grid.GetPoints().GetData())


@pytest.mark.parametrize("name", ALL)
def test_points_cells_and_numbers_are_those_of_the_other_reader(name: str, tmp_path: Path) -> None:
    source = exodus.parse(made(name, tmp_path))
    points, rest = read_independently(tmp_path / name)
    np.testing.assert_array_equal(source.points, points[:, : source.points.shape[1]])
    assert source.points.dtype == points.dtype
    values, first = rest["values"], 0
    for i, run in enumerate(source.cells):
        np.testing.assert_array_equal(run.vertices + 1, values[f"connect{i + 1}"])
        expected = values.get("elem_num_map", np.arange(1, 10**4))[first : first + len(run.vertices)]
        np.testing.assert_array_equal(run.ids, expected)
        assert (source.arrays.cell["exodus:block"][i] == values["eb_prop1"][i]).all()
        first += len(run.vertices)
    assert source.regions == ("exodus:block",)


@pytest.mark.parametrize("name", ALL)
def test_reversed_cells_read_back(name: str, tmp_path: Path) -> None:
    source, rows = exodus.parse(made(name, tmp_path)), np.array([0, 3, 7])
    assert source.layout is not None
    run = len(source.cells) - 1
    back = exodus.parse(source.layout.rewritten(source.points, source.points, turned(source.cells, {run: rows})))
    expected = source.cells[run].vertices.copy()
    expected[rows, :2] = expected[rows, 1::-1]
    np.testing.assert_array_equal(back.cells[run].vertices, expected)


@pytest.mark.parametrize("name", COMPRESSED)
def test_what_is_compressed_keeps_all_but_coordinates(name: str, tmp_path: Path) -> None:
    made(name, tmp_path)
    _, points = repaired(tmp_path / name, tmp_path / "out.e")
    (_, before), (after, others) = read_independently(tmp_path / name), read_independently(tmp_path / "out.e")
    np.testing.assert_equal(others, before)
    np.testing.assert_array_equal(after, points)


@pytest.mark.parametrize("name", CLASSIC)
def test_truncated(name: str, tmp_path: Path) -> None:
    data = made(name, tmp_path)
    for cut in {*range(4, len(data) - 4, len(data) // 60), 40, 41, 42, len(data) - 4}:
        with pytest.raises(ReadError, match=r"is truncated|is not a readable netCDF file"):
            exodus.parse(data[:cut])


@pytest.mark.parametrize("number", [0x7FFFFFFF, 0xFFFFFFFF])
def test_announced_counts_are_not_believed(number: int, tmp_path: Path) -> None:
    data = made("cubit.exo", tmp_path)
    for at in range(4, 400, 4):
        broken = data[:at] + number.to_bytes(4, "big") + data[at + 4 :]
        try:
            exodus.parse(broken)
        except ReadError as error:
            assert "\n" not in str(error)
    with pytest.raises(ReadError, match="is truncated: its header announces more than it holds"):
        netcdf.parse(data[:12] + number.to_bytes(4, "big") + data[16:])


def test_records_without_gaps(tmp_path: Path) -> None:
    """Where one variable alone has records, and its numbers are short, these are not filled up to four bytes."""
    from scipy.io import netcdf_file

    with netcdf_file(tmp_path / "a.nc", "w") as file:
        file.createDimension("t", None)
        file.createDimension("x", 3)
        one = file.createVariable("short", "i2", ("t", "x"))
        for i in range(4):
            one[i] = [i, i + 1, -i]
    found = netcdf.parse((tmp_path / "a.nc").read_bytes())["short"]
    assert found.values().tolist() == [[i, i + 1, -i] for i in range(4)]
    assert found.last().tolist() == [3, 4, -3]


def test_a_stream_of_records_has_those_that_are_there(tmp_path: Path) -> None:
    data = made("results.e", tmp_path)
    streamed = data[:4] + b"\xff" * 4 + data[8:]
    assert netcdf.parse(streamed)["time_whole"].values().tolist() == [0.0, 0.5, 2.0]


def test_offsets_are_those_of_values(tmp_path: Path) -> None:
    data = made("results.e", tmp_path)
    for one in netcdf.parse(data).values():
        raw = np.frombuffer(data, np.uint8)[one.offsets().ravel()[:, None] + np.arange(one.dtype.itemsize)]
        np.testing.assert_array_equal(raw.copy().view(one.dtype).ravel(), one.values().ravel().astype(one.dtype))


@pytest.mark.parametrize("kind", ["TET", "TET4", "TETRA", "TETRA4", "tetra", "Tetra4", "SOLID_TET_4_3D"])
def test_names_of_tetrahedra(kind: str, tmp_path: Path) -> None:
    points, cells = block()
    source = written(tmp_path / "a.e", points, [(kind, cells)])
    assert [run.type for run in source.cells] == ["tetra"]


@pytest.mark.parametrize(
    ("name", "nodes", "dimension", "key"),
    [
        ("TRI", 3, 2, "triangle"), ("TRI3", 3, 2, "triangle"), ("TRIANGLE", 3, 3, "triangle"),
        ("TRISHELL3", 3, 3, "triangle"), ("SHELL3", 3, 3, "triangle"), ("tri6", 6, 2, "triangle6"),
        ("QUAD", 4, 2, "quad"), ("SHELL", 4, 3, "quad"), ("SHELL4", 4, 3, "quad"), ("SHELL8", 8, 3, "quad8"),
        ("QUAD9", 9, 2, "quad9"), ("SHELL", 2, 2, "line"), ("SHELL", 3, 2, "line3"), ("HEX", 8, 3, "hexahedron"),
        ("hex8", 8, 3, "hexahedron"), ("HEX", 20, 3, "hexahedron20"), ("HEX27", 27, 3, "hexahedron27"),
        ("WEDGE", 6, 3, "wedge"), ("WEDGE", 21, 3, "wedge_of_21"), ("PYRAMID5", 5, 3, "pyramid"),
        ("PYRA", 13, 3, "pyramid13"), ("TETRA", 10, 3, "tetra10"), ("TETRA", 11, 3, "tetra_of_11"),
        ("BAR", 2, 3, "line"),
        ("BEAM2", 2, 3, "line"), ("TRUSS", 3, 3, "line3"), ("EDGE", 2, 2, "line"), ("SPHERE", 1, 3, "vertex"),
        ("CIRCLE", 1, 2, "vertex"),
    ],
)  # fmt: skip
def test_names_and_numbers_of_nodes(name: str, nodes: int, dimension: int, key: str) -> None:
    assert key_of(name, nodes, dimension) == key


def test_names_that_are_not_known(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="has elements called 'BLOB', which are not known"):
        written(tmp_path / "a.e", TETRAHEDRON, [("BLOB", np.array([[0, 1, 2, 3]]))])
    with pytest.raises(ReadError, match="its HEX elements have 4 nodes"):
        written(tmp_path / "b.e", TETRAHEDRON, [("HEX", np.array([[0, 1, 2, 3]]))])


@pytest.mark.parametrize(
    ("name", "nodes"),
    [
        ("TRI", 3), ("TRI", 6), ("QUAD", 4), ("QUAD", 8), ("QUAD", 9), ("TETRA", 4), ("TETRA", 10), ("PYRAMID", 5),
        ("PYRAMID", 13), ("WEDGE", 6), ("WEDGE", 15), ("WEDGE", 18), ("HEX", 8), ("HEX", 20), ("HEX", 27),
    ],
)  # fmt: skip
def test_order_of_nodes_and_sides_is_that_of_vtk(name: str, nodes: int, tmp_path: Path) -> None:
    """VTK reads an element of its own order; and of each side set it makes faces, whose points are compared."""
    dimension = 2 if name in ("TRI", "QUAD") else 3
    points = np.random.default_rng(nodes).integers(0, 1000, (nodes, dimension)).astype(float)
    key = key_of(name, nodes, dimension)
    sides = len(ELEMENTS[key].shape.facets)
    sets = {"ss_prop1": (("num_side_sets",), np.arange(1, sides + 1, dtype="i4"))}
    for i in range(1, sides + 1):
        sets |= {
            f"{what}_ss{i}": ((f"num_side_ss{i}",), np.array([n], dtype="i4")) for what, n in (("elem", 1), ("side", i))
        }
    source = written(tmp_path / "a.e", points, [(name, np.arange(nodes)[None])], **sets)
    assert source.cells[0].type == key
    reader = with_vtk(tmp_path / "a.e")
    (cell,) = (grid.GetCell(0) for grid in grids(reader, reader.ELEM_BLOCK).values())
    expected = np.array([cell.GetPoints().GetPoint(i) for i in range(cell.GetNumberOfPoints())])[:, :dimension]
    np.testing.assert_array_equal(source.points[source.cells[0].vertices[0]], expected)
    assert cell.GetCellType() == ELEMENTS[key].vtk
    found = grids(reader, reader.SIDE_SET)
    assert len(found) == sides
    for mine, grid in zip(source.arrays.point_sets.values(), found.values(), strict=True):
        theirs = np.unique(positions(grid)[:, :dimension], axis=0)
        np.testing.assert_array_equal(np.unique(source.points[mine], axis=0), theirs)


@pytest.mark.parametrize(("name", "nodes"), [("SHELL4", 4), ("TRISHELL3", 3), ("SHELL8", 8)])
def test_sides_of_shells(name: str, nodes: int, tmp_path: Path) -> None:
    points = np.random.default_rng(nodes).integers(0, 1000, (nodes, 3)).astype(float)
    corners = 3 if nodes == 3 else 4
    for side in range(1, corners + 3):
        sets: Any = {
            "ss_prop1": (("num_side_sets",), np.array([1], dtype="i4")),
            "elem_ss1": (("num_side_ss1",), np.array([1], dtype="i4")),
            "side_ss1": (("num_side_ss1",), np.array([side], dtype="i4")),
        }
        source = written(tmp_path / f"{side}.e", points, [(name, np.arange(nodes)[None])], **sets)
        reader = with_vtk(tmp_path / f"{side}.e")
        (grid,) = grids(reader, reader.SIDE_SET).values()
        mine = source.points[source.arrays.point_sets["surface_1"]]
        np.testing.assert_array_equal(np.unique(mine, axis=0), np.unique(positions(grid), axis=0))


def test_sets_by_name_and_number(tmp_path: Path) -> None:
    source = exodus.parse(made("cubit.exo", tmp_path))
    sets = source.arrays.point_sets
    first, second = (run.vertices for run in source.cells)
    expected = np.unique([*first[0, [0, 2, 1]], *second[0, [1, 2, 3]]])
    assert {name: rows.tolist() for name, rows in sets.items()} == {
        "fixed": [0, 4, 5], "nodelist_5": [1], "surface_9": expected.tolist(),
    }  # fmt: skip
    assert source.arrays.groups == {"steel": [10, 3], "block_11": [11, 3]}
    blocks = [[np.unique(run.vertices).tolist()] for run in source.cells]
    assert [[groups_of(source)[name].points.tolist()] for name in ("steel", "block_11")] == blocks


def test_sets_of_one_name_are_one(tmp_path: Path) -> None:
    table, types = solid()
    table["ss_names"] = (("num_side_sets", "len_name"), text("", "fixed"))
    table["els_prop1"] = (("num_elem_sets",), np.array([6], dtype="i4"))
    table["elem_els1"] = (("num_ele_els1",), np.array([2, 1], dtype="i4"))
    with_scipy(tmp_path / "a.e", table, types, version=2)
    source = exodus.parse((tmp_path / "a.e").read_bytes())
    assert {0, 4, 5} < set(source.arrays.point_sets["fixed"].tolist())
    assert [rows.tolist() for rows in source.arrays.cell_sets["elementset_6"]] == [[0, 1], []]


def test_sides_that_are_not_there_are_none(tmp_path: Path) -> None:
    table, types = solid()
    table["elem_ss2"] = (("num_side_ss2",), np.array([0, 10**6], dtype="i4"))
    with_scipy(tmp_path / "a.e", table, types, version=2)
    assert exodus.parse((tmp_path / "a.e").read_bytes()).arrays.point_sets["surface_9"].size == 0
    table["side_ss2"] = (("other",), np.array([0], dtype="i4"))
    with_scipy(tmp_path / "b.e", table, types, version=2)
    with pytest.raises(ReadError, match="'surface_9' has elements without sides"):
        _ = exodus.parse((tmp_path / "b.e").read_bytes()).arrays


def test_fields_are_those_of_the_last_step(tmp_path: Path) -> None:
    arrays = exodus.parse(made("results.e", tmp_path)).arrays
    n, m = len(block()[0]), len(halves(*block())[0])
    np.testing.assert_array_equal(arrays.point["load"], np.arange(2.0 * n, 3.0 * n))
    assert set(arrays.point) == {"load", "flag"}
    np.testing.assert_array_equal(arrays.cell["stress"][0], np.arange(2.0 * m, 3.0 * m))
    assert np.isnan(arrays.cell["stress"][1]).all()


def test_blocks_hold_their_interface(tmp_path: Path) -> None:
    points, cells = plate()
    right = points[cells].mean(axis=1)[:, 0] > 1
    with_scipy(tmp_path / "a.e", *tables(points[:, :2], [("TRI", cells[~right]), ("TRI", cells[right])]), version=1)
    assert read(tmp_path / "a.e").fixed["between regions of exodus:block"] > 0


def test_empty_blocks_and_numbers_of_blocks(tmp_path: Path) -> None:
    """A block without elements has no table, but a number and a name."""
    points, cells = block()
    table, types = tables(points, [("TETRA", cells)])
    table["connect2"] = table.pop("connect1")
    table["eb_prop1"] = (("num_el_blk",), np.array([3, 70, 5], dtype="i4"))
    table["eb_names"] = (("num_el_blk", "len_name"), text("void", "copper", "none"))
    with_scipy(tmp_path / "a.e", table, {"connect2": types["connect1"]}, version=2)
    source = exodus.parse((tmp_path / "a.e").read_bytes())
    assert set(source.arrays.cell["exodus:block"][0].tolist()) == {70}
    assert source.arrays.groups == {"copper": [70, 3]}


def test_polygons_are_what_they_are(tmp_path: Path) -> None:
    """Those of three and four nodes are solved for, others are held; each has its number."""
    points = np.array([[0.0, 0], [1, 0], [2, 0], [2, 1], [1.5, 1.5], [1, 1], [0, 1]])
    table, types = tables(points, [("nsided", np.array([[0, 1, 5, 6, 1, 2, 3, 4, 5, 0, 1, 6]]).T)])
    table["connect1"] = (("num_nod_per_el1",), table["connect1"][1].ravel())
    table["ebepecnt1"] = (("num_el_in_blk1",), np.array([4, 5, 3], dtype="i4"))
    with_scipy(tmp_path / "a.e", table, types, version=2)
    source = exodus.parse((tmp_path / "a.e").read_bytes())
    found = {run.type: (run.vertices.tolist(), None if run.ids is None else run.ids.tolist()) for run in source.cells}
    assert found == {
        "triangle": ([[0, 1, 6]], [3]), "quad": ([[0, 1, 5, 6]], [1]), "polygon": ([[1, 2, 3, 4, 5]], [2]),
    }  # fmt: skip
    assert source.layout is not None
    cells = turned(source.cells, {1: np.array([0])})
    back = exodus.parse(source.layout.rewritten(source.points, source.points, cells))
    assert back.cells[1].vertices.tolist() == [[1, 0, 6, 5]]


def test_polyhedra_are_held(tmp_path: Path) -> None:
    cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    table, types = tables(np.concatenate([cube, [[2.0, 0, 0]]]), [("TETRA", np.array([[1, 8, 3, 5]]))])
    table |= {
        "facconn2": (("num_fac_per_el2",), np.arange(1, 7, dtype="i4")),
        "ebepecnt2": (("num_el_in_blk2",), np.array([6], dtype="i4")),
        "fbconn1": (("num_nod_per_fa1",), np.ravel(faces).astype("i4") + 1),
        "fbepecnt1": (("num_fa_in_blk1",), np.full(6, 4, dtype="i4")),
    }
    with_scipy(tmp_path / "a.e", table, {**types, "facconn2": "nfaced"}, version=2)
    document = read(tmp_path / "a.e")
    assert document.not_judged == {"polyhedron": 1}
    assert np.unique(document.source.cells[1].vertices[0]).tolist() == list(range(8))
    table["facconn2"] = (("num_fac_per_el2",), np.arange(2, 8, dtype="i4"))
    with_scipy(tmp_path / "b.e", table, {**types, "facconn2": "nfaced"}, version=2)
    with pytest.raises(ReadError, match="an element has a face that is not there"):
        read(tmp_path / "b.e")


def test_what_is_no_mesh(tmp_path: Path) -> None:
    with_scipy(tmp_path / "a.nc", {"temperature": (("x",), np.ones(3))}, {}, version=1)
    with pytest.raises(ReadError, match="is a file of netCDF, and no mesh of Exodus: it has no coordinates"):
        read(tmp_path / "a.nc")
    table, types = solid()
    table["coordy"] = (("other",), np.ones(3))
    with_scipy(tmp_path / "b.e", table, types, version=1)
    with pytest.raises(ReadError, match="its coordinates are not as many as its nodes"):
        read(tmp_path / "b.e")
    table["coordy"] = (("num_nodes",), np.ones(len(block()[0]), dtype="f4"))
    with_scipy(tmp_path / "c.e", table, types, version=1)
    with pytest.raises(ReadError, match="its coordinates are not all of single or of double precision"):
        read(tmp_path / "c.e")


def test_a_piece_of_a_decomposition_is_read_alone(tmp_path: Path) -> None:
    (tmp_path / "mesh.e.4.0").write_bytes(made("cubit.exo", tmp_path))
    document = read(tmp_path / "mesh.e.4.0")
    assert document.format.name == "exodus"
    repaired(tmp_path / "mesh.e.4.0", tmp_path / "fixed.e.4.0")
    assert read(tmp_path / "fixed.e.4.0").mesh.check()[0] == 0


def test_both_libraries_of_netcdf_agree(tmp_path: Path) -> None:
    table, types = solid()
    with_library(tmp_path / "a.e", table, types, "NETCDF3_CLASSIC")
    with_scipy(tmp_path / "b.e", table, types, version=1)
    one, other = (exodus.parse((tmp_path / name).read_bytes()) for name in ("a.e", "b.e"))
    np.testing.assert_array_equal(one.points, other.points)
    assert one.arrays.point_sets.keys() == other.arrays.point_sets.keys()
