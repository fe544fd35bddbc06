"""XDMF files: grids that are one mesh, types of cells, and numbers in text, in HDF5 and in raw bytes beside them."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from commands import run
from files_medit import interior, material, surface
from files_xdmf import FILES, attribute, item, stored, tags, topology
from numpy.typing import NDArray
from shapes import block, plate

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError, WriteError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.document import Document
from meshfix_cli.meshfile.xdmf import parse, promoted

h5py = pytest.importorskip("h5py")
SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.25]])
FAN = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])


def geometry(points: NDArray[Any]) -> str:
    kind = "XYZ"[: points.shape[1]]
    return f'<Geometry GeometryType="{kind}">{item(points)}</Geometry>'


def of(*grids: str, xi: str = 'xmlns:xi="http://www.w3.org/2001/XInclude"') -> bytes:
    return f'<Xdmf Version="3.0" {xi}><Domain>{"".join(grids)}</Domain></Xdmf>'.encode()


def grid(*parts: str, name: str = "mesh") -> str:
    return f'<Grid Name="{name}">{"".join(parts)}</Grid>'


def made(name: str, folder: Path) -> bytes:
    FILES[name](folder / name)
    return (folder / name).read_bytes()


# Grids of FEniCS


def test_tags_of_cells_are_regions_and_those_of_facets_are_cells_on_the_boundary(tmp_path: Path) -> None:
    source = parse(made("dolfinx.xdmf", tmp_path))
    points, cells = block()
    assert [run.type for run in source.cells] == ["tetra", "triangle"]
    np.testing.assert_array_equal(source.cells[0].vertices, cells)
    np.testing.assert_array_equal(source.cells[1].vertices, surface(cells))
    assert source.regions == ("labels",)
    np.testing.assert_array_equal(source.arrays.cell["labels"][0], material(points, cells))
    np.testing.assert_array_equal(source.arrays.cell["facets"][1], np.arange(len(surface(cells))) % 4)
    assert len(set(source.arrays.cell["facets"][0])) == 1


def test_the_interface_between_tags_is_held(tmp_path: Path) -> None:
    points, cells = block()
    upper = points[cells].mean(axis=1)[:, 2] > 0.7
    some = np.flatnonzero(upper)[::-1]  # and no tag for the others
    (tmp_path / "in.xdmf").write_bytes(
        of(grid(topology(cells), geometry(points)), tags("part of it", cells[some], np.full(len(some), 7)))
    )
    document = read(tmp_path / "in.xdmf")
    inner = np.intersect1d(np.intersect1d(cells[upper], cells[~upper]), interior(points, cells))
    assert len(inner) > 3
    assert document.fixed["between regions of part of it"] == len(inner)


@pytest.mark.parametrize(
    "pointer",
    [
        "xpointer(/Xdmf/Domain/Grid/Geometry)",
        "xpointer(/Xdmf/Domain/Grid[@Name='mesh'][1]/Geometry)",
        "xpointer(//Grid[@Name=&quot;mesh&quot;]/*[self::Topology or self::Geometry])",
        "xpointer(/Xdmf/Domain/Grid[1]/*[self::Geometry])",
    ],
)
def test_what_is_included(pointer: str) -> None:
    other = f'<xi:include xpointer="{pointer}"/>'
    more = "" if "Topology" in pointer else topology(FAN)
    values = attribute("label", np.arange(4))
    source = parse(of(grid(topology(FAN), geometry(SQUARE)), grid(other, more, values, name="tags")))
    assert [len(run.vertices) for run in source.cells] == [4]
    assert source.arrays.cell["label"][0].tolist() == [0, 1, 2, 3]


def test_references_of_other_kinds() -> None:
    first = grid(topology(FAN), geometry(SQUARE))
    for other in (
        '<Topology Reference="/Xdmf/Domain/Grid[1]/Topology"/><Geometry Reference="XML">//Geometry</Geometry>',
        "<Topology TopologyType='Triangle'><DataItem Reference='XML'>//Topology/DataItem</DataItem></Topology>"
        + geometry(SQUARE),
    ):
        assert len(parse(of(first, grid(other))).cells) == 1
    for wrong, words in (
        ('<xi:include href="other.xdmf"/>', "includes another file"),
        ('<xi:include xpointer="xpointer(id(3))"/>', "not an XPath|not known"),
        ('<xi:include xpointer="xpointer(//Grid[last()])"/>', "is of a kind that is not known"),
        ('<Topology Reference="/Xdmf/Domain/Grid[7]/Topology"/>', "there is no '/Xdmf/Domain/Grid"),
        ('<Topology Name="a" Reference="//Topology[@Name=\'a\']"/>', "lead to too many others"),
    ):
        with pytest.raises(ReadError, match=words):
            parse(of(first, grid(wrong, geometry(SQUARE))))


def test_grids_with_points_of_their_own_are_refused() -> None:
    grids = [grid(topology(FAN), geometry(SQUARE + i), name=f"g{i}") for i in range(2)]
    with pytest.raises(ReadError, match=r"several grids with points of their own \(g0, g1\), and one mesh is read"):
        parse(of(*grids))
    with pytest.raises(ReadError, match=r"several grids with points of their own"):
        parse(of(f'<Grid GridType="Collection" CollectionType="Spatial">{"".join(grids)}</Grid>'))
    two = of(grids[0]).replace(b"</Domain>", b"</Domain><Domain></Domain>")
    with pytest.raises(ReadError, match="several domains"):
        parse(two)


def test_equal_points_in_several_places_are_all_moved(tmp_path: Path) -> None:
    steps = [
        grid(topology(FAN), geometry(SQUARE), f'<Time Value="{i}"/>', attribute("f", SQUARE[:, 0] + i, "Node"))
        for i in range(3)
    ]
    data = of(f'<Grid GridType="Collection" CollectionType="Temporal">{"".join(steps)}</Grid>')
    source = parse(data)
    assert len(source.cells) == 1
    assert source.untold == ("2 later steps in time",)
    np.testing.assert_array_equal(source.arrays.point["f"], SQUARE[:, 0])
    moved = source.points.copy()
    moved[4] = 0.375, 0.5
    assert source.layout is not None
    new = source.layout.rewritten(source.points, moved, {})
    assert new == data.replace(b"0.500000 0.250000\n", b"0.375 0.5\n")
    np.testing.assert_array_equal(parse(new).points, moved)


def test_a_series_in_time_has_one_mesh(tmp_path: Path) -> None:
    source = parse(made("series.xdmf", tmp_path))
    assert [run.type for run in source.cells] == ["triangle"]
    np.testing.assert_array_equal(source.arrays.point["T"], plate()[0][:, 0])
    assert source.arrays.cell["a"][0].tolist() == list(range(len(plate()[1])))


def test_cells_of_fenics_may_be_numbered_either_way() -> None:
    turned = np.sort(FAN, axis=1)
    assert not parse(of(grid(topology(turned), geometry(SQUARE)))).oriented
    assert parse(of(grid(topology(FAN), geometry(SQUARE)))).oriented


# Types


NAMES = {
    "vertex": ["Polyvertex"], "line": ["Polyline", "Interval"], "line3": ["Edge_3"],
    "triangle": ["Triangle", "TRIANGLE"], "triangle6": ["Triangle_6", "Tri_6"], "triangle_of_10": ["Triangle_10"],
    "quad": ["Quadrilateral"], "quad8": ["Quadrilateral_8", "Quad_8"], "quad9": ["Quadrilateral_9", "Quad_9"],
    "tetra": ["Tetrahedron"], "tetra10": ["Tetrahedron_10", "Tet_10"], "pyramid": ["Pyramid"],
    "pyramid13": ["Pyramid_13"], "wedge": ["Wedge"], "wedge15": ["Wedge_15"], "wedge18": ["Wedge_18"],
    "hexahedron": ["Hexahedron"], "hexahedron20": ["Hexahedron_20", "Hex_20"], "hexahedron24": ["Hexahedron_24"],
    "hexahedron27": ["Hexahedron_27", "Hex_27"],
}  # fmt: skip
TYPES = [(key, name) for key, names in NAMES.items() for name in names]


@pytest.mark.parametrize(("key", "name"), TYPES, ids=[name for _, name in TYPES])
def test_types_are_known_by_all_their_names(key: str, name: str) -> None:
    nodes = ELEMENTS[key].nodes if key in ELEMENTS else 10
    rows = np.stack([np.arange(nodes), np.arange(nodes)[::-1] + 1])
    text = f'<Topology TopologyType="{name}" NumberOfElements="2">{item(rows)}</Topology>'
    source = parse(of(grid(text, geometry(np.random.default_rng(1).random((nodes + 2, 3)).round(6)))))
    assert [run.type for run in source.cells] == [key]
    np.testing.assert_array_equal(source.cells[0].vertices, rows)


def mixed(*cells: list[int], count: int) -> str:
    numbers = np.concatenate([np.array(cell) for cell in cells])
    return f'<Topology TopologyType="Mixed" NumberOfElements="{count}">{item(numbers)}</Topology>'


def test_cells_of_several_types_keep_their_place() -> None:
    cells = [
        [4, 0, 1, 4], [5, 0, 1, 2, 3], [4, 1, 2, 4], [4, 2, 3, 4], [2, 2, 0, 1], [3, 3, 0, 1, 2], [3, 5, 0, 1, 2, 3, 4],
        [1, 1, 3], [36, 0, 1, 2, 3, 4, 0], [16, 2, 3, 0, 1, 2, 4, 1, 2, 3, 4], [2, 3, 0, 1, 2], [4, 3, 0, 4],
    ]  # fmt: skip
    source = parse(of(grid(mixed(*cells, count=12), geometry(SQUARE), attribute("number", np.arange(12) * 1))))
    found: dict[str, list[Any]] = {}
    for run_, numbers in zip(source.cells, source.arrays.cell["number"], strict=True):
        assert run_.ids is not None
        np.testing.assert_array_equal(run_.ids, numbers)
        found.setdefault(run_.type, []).extend(
            (int(i), [int(v) for v in row]) for i, row in zip(run_.ids, run_.vertices, strict=True)
        )
    assert found == {
        "triangle": [(0, [0, 1, 4]), (2, [1, 2, 4]), (3, [2, 3, 4]), (5, [0, 1, 2]), (11, [3, 0, 4])],
        "quad": [(1, [0, 1, 2, 3])],
        "line": [(4, [0, 1])],
        "polygon": [(6, [0, 1, 2, 3, 4])],
        "vertex": [(7, [3])],
        "triangle6": [(8, [0, 1, 2, 3, 4, 0])],
        "polyhedron": [(9, [0, 1, 2, 1, 2, 3, 4])],
        "poly_line": [(10, [0, 1, 2])],
    }


def test_many_cells_of_two_types_one_after_the_other() -> None:
    random = np.random.default_rng(5)
    cells = [
        [4, *random.integers(0, 5, 3)] if one else [5, *random.integers(0, 5, 4)] for one in random.random(500) < 0.9
    ]
    source = parse(of(grid(mixed(*cells, count=500), geometry(SQUARE))))
    for key, number in (("triangle", 4), ("quad", 5)):
        expected = [cell[1:] for cell in cells if cell[0] == number]
        np.testing.assert_array_equal(next(one.vertices for one in source.cells if one.type == key), expected)


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ([[4, 0, 1]], "its last cell has too few vertices"),
        ([[99, 0, 1]], "no type of cells with the number 99"),
        ([[2]], "a cell has no vertices"),
        ([[2, -3, 1]], "a cell has no vertices"),
        ([[16, 2, 3, 0, 1, 2]], "a polyhedron has too few vertices"),
        ([[16, -2, 3]], "a polyhedron has too few vertices"),
    ],
)
def test_cells_that_end_too_early(cells: list[list[int]], words: str) -> None:
    with pytest.raises(ReadError, match=words):
        parse(of(grid(mixed(*cells, count=1), geometry(SQUARE))))


def test_sets_are_kept_by_their_names(tmp_path: Path) -> None:
    source = parse(made("columns.xdmf", tmp_path))
    np.testing.assert_array_equal(source.arrays.point_sets["wall"], np.unique(surface(block()[1])))
    assert source.arrays.cell_sets["some"][0].tolist() == list(range(0, 40, 3))
    assert source.untold == ("comments",)


# Files beside


def solved(path: Path, target: Path) -> tuple[Document, NDArray[Any]]:
    document = read(path)
    outcome = untangle(document.mesh)
    assert outcome.records[0].inverted > 0
    assert outcome.valid
    result, dropped = write(document, outcome.after, target)
    assert dropped == ()
    assert result.check()[0] == 0
    return document, document.file_points(outcome.after)


def sets_in(path: Path) -> dict[str, NDArray[Any]]:
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, one: found.update({name: one[()]}) if hasattr(one, "shape") else None)
    return found


STORED: list[dict[str, Any]] = [{}, {"chunks": (20, 2)}, {"compression": "gzip"}, {"dtype": ">f4"}]


@pytest.mark.parametrize("options", STORED, ids=["plain", "chunks", "gzip", "single"])
def test_the_data_set_beside_it_is_written(options: dict[str, Any], tmp_path: Path) -> None:
    path = stored(tmp_path, **options)
    (tmp_path / "new").mkdir()
    before, text = (tmp_path / "in.h5").read_bytes(), path.read_text()
    document, points = solved(path, tmp_path / "new" / "out.xdmf")
    assert sorted(one.name for one in (tmp_path / "new").iterdir()) == ["out.h5", "out.xdmf"]
    assert (tmp_path / "new" / "out.xdmf").read_text() == text.replace("in.h5", "out.h5")
    assert (tmp_path / "in.h5").read_bytes() == before
    expected = {**sets_in(tmp_path / "in.h5"), "Mesh/mesh/geometry": points}
    np.testing.assert_equal(sets_in(tmp_path / "new" / "out.h5"), expected)
    assert [run.type for run in document.source.cells] == ["tetra", "triangle"]
    if "compression" not in options:
        after = np.frombuffer((tmp_path / "new" / "out.h5").read_bytes(), np.uint8)
        changed = after != np.frombuffer(before, np.uint8)
        assert 0 < changed.sum() <= (points != document.source.points).sum() * points.itemsize
    np.testing.assert_array_equal(meshio_points(tmp_path / "new" / "out.xdmf"), points)


def meshio_points(path: Path) -> NDArray[Any]:
    """meshio reads one grid."""
    text = re.sub(r'<Grid Name="facets">.*?</Grid>', "", path.read_text(), flags=re.DOTALL)
    precision = 'Format="HDF" Precision="8"'
    (path.parent / "alone.xdmf").write_text(text.replace('Format="HDF"', precision).replace("<!DOCTYPE", "<!-- ", 0))
    return np.asarray(meshio.read(path.parent / "alone.xdmf").points)


def test_in_place_only_the_file_with_the_points_is_replaced(tmp_path: Path) -> None:
    path = stored(tmp_path)
    text, inode = path.read_bytes(), path.stat().st_ino
    _, points = solved(path, path)
    assert path.read_bytes() == text
    assert path.stat().st_ino == inode
    np.testing.assert_array_equal(sets_in(tmp_path / "in.h5")["Mesh/mesh/geometry"], points)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["in.h5", "in.xdmf"]


def test_what_did_not_move_is_the_same(tmp_path: Path) -> None:
    for options in STORED:
        path = stored(tmp_path, **options)
        document = read(path)
        write(document, document.mesh, tmp_path / "same.xdmf")
        assert (tmp_path / "same.h5").read_bytes() == (tmp_path / "in.h5").read_bytes()


def test_the_orientation_is_mended_in_the_file_beside(tmp_path: Path) -> None:
    path = stored(tmp_path)
    with h5py.File(tmp_path / "in.h5", "r+") as file:
        file.move("Mesh", "mesh")  # else the orientation would be arbitrary
        rows = file["mesh/mesh/topology"]
        rows[3] = rows[3][[1, 0, 2, 3]]
    path.write_text(path.read_text().replace(":/Mesh/", ":/mesh/"))
    assert read(path).mesh.topology.misnumbered.sum() == 1
    document = read(path, fix_orientation=True)
    write(document, document.mesh, tmp_path / "out.xdmf")
    found = sets_in(tmp_path / "out.h5")["mesh/mesh/topology"]
    np.testing.assert_array_equal(np.sort(found, axis=1), np.sort(block()[1], axis=1))
    assert read(tmp_path / "out.xdmf").mesh.topology.misnumbered.sum() == 0


def raw(folder: Path, order: str = "<") -> Path:
    """Coordinates in one file of raw numbers behind others, cells in another."""
    points, cells = block()
    (folder / "points.bin").write_bytes(b"12345" + points.astype(f"{order}f8").tobytes() + b"end")
    (folder / "cells.bin").write_bytes(cells.astype(f"{order}i4").tobytes())
    endian = {"<": "Little", ">": "Big"}[order]
    common = f'Format="Binary" Endian="{endian}"'
    (folder / "in.xdmf").write_text(
        f'<Xdmf><Domain><Grid><Topology TopologyType="Tetrahedron"><DataItem Dimensions="{len(cells)} 4" '
        f'NumberType="Int" Precision="4" {common}>cells.bin</DataItem></Topology><Geometry GeometryType="XYZ">'
        f'<DataItem Dimensions="{len(points)} 3" Precision="8" Seek="5" {common}> points.bin </DataItem></Geometry>'
        '<Attribute Name="late" Center="Node"><DataItem Dimensions="3" Format="Binary">late.bin</DataItem></Attribute>'
        "</Grid></Domain></Xdmf>"
    )
    (folder / "late.bin").write_bytes(b"what is not read")
    return folder / "in.xdmf"


@pytest.mark.parametrize("order", "<>")
def test_raw_numbers_beside_it(order: str, tmp_path: Path) -> None:
    path = raw(tmp_path, order)
    (tmp_path / "new").mkdir()
    _, points = solved(path, tmp_path / "new" / "out.xdmf")
    found = {one.name: one.read_bytes() for one in (tmp_path / "new").iterdir()}
    names = {"points.bin": "out_points.bin", "cells.bin": "out_cells.bin", "late.bin": "out_late.bin"}
    text = path.read_text()
    for old, new in names.items():
        text = text.replace(old, new)
    assert found == {
        "out.xdmf": text.encode(),
        "out_points.bin": b"12345" + points.astype(f"{order}f8").tobytes() + b"end",
        "out_cells.bin": (tmp_path / "cells.bin").read_bytes(),
        "out_late.bin": b"what is not read",
    }


def test_what_is_beside_it_is_not_replaced_by_another_output(tmp_path: Path) -> None:
    path = raw(tmp_path)
    document = read(path)
    with pytest.raises(WriteError, match=r"is a piece of the input|would replace|cannot be written"):
        write(document, document.mesh, tmp_path / "points.bin")
    assert (tmp_path / "points.bin").read_bytes().startswith(b"12345")


def test_other_formats_and_streams(tmp_path: Path) -> None:
    path = stored(tmp_path)
    run("untangle", "-q", path, tmp_path / "out.vtu")
    assert read(tmp_path / "out.vtu").mesh.check()[0] == 0
    said = run("quality", "-", data=path.read_bytes(), code=1).stderr
    assert b"is beside it: it is read neither from a stream nor compressed" in said


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda text: text.replace("in.h5", "gone.h5"), "gone.h5: No such file"),
        (lambda text: text.replace(":/Mesh/mesh/geometry", ":/no"), "in.h5: there is no data set '/no' in it"),
        (lambda text: text.replace(":/Mesh/mesh/geometry", ""), "names no data set in a file"),
        (lambda text: text.replace(' 3" Format', ' 6" Format'), "has 615 numbers for 1,230"),
        (lambda text: text.replace("in.h5", "in.xdmf"), "names itself"),
        (lambda text: text.replace("in.h5:/Mesh/mesh/g", "in.h5:/Mesh"), "there is no data set"),
        (lambda text: text[:400], "is truncated"),
    ],
)
def test_files_beside_that_are_not_right(edit: Callable[[str], str], message: str, tmp_path: Path) -> None:
    path = stored(tmp_path)
    path.write_text(edit(path.read_text()))
    with pytest.raises(ReadError, match=message):
        read(path)


SMALL = of(grid(topology(FAN), geometry(SQUARE))).decode()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (SMALL.replace("Triangle", "Heptagon"), "cells of the type 'heptagon'"),
        (SMALL.replace("Triangle", "3DSMesh"), "structured grid"),
        (SMALL.replace('"XY"', '"VXVYVZ"'), "points of the type 'vxvyvz'"),
        (SMALL.replace('"XY"', '"XYZ"'), "10 numbers are no points of the type XYZ"),
        (SMALL.replace('Elements="4"', 'Elements="5"'), "announces 5 cells and has 4"),
        (SMALL.replace('Dimensions="5 2"', 'Dimensions="6 2"'), "12 numbers are announced"),
        (SMALL.replace('Dimensions="5 2"', 'Dimensions="4 2"'), "8 numbers are announced, and there are more"),
        (SMALL.replace('Dimensions="5 2"', 'Dimensions="99999999999 2"'), "numbers are announced, and there are fewer"),
        (SMALL.replace('Dimensions="5 2"', 'Dimensions=""'), "the Dimensions of a data item are ''"),
        (SMALL.replace("0.250000", "x"), "'x' is not a number"),
        (SMALL.replace('Format="XML"', 'Format="Zip"', 1), "the format 'zip'"),
        (SMALL.replace('Format="XML"', 'ItemType="HyperSlab"', 1), "parts or functions of others"),
        (SMALL.replace("Float", "Int"), "neither of single nor of double precision"),
        (SMALL.replace("<Domain>", "").replace("</Domain>", ""), "it has no domain"),
        (SMALL.replace("Geometry", "Geometrie"), "has no grid with points and cells"),
        (SMALL.replace("<Grid ", '<Grid GridType="Subset" '), "a grid of the type 'subset'"),
        (SMALL.replace("</Xdmf>", ""), "is truncated"),
        ('<!DOCTYPE Xdmf [<!ENTITY a "b">]>' + SMALL, "document type declaration"),
    ],
)
def test_malformed(data: str, message: str) -> None:
    with pytest.raises(ReadError, match=message):
        parse(data.encode())


def test_single_precision_beside_cannot_be_double(tmp_path: Path) -> None:
    text = SMALL.replace('Precision="8"', 'Precision="4"')
    assert parse(text.encode()).points.dtype == np.float32
    wide = promoted(text.encode())
    assert wide.decode() == text.replace('Float" Precision="4"', 'Float" Precision="8"')
    beside = re.sub(
        r"<Geometry.*?>.*</Geometry>",
        '<Geometry><DataItem Dimensions="5 3" Format="Binary">a</DataItem></Geometry>',
        text,
        flags=re.DOTALL,
    )
    for precision in ("", ' Precision="8"'):  # which may not be true of a data set
        with pytest.raises(ReadError, match="which cannot be double"):
            promoted(beside.replace('"Binary"', f'"Binary"{precision}').encode())


def with_tags(folder: Path, values: NDArray[Any]) -> Path:
    """The file of a mesh with tags of its cells, of which nothing but the file beside tells the type."""
    path = stored(folder)
    cells = block()[1]
    with h5py.File(folder / "in.h5", "r+") as file:
        file["MeshTags/cells/Values"] = values
    mesh = re.search("<Topology.*?</Topology>", path.read_text())
    assert mesh is not None
    tags = (
        '<Grid Name="cells"><xi:include xpointer="xpointer(/Xdmf/Domain/Grid/Geometry)"/>'
        f'{mesh[0]}<Attribute Name="cells" Center="Cell"><DataItem Dimensions="{len(cells)} 1" '
        'Format="HDF">in.h5:/MeshTags/cells/Values</DataItem></Attribute></Grid>'
    )
    path.write_text(path.read_text().replace("</Domain>", tags + "</Domain>"))
    return path


def test_tags_whose_type_only_the_file_beside_tells_are_regions(tmp_path: Path) -> None:
    """As dolfinx writes them."""
    labels = material(*block()).astype("i4")
    document = read(with_tags(tmp_path, labels[:, None]))
    assert document.source.regions == ("cells",) and len(document.regions) == 1
    np.testing.assert_array_equal(document.source.arrays.cell["cells"][0], labels)


def test_tags_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    path = with_tags(tmp_path, np.array([b"steel"] * len(block()[1])))
    with pytest.raises(ReadError, match="the cell data 'cells', which tell regions apart, cannot be read"):
        read(path)
    assert "cells" not in str(read(path, regions="none").fixed)
