"""CGNS files: zones that are blocks of points and such that have sections, and how they are joined and written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_cgns import FILES, base, condition, interface, node, numbers_of, read_independently, section, tree, zone
from shapes import block, plate
from splicing import repaired

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, dimension_of
from meshfix_cli.meshfile import cgns
from meshfix_cli.meshfile.cgns.types import TYPES
from meshfix_cli.meshfile.sliding import slid
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.meshfile.source import Source

pytest.importorskip("h5py")
# VTK's reader crashes on lines and vertices, and gives no pyramids of 13 nodes.
KNOWN = {n: key for n, (key, _) in TYPES.items() if key in ELEMENTS and ELEMENTS[key].vtk and key != "pyramid13"}
COMPARED = [n for n, key in KNOWN.items() if dimension_of(key) > 1]
RIGHT = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])


def parsed(path: Path, fill: Callable[[Any], None] | None = None) -> Source:
    if fill is not None:
        tree(path, fill)
    source = cgns.parse(path.read_bytes())
    assert source is not None
    return source


def box(shape: Sequence[int], low: Sequence[float] = (0, 0, 0), step: float = 1.0) -> np.ndarray:
    """The points of a block, the first index fastest."""
    axes = [first + step * np.arange(n) for first, n in zip(low, shape, strict=False)]
    return np.stack([one.ravel("F") for one in np.meshgrid(*axes, indexing="ij")], axis=1)


def ring(around: int, across: int) -> np.ndarray:
    """An O-grid: the last points around are where the first are."""
    angles = np.arange(around) % (around - 1) * 2 * np.pi / (around - 1)
    radii = 1.0 + np.arange(across)
    points = np.array([[r * np.cos(a), r * np.sin(a)] for r in radii for a in angles])
    return points.reshape(-1, 2)


@pytest.mark.parametrize("name", FILES)
def test_points_and_cells_are_those_of_the_other_reader(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    source = parsed(tmp_path / name)
    points, rest = read_independently(tmp_path / name)
    np.testing.assert_array_equal(source.points, points[:, : source.points.shape[1]])
    assert source.points.dtype == points.dtype
    found = np.concatenate([run.vertices.ravel() for run in source.cells])
    if name == "two_zones.cgns":
        expected = [np.array(block()[0][block()[1]])]
        corners = np.sort(source.points[found].reshape(-1, 12), axis=0)
        np.testing.assert_array_equal(corners, np.sort(np.concatenate(expected).reshape(-1, 12), axis=0))
    elif name == "mixed.cgns":
        numbers, starts = numbers_of(rest, "ElementConnectivity"), numbers_of(rest, "ElementStartOffset")
        for run in source.cells:
            assert run.ids is not None
            for row, number in zip(run.vertices.tolist(), run.ids.tolist(), strict=True):
                begin, end = starts[number - 1 : number + 1]
                assert numbers[begin:end].tolist() == [5 if len(row) == 3 else 10, *(v + 1 for v in row)]
    else:
        nodes = [values.ravel() for path, values in rest.items() if path.endswith("ElementConnectivity/ data")]
        np.testing.assert_array_equal(np.sort(np.concatenate(nodes)), np.sort(found + 1))


@pytest.mark.parametrize("name", FILES)
def test_reversed_cells_read_back(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    source, rows = parsed(tmp_path / name), np.array([0, 3, 7])
    kinds = [run.type for run in source.cells]
    run = kinds.index("tetra" if "tetra" in kinds else "triangle")
    assert source.layout is not None
    (tmp_path / "b.cgns").write_bytes(
        source.layout.rewritten(source.points, source.points, turned(source.cells, {run: rows}))
    )
    expected = source.cells[run].vertices.copy()
    expected[rows, :2] = expected[rows, 1::-1]
    np.testing.assert_array_equal(parsed(tmp_path / "b.cgns").cells[run].vertices, expected)


def test_each_copy_of_a_point_is_written(tmp_path: Path) -> None:
    FILES["two_zones.cgns"](tmp_path / "a.cgns")
    document, _ = repaired(tmp_path / "a.cgns", tmp_path / "b.cgns")
    assert any("joined 2 zones at" in note for note in document.notes)
    whole, after = block()[0], read(tmp_path / "b.cgns")
    assert len(document.source.points) == len(after.source.points) == len(whole)
    assert len(read_independently(tmp_path / "b.cgns")[0]) == len(whole)


@pytest.mark.parametrize("number", COMPARED)
def test_order_of_nodes_is_that_of_vtk(number: int, tmp_path: Path) -> None:
    module = pytest.importorskip("vtkmodules.vtkIOCGNSReader")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    key, nodes = TYPES[number]
    points = np.random.default_rng(number).integers(0, 1000, (nodes, 3)).astype(float)

    def fill(file: Any) -> None:
        found = zone(base(file, dimension_of(key)), "zone", points, cells=1)
        section(found, "one", number, 1, np.arange(1, nodes + 1)[None])

    source = parsed(tmp_path / "a.cgns", fill)
    reader = module.vtkCGNSReader()
    reader.SetFileName(str(tmp_path / "a.cgns"))
    reader.Update()
    output = reader.GetOutput()
    while not hasattr(output, "GetCell"):
        output = output.GetBlock(0)
    cell = output.GetCell(0)
    theirs = [cell.GetPointId(i) for i in range(cell.GetNumberOfPoints())]
    assert cell.GetCellType() == ELEMENTS[key].vtk
    corners = vtk_to_numpy(output.GetPoints().GetData())[theirs]
    np.testing.assert_array_equal(source.points[source.cells[0].vertices[0]], corners)


def test_blocks_of_points_are_those_of_vtk(tmp_path: Path) -> None:
    """VTK has the cells of a structured grid in an order of its own: each is compared by its corners."""
    module = pytest.importorskip("vtkmodules.vtkIOCGNSReader")
    shape = (3, 4, 2)
    source = parsed(tmp_path / "a.cgns", lambda file: zone(base(file, 3), "zone", box(shape), shape) and None)
    reader = module.vtkCGNSReader()
    reader.SetFileName(str(tmp_path / "a.cgns"))
    reader.Update()
    output = reader.GetOutput()
    while not hasattr(output, "GetCell"):
        output = output.GetBlock(0)
    (run,) = source.cells
    assert run.type == "hexahedron"
    assert len(run.vertices) == output.GetNumberOfCells() == 6
    for i, row in enumerate(run.vertices.tolist()):
        cell = output.GetCell(i)
        theirs = [output.GetPoint(cell.GetPointId(k)) for k in range(8)]
        np.testing.assert_array_equal(source.points[row], theirs)


def two_blocks(file: Any, *, told: bool, points: np.ndarray, mirrored: bool = False) -> None:
    """Two blocks of 4 x 4 x 4 points, of which the second begins where the first ends."""
    parent = base(file, 3)
    first = zone(parent, "left", points, (4, 4, 4))
    right = box((4, 4, 4), (3, 0, 0)).reshape(4, 4, 4, 3)  # k, j, i
    second = zone(parent, "right", (right[:, :, ::-1] if mirrored else right).reshape(-1, 3), (4, 4, 4))
    if told:
        ends = ([[4, 1, 1], [4, 4, 4]], [[4, 1, 1], [4, 4, 4]] if mirrored else [[1, 1, 1], [1, 4, 4]])
        interface(first, "to right", "right", *ends, (-1 if mirrored else 1, 2, 3))
        interface(second, "to left", "left", *ends[::-1], (-1 if mirrored else 1, 2, 3))


@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize("mirrored", [True, False])
def test_blocks_are_joined(told: bool, mirrored: bool, tmp_path: Path) -> None:
    """A tangled point inside of one, and one block may be numbered the other way round."""
    points = box((4, 4, 4))
    points[21] = [2.6, 1, 1]  # that at (1, 1, 1)
    tree(tmp_path / "a.cgns", lambda file: two_blocks(file, told=told, points=points, mirrored=mirrored))
    document = read(tmp_path / "a.cgns")
    assert len(document.mesh.points) == 7 * 4 * 4
    assert document.mesh.movable.sum() == 5 * 2 * 2
    assert not document.mesh.topology.misnumbered.any()
    assert document.mesh.check()[0] > 0
    result, dropped = write(document, untangle(document.mesh).after, tmp_path / "b.cgns")
    assert (result.check()[0], dropped) == (0, ())
    assert read(tmp_path / "b.cgns").mesh.check()[0] == 0


def test_an_interface_with_a_period_joins_nothing(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        found = zone(base(file, 3), "zone", box((4, 4, 4)), (4, 4, 4))
        one = interface(found, "around", "zone", [[1, 1, 1], [1, 4, 4]], [[4, 1, 1], [4, 4, 4]], (1, 2, 3))
        node(node(one, "GridConnectivityProperty", "GridConnectivityProperty_t"), "Periodic", "Periodic_t")

    assert len(parsed(tmp_path / "a.cgns", fill).points) == 64

    def without(file: Any) -> None:
        found = zone(base(file, 3), "zone", box((4, 4, 4)), (4, 4, 4))
        interface(found, "around", "zone", [[1, 1, 1], [1, 4, 4]], [[4, 1, 1], [4, 4, 4]], (1, 2, 3))

    assert len(parsed(tmp_path / "b.cgns", without).points) == 64


@pytest.mark.parametrize("told", [True, False])
def test_a_grid_around_is_joined_to_itself(told: bool, tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        found = zone(base(file, 2, 2), "ring", ring(9, 4), (9, 4))
        if told:
            interface(found, "cut", "ring", [[1, 1], [1, 4]], [[9, 1], [9, 4]], (1, 2))

    source = parsed(tmp_path / "a.cgns", fill)
    assert len(source.points) == 8 * 4
    document = read(tmp_path / "a.cgns")
    assert document.mesh.check()[0] == 0
    assert document.mesh.movable.sum() == 8 * 2
    moved = document.mesh.points.copy()
    moved[8] += 0.05  # a point of the cut, inside
    write(document, document.mesh.with_points(moved), tmp_path / "b.cgns")
    assert len(read_independently(tmp_path / "b.cgns")[0]) == 8 * 4


def test_a_baffle_keeps_its_place(tmp_path: Path) -> None:
    """What a boundary condition names is held, also where its two sides are joined as they lie on one another."""

    def fill(file: Any) -> None:
        condition(zone(base(file, 2, 2), "ring", ring(9, 4), (9, 4)), "plate", box=[[1, 2], [1, 3]])

    assert read(_made(tmp_path / "a.cgns", fill)).mesh.movable.sum() == 8 * 2 - 2


def _made(path: Path, fill: Callable[[Any], None]) -> Path:
    tree(path, fill)
    return path


@pytest.mark.parametrize("told", [True, False])
def test_a_pole_is_one_point(told: bool, tmp_path: Path) -> None:
    """Of the cells at it two corners are one: they are triangles, and wedges in space."""
    points = box((3, 3))
    points[:3] = points[1]

    def fill(file: Any) -> None:
        found = zone(base(file, 2, 2), "fan", points, (3, 3))
        if told:
            interface(found, "none", "fan", [[1, 2], [1, 2]], [[1, 2], [1, 2]], (1, 2))

    tree(tmp_path / "a.cgns", fill)
    assert len(read(tmp_path / "a.cgns").mesh.points) == 7
    assert read(tmp_path / "a.cgns").mesh.check()[0] == 0


def test_points_that_an_interface_lists(tmp_path: Path) -> None:
    """Zones of tetrahedra with a point list, of which one point lies elsewhere: that is not joined."""

    def fill(file: Any) -> None:
        parent = base(file, 3)
        first = zone(parent, "a", RIGHT[:4], cells=1)
        section(first, "tets", 10, 1, np.array([[1, 2, 3, 4]]))
        second = zone(parent, "b", np.concatenate([RIGHT[1:], [[5.0, 5, 5]]]), cells=1)
        section(second, "tets", 10, 1, np.array([[1, 2, 3, 4]]))
        table = node(first, "ZoneGridConnectivity", "ZoneGridConnectivity_t")
        one = node(table, "face", "GridConnectivity_t", "b")
        node(one, "GridConnectivityType", "GridConnectivityType_t", "Abutting1to1")
        node(one, "PointList", "IndexArray_t", np.array([[2], [3], [1]], dtype=np.int32))
        node(one, "PointListDonor", "IndexArray_t", np.array([[1], [2], [5]], dtype=np.int32))

    assert len(parsed(tmp_path / "a.cgns", fill).points) == 9 - 2


def test_boundary_conditions_by_name_and_family(tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        found = zone(base(file, 3), "zone", box((3, 3, 3)), (3, 3, 3))
        condition(found, "low", box=[[1, 1, 1], [3, 3, 1]], family="wall")
        condition(found, "high", box=[[3, 3, 3], [1, 1, 3]], family="wall")
        condition(found, "corner", points=[[1, 1, 1], [3, 3, 3]])
        condition(found, "faces", box=[[1, 1, 1], [1, 2, 1]], at="IFaceCenter")

    sets = parsed(tmp_path / "a.cgns", fill).arrays.point_sets
    low, high = list(range(9)), list(range(18, 27))
    assert {name: rows.tolist() for name, rows in sets.items()} == {
        "low": low, "high": high, "wall": low + high, "corner": [0, 26], "faces": [0, 3, 6, 9, 12, 15],
    }  # fmt: skip


def test_what_is_said_of_cells_are_regions(tmp_path: Path) -> None:
    """gmsh writes its volumes in the way of boundary conditions."""
    points, cells = plate()
    right = points[cells].mean(axis=1)[:, 0] > 1
    ordered = np.concatenate([cells[right], cells[~right]])
    count = int(right.sum())

    def fill(file: Any) -> None:
        found = zone(base(file, 2), "zone", points, cells=len(cells))
        section(found, "all", 5, 1, ordered + 1)
        condition(found, "r", box=[[1], [count]], at="CellCenter", family="right")
        condition(found, "l", points=[[i] for i in range(count + 1, len(cells) + 1)], at="CellCenter", family="left")

    tree(tmp_path / "a.cgns", fill)
    document = read(tmp_path / "a.cgns")
    assert document.fixed["between regions of cgns:family"] > 0
    assert document.source.arrays.groups == {"right": [1, 2], "left": [2, 2]}
    assert document.source.arrays.point_sets == {}
    assert [rows.tolist() for rows in document.source.arrays.cell_sets["all"]] == [list(range(len(cells)))]


@pytest.mark.parametrize("families", [("a", "a"), ("a", "b")])
def test_zones_of_several_families_are_regions(families: tuple[str, str], tmp_path: Path) -> None:
    def fill(file: Any) -> None:
        two_blocks(file, told=True, points=box((4, 4, 4)))
        for name, family in zip(("left", "right"), families, strict=True):
            node(file["Base"][name], "FamilyName", "FamilyName_t", family)

    tree(tmp_path / "a.cgns", fill)
    held = "between regions of cgns:family" in read(tmp_path / "a.cgns").fixed
    assert held == (families[0] != families[1])


def test_what_is_refused(tmp_path: Path) -> None:
    def several(file: Any) -> None:
        for name in ("one", "two"):
            zone(base(file, 3, name=name), "zone", box((2, 2, 2)), (2, 2, 2))

    def faces(file: Any) -> None:
        section(zone(base(file, 3), "zone", RIGHT, cells=1), "faces", 22, 1, np.arange(1, 5))

    def outside(file: Any) -> None:
        section(zone(base(file, 3), "zone", RIGHT, cells=1), "tets", 10, 7, np.array([[1, 2, 3, 9]]))

    def short(file: Any) -> None:
        section(zone(base(file, 3), "zone", RIGHT, cells=1), "tets", 10, 1, np.array([[1, 2, 3, 4]]), 2)

    def cut(file: Any) -> None:
        section(zone(base(file, 3), "zone", RIGHT, cells=1), "all", 20, 1, np.array([10, 1, 2, 3]), 1)

    def rind(file: Any) -> None:
        found = zone(base(file, 3), "zone", box((2, 2, 2)), (2, 2, 2))
        found[" data"][0] = [3, 2, 2]

    def cylinder(file: Any) -> None:
        found = zone(base(file, 3), "zone", box((2, 2, 2)), (2, 2, 2))
        found["GridCoordinates"].move("CoordinateX", "CoordinateR")

    def nothing(file: Any) -> None:
        base(file, 3)

    for fill, why in (
        (several, r"holds several bases \(one, two\)"),
        (faces, r"has polygons or polyhedra \(NGON_n\), which meshfix does not read"),
        (outside, "the element 7 has a vertex that is not in its zone"),
        (short, "is truncated: its section 'tets' does not have the elements of its range"),
        (cut, "its section 'all' ends within an element|'all' ends within an element"),
        (rind, "has 8 coordinates in its zone 'zone', which are not as many as its points"),
        (cylinder, r"has no Cartesian coordinates in its zone 'zone' \(found: Coordinate[RYZ, Cordinate]+\)"),
        (nothing, "holds no zone with coordinates and cells"),
    ):
        tree(tmp_path / "a.cgns", fill)
        with pytest.raises(ReadError, match=why):
            read(tmp_path / "a.cgns")


def test_the_older_database_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.cgns").write_bytes(b"@(#)ADF Database Version A01010>" + bytes(100))
    with pytest.raises(ReadError, match="is a file of CGNS in ADF, which meshfix does not read: adf2hdf makes it one"):
        read(tmp_path / "a.cgns")


@pytest.mark.parametrize("name", FILES)
def test_truncated(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    data = (tmp_path / name).read_bytes()
    for cut in range(100, len(data), len(data) // 25):
        with pytest.raises(ReadError):
            cgns.parse(data[:cut])


def test_blocks_cannot_be_renumbered(tmp_path: Path) -> None:
    source = parsed(tmp_path / "a.cgns", lambda file: zone(base(file, 3), "z", box((2, 2, 2)), (2, 2, 2)) and None)
    assert source.layout is not None
    with pytest.raises(ReadError, match="between the points of a block, which cannot be renumbered"):
        source.layout.rewritten(source.points, source.points, turned(source.cells, {0: np.array([0])}))


def cube_with_a_period(path: Path, *, of_faces: bool) -> Path:
    """A cube whose sides at x = 0 and x = 3 belong together: a block of points, or hexahedra with faces in sections."""
    points, shape = box((4, 4, 4)), (4, 4, 4)
    low, high = (np.flatnonzero(points[:, 0] == x) for x in (0, 3))

    def fill(file: Any) -> None:
        parent = base(file, 3)
        if not of_faces:
            found = zone(parent, "zone", points, shape)
            one = interface(found, "around", "zone", [[1, 1, 1], [1, 4, 4]], [[4, 1, 1], [4, 4, 4]], (1, 2, 3))
            node(node(one, "GridConnectivityProperty", "GridConnectivityProperty_t"), "Periodic", "Periodic_t")
            return
        cells = np.array([
            [a, a + 1, a + 5, a + 4, a + 16, a + 17, a + 21, a + 20]
            for a in (i + 4 * j + 16 * k for k in range(3) for j in range(3) for i in range(3))
        ])  # fmt: skip
        found = zone(parent, "zone", points, cells=len(cells))
        section(found, "all", 17, 1, cells + 1)
        table = node(found, "ZoneGridConnectivity", "ZoneGridConnectivity_t")
        start = len(cells) + 1
        for name, side in (("low", low), ("high", high)):
            quads = [[side[a], side[a + 1], side[a + 5], side[a + 4]] for a in (0, 1, 2, 4, 5, 6, 8, 9, 10)]
            section(found, name, 7, start, np.array(quads) + 1)
            one = node(table, f"of {name}", "GridConnectivity_t", "zone")
            node(one, "GridConnectivityType", "GridConnectivityType_t", "Abutting1to1")
            node(one, "GridLocation", "GridLocation_t", "FaceCenter")
            numbers = np.arange(start, start + 9, dtype=np.int32)[:, None]
            node(one, "PointList", "IndexArray_t", numbers)
            node(node(one, "GridConnectivityProperty", "GridConnectivityProperty_t"), "Periodic", "Periodic_t")
            start += 9

    return _made(path, fill)


@pytest.mark.parametrize("of_faces", [False, True])
def test_points_with_a_period_do_not_slide(of_faces: bool, tmp_path: Path) -> None:
    document = read(cube_with_a_period(tmp_path / "a.cgns", of_faces=of_faces))
    assert len(document.mesh.points) == 64
    moves = slid(document).mesh.movable
    assert not moves[np.isin(document.mesh.points[:, 0], (0, 3))].any()
    assert moves.sum() == 2 * 4 * 4  # along edges, in sides and inside
    notes = untangle(document, slide="flat").report.notes
    assert any("24 vertices of the boundary do not slide" in note for note in notes)
