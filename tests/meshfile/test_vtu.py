"""What is special about VTK's XML files; VTK, meshio and the bytes themselves are the oracles."""

from __future__ import annotations

import base64
import re
import struct
import sys
import zlib
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from files_vtu import FILES, filled, read_independently
from numpy.typing import NDArray
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import InvalidMeshError, MeshfixError, ReadError
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.meshfile.source import Source
from meshfix_cli.meshfile.vtk import vtu
from meshfix_cli.meshfile.vtk.arrays import COMPRESSORS

variants = pytest.mark.parametrize("variant", FILES)
CONTENT = re.compile(rb"<DataArray[^>]*Name=.(\w+).[^>]*[^/]>([^<]*)<")


def made(variant: str, folder: Path) -> bytes:
    FILES[variant](folder / variant)
    return (folder / variant).read_bytes()


def parsed(data: bytes) -> Source:
    source = vtu.parse(data)
    assert source is not None
    return source


def read_by_vtk(data: bytes, folder: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    (folder / "independent.vtu").write_bytes(data)
    return read_independently(folder / "independent.vtu")


def moved(source: Source, rows: Any = slice(None)) -> tuple[NDArray[Any], bytes]:
    """Move some points, and return the points and the file."""
    assert source.layout is not None
    points = source.points.copy()
    points[rows] += np.arange(3, dtype=points.dtype) + points.dtype.type(0.1)
    return points, source.layout.rewritten(source.points, points, {})


@variants
def test_points_cells_and_arrays_are_those_that_vtk_reads(variant: str, tmp_path: Path) -> None:
    source = parsed(made(variant, tmp_path))
    points, others = read_independently(tmp_path / variant)
    np.testing.assert_array_equal(source.points, points)
    assert source.points.dtype == points.dtype
    np.testing.assert_array_equal(
        np.concatenate([run.vertices.ravel() for run in source.cells]), others["connectivity"]
    )
    names = {1: "vertex", 3: "line", 5: "triangle", 10: "tetra"}
    assert [run.type for run in source.cells for _ in run.vertices] == [names[number] for number in others["types"]]
    arrays = {f"point {name}": values for name, values in source.arrays.point.items()}
    arrays |= {f"cell {name}": np.concatenate(list(runs)) for name, runs in source.arrays.cell.items()}
    assert arrays
    assert arrays.keys() == {name for name in others if name.startswith(("point ", "cell "))}
    for name, values in arrays.items():
        np.testing.assert_array_equal(values, others[name])
        assert values.dtype == others[name].dtype


@variants
def test_a_truncated_file_is_refused(variant: str, tmp_path: Path) -> None:
    data = made(variant, tmp_path)
    last = data.rindex(b">")
    for end in {*np.linspace(0, last, 150).astype(int).tolist(), *range(last - 60, last + 1)}:
        with pytest.raises(ReadError):
            vtu.parse(data[:end])


@variants
def test_float32_becomes_float64(variant: str, tmp_path: Path) -> None:
    data = made(variant, tmp_path)
    points, others = read_by_vtk(data, tmp_path)
    widened = vtu.promoted(data)
    if points.dtype == np.float64:
        assert widened == data
        return
    after, others_after = read_by_vtk(widened, tmp_path)
    assert after.dtype == np.float64
    np.testing.assert_array_equal(after.astype(np.float32), points)
    np.testing.assert_equal(others_after, others)
    assert parsed(widened).points.dtype == np.float64
    points_out, file = moved(parsed(widened), [3])
    np.testing.assert_array_equal(read_by_vtk(file, tmp_path)[0], points_out)


@variants
def test_reversed_cells_have_their_first_two_vertices_exchanged(variant: str, tmp_path: Path) -> None:
    data = made(variant, tmp_path)
    source = parsed(data)
    assert source.layout is not None
    points, others = read_independently(tmp_path / variant)
    run = len(source.cells) - 1 if variant in ("meshio.vtu", "pieces.vtu") else 1
    ids = source.cells[run].ids
    assert ids is not None
    rows = np.array([2, len(ids) - 1])
    after, others_after = read_by_vtk(
        source.layout.rewritten(source.points, source.points, turned(source.cells, {run: rows})), tmp_path
    )
    for first in others["offsets"][ids[rows]]:
        others["connectivity"][[first, first + 1]] = others["connectivity"][[first + 1, first]]
    np.testing.assert_array_equal(after, points)
    np.testing.assert_equal(others_after, others)


@pytest.mark.parametrize("variant", ["inline_double.vtu", "inline_zlib_float.vtu", "pieces.vtu", "meshio.vtu"])
def test_arrays_in_which_nothing_changes_keep_their_text(variant: str, tmp_path: Path) -> None:
    data = made(variant, tmp_path)
    _, file = moved(parsed(data))
    assert CONTENT.findall(data)
    assert [one for one in CONTENT.findall(file) if one[0] != b"Points"] == [
        one for one in CONTENT.findall(data) if one[0] != b"Points"
    ]
    assert re.sub(rb">[^<]+<", b"><", file) == re.sub(rb">[^<]+<", b"><", data)


def test_blocks_in_which_nothing_changes_keep_their_bytes(tmp_path: Path) -> None:
    """VTK compresses with another level than meshfix: the blocks that were not touched show it."""
    data = made("raw_zlib_float.vtu", tmp_path)
    points, file = moved(parsed(data), slice(0, 1))
    np.testing.assert_array_equal(read_by_vtk(file, tmp_path)[0], points)
    headers, blocks = [], []
    for one in (data, file):
        offset = re.search(rb'Name="Points"[^>]*\soffset="(\d+)"', one)
        assert offset is not None
        at = one.index(b"_", one.index(b"<AppendedData")) + 1 + int(offset[1])
        number, *sizes = struct.unpack_from("<3I", one, at)
        lengths = struct.unpack_from(f"<{number}I", one, at + 12)
        ends = at + 12 + 4 * number + np.cumsum([0, *lengths])
        headers.append((number, sizes))
        blocks.append([one[first:last] for first, last in pairwise(ends)])
    assert headers[0] == headers[1]
    assert len(blocks[0]) > 1
    assert blocks[0][0] != blocks[1][0]
    assert blocks[0][1:] == blocks[1][1:]


@pytest.mark.parametrize("variant", ["raw_zlib_float.vtu", "raw_lz4.vtu", "appended_lzma.vtu"])
def test_offsets_of_the_arrays_behind_follow(variant: str, tmp_path: Path) -> None:
    data = made(variant, tmp_path)
    _, file = moved(parsed(data))
    growth = len(file) - len(data)
    assert growth != 0
    attribute = re.compile(rb'(offset=")(\d+)(")')
    head, head_after = (one[: one.index(b"<AppendedData")] for one in (data, file))
    assert attribute.sub(rb"\1\3", head) == attribute.sub(rb"\1\3", head_after)
    where = re.search(rb'Name="Points"[^>]*\soffset="(\d+)"', head)
    assert where is not None
    before, after = ([int(match[2]) for match in attribute.finditer(one)] for one in (head, head_after))
    shifts = {offset: new - offset for offset, new in zip(before, after, strict=True)}
    digits = sum(len(str(new)) - len(str(old)) for old, new in zip(before, after, strict=True))
    assert shifts == {offset: growth - digits if offset > int(where[1]) else 0 for offset in before}


def test_an_array_in_base64_keeps_its_line_ends_and_its_own_header(tmp_path: Path) -> None:
    """VTK does neither, other programs do."""
    data = made("pieces.vtu", tmp_path)
    packed = max(re.findall(rb"[A-Za-z0-9+/=]{200,}", data), key=len)
    numbers = base64.b64decode(packed)
    text = base64.b64encode(numbers[:4]) + base64.b64encode(numbers[4:])
    wrapped = b"\r\n ".join(text[i : i + 76] for i in range(0, len(text), 76))
    points, file = moved(parsed(data.replace(packed, wrapped)))
    found = re.search(rb"(?:[A-Za-z0-9+/=]{76}\r\n )+[A-Za-z0-9+/=]+", file)
    assert found is not None
    text = found[0].translate(None, b"\r\n ")
    assert text[:8] == base64.b64encode(numbers[:4])
    np.testing.assert_array_equal(np.frombuffer(base64.b64decode(text[8:])).reshape(-1, 3), points[len(points) // 2 :])
    np.testing.assert_array_equal(parsed(file).points, points)
    assert len(found[0]) == len(wrapped)


def test_pieces_are_joined_and_the_points_on_their_borders_stay_apart(tmp_path: Path) -> None:
    source = parsed(made("pieces.vtu", tmp_path))
    half = len(source.points) // 2
    np.testing.assert_array_equal(source.points[half:] - source.points[:half] == [100, 0, 0], True)
    vertices = source.vertices_of("triangle", 3)
    np.testing.assert_array_equal(vertices[len(vertices) // 2 :], vertices[: len(vertices) // 2] + half)
    assert set(source.arrays.point["s"]) == {1.5, 2.5}


def test_a_vertex_that_its_piece_does_not_have_is_not_that_of_the_next(tmp_path: Path) -> None:
    data = made("pieces.vtu", tmp_path)
    n = len(parsed(data).points) // 2
    (tmp_path / "wrong.vtu").write_bytes(re.sub(rb"(connectivity' format='ascii'>\n)\d+", rb"\g<1>%d" % n, data))
    with pytest.raises(InvalidMeshError, match="-1"):
        read(tmp_path / "wrong.vtu")


def test_polyhedra_are_held_and_wedges_are_solved(tmp_path: Path) -> None:
    io = pytest.importorskip("vtkmodules.vtkIOXML")
    points, cells = block()
    grid = filled(points, cells)
    grid.InsertNextCell(13, 6, [3, 4, 5, 6, 7, 8])
    faces = [4, 3, 9, 10, 11, 3, 9, 10, 12, 3, 10, 11, 12, 3, 9, 11, 12]
    core = pytest.importorskip("vtkmodules.vtkCommonCore")
    stream = core.vtkIdList()
    for number in faces:
        stream.InsertNextId(number)
    grid.InsertNextCell(42, stream)
    grid.GetCellData().Initialize()
    for encoded in (True, False):
        writer = io.vtkXMLUnstructuredGridWriter()
        writer.SetInputData(grid)
        writer.SetFileName(str(tmp_path / "mixed.vtu"))
        writer.SetEncodeAppendedData(encoded)
        assert writer.Write()
        source = parsed((tmp_path / "mixed.vtu").read_bytes())
        found = {run.type: run.vertices.tolist() for run in source.cells}
        assert found["wedge"] == [[3, 4, 5, 6, 7, 8]]
        assert sorted(found["polyhedron"][0]) == [9, 10, 11, 12]
        document = read(tmp_path / "mixed.vtu")
        assert document.not_judged == {"polyhedron": 1}
        assert not document.mesh.movable[[*range(3, 13)]].any()
        target, others = read_independently(tmp_path / "mixed.vtu")
        after, others_after = read_by_vtk(moved(source)[1], tmp_path)
        np.testing.assert_equal(others_after, others)
        assert (after != target).all()


def test_regions_and_what_no_other_format_holds(tmp_path: Path) -> None:
    assert parsed(made("meshio.vtu", tmp_path)).regions == ("gmsh:physical",)
    source = parsed(made("ascii_double.vtu", tmp_path))
    assert source.regions == ("MaterialIDs",)
    assert source.untold == ("comments", "field data")


def test_a_damaged_array_of_data_is_left_out_and_the_mesh_is_read(tmp_path: Path) -> None:
    data = made("ascii_double.vtu", tmp_path).replace(b'type="UInt8" Name="clamped"', b'type="Bit" Name="clamped"')
    source = parsed(re.sub(rb"(Name=\"velocity\"[^>]*>\s*)\S+", rb"\1oops", data))
    assert source.arrays.point.keys() == {"temperature"}
    assert source.arrays.cell.keys() == {"MaterialIDs"}
    assert "strings and bits" in source.untold
    points, file = moved(source)
    np.testing.assert_array_equal(parsed(file).points, points)


def test_labels_of_regions_that_are_damaged_are_an_error(tmp_path: Path) -> None:
    """Else the interface of the materials would be free."""
    data = made("meshio.vtu", tmp_path)
    with pytest.raises(ReadError, match="'gmsh:physical' are damaged"):
        parsed(data.replace(b'type="Int64" Name="gmsh:physical"', b'type="String" Name="gmsh:physical"'))


def test_vertices_of_ghost_cells_are_held(tmp_path: Path) -> None:
    """Another piece has them as well, and one vertex must not get two positions."""
    data = made("ascii_double.vtu", tmp_path)
    ghosts = parsed(data.replace(b'Name="MaterialIDs"', b'Name="vtkGhostType"'))  # all of them
    assert ghosts.held is not None
    assert ghosts.held[np.unique(ghosts.vertices_of("tetra", 4))].all()
    assert parsed(data).held is None


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"UnstructuredGrid", b"PolyData"),
        (b'type="Float64" Name="Points"', b'type="Int64" Name="Points"'),
        (b'Name="Points" NumberOfComponents="3"', b'Name="Points" NumberOfComponents="2"'),
    ],
)
def test_other_kinds_of_files_are_refused(old: bytes, new: bytes, tmp_path: Path) -> None:
    data = made("raw_double.vtu", tmp_path)
    assert old in data
    with pytest.raises(ReadError, match=r"no UnstructuredGrid|not three Float32"):
        vtu.parse(data.replace(old, new))


def test_arrays_that_share_their_bytes_are_refused(tmp_path: Path) -> None:
    data = made("raw_double.vtu", tmp_path)
    offset = re.search(rb'Name="Points"[^>]*\soffset="(\d+)"', data)
    assert offset is not None
    shared = re.sub(rb'(Name="velocity"[^>]*\soffset=")\d+', rb"\g<1>" + offset[1], data)
    with pytest.raises(ReadError, match="share their bytes"):
        vtu.parse(shared)


TEXT = b"""<VTKFile type="UnstructuredGrid"><UnstructuredGrid><Piece NumberOfPoints="4" NumberOfCells="2"><Points>
<DataArray type="Float64" Name="P" NumberOfComponents="3">0 0 0 1 0 0 1 1 0 0 1 0</DataArray></Points><Cells>
<DataArray type="Int8" Name="connectivity">0 1 2 0 2 3</DataArray><DataArray type="Int8" Name="offsets">3 6</DataArray>
<DataArray type="UInt8" Name="types">5 5</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>
"""


@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf", b'<?xml version="1.0" encoding="ISO-8859-1"?><!--\xe9-->'])
def test_text_may_touch_the_tags_and_the_encoding_may_be_another(mark: bytes) -> None:
    source = parsed(mark + TEXT)
    assert source.points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    points, file = moved(source, [0, 3])
    np.testing.assert_array_equal(parsed(file).points, points)
    assert file == mark + TEXT.replace(b">0 0 0 1 0 0", b">0.1 1.1 2.1 1 0 0").replace(b" 0 1 0<", b" 0.1 2.1 2.1<")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b'NumberOfPoints="4"', b'NumberOfPoints="5"', "is truncated: its array 'P' has less than 15 numbers"),
        (b'NumberOfPoints="4"', b'NumberOfPoints="3"', "'P' has more than 9 numbers"),
        (b'NumberOfPoints="4"', b'NumberOfPoints="999999999999999"', "less than 2,999,999,999,999,997 numbers"),
        (b'NumberOfPoints="4"', b'NumberOfPoints="-1"', "NumberOfPoints of a Piece is '-1'"),
        (b'NumberOfPoints="4"', b"", "NumberOfPoints of a Piece is ''"),
        (b'NumberOfCells="2"', b'NumberOfCells="3"', "' has less than 3 numbers"),
        (b'NumberOfCells="2"', b'NumberOfCells="1"', "more than 1 number"),
        (b">5 5<", b">5<", "'types' has less than 2 numbers"),
        (b">5 5<", b">5 10<", "a tetra with 3 vertices"),
        (b">3 6<", b">3 7<", "'connectivity' has less than 7 numbers"),
        (b">3 6<", b">7 6<", "do not fit"),
        (b">3 6<", b">3 -6<", "'connectivity' has more than 0 numbers"),
        (b">0 1 2 0 2 3<", b">0 1 2 0 2<", "'connectivity' has less than 6 numbers"),
        (b">0 1 2 0 2 3<", b">0 1/7 2 0 2 3<", "'1/7' is not an integer"),
        (b">0 1 2 0 2 3<", b">0 1.5 2 0 2 3<", "'1.5' is not an integer"),
        (b" 1 1 0 ", b" 1 abc 0 ", "line 2: 'abc' is not a number"),
        (b'"Int8" Name="offsets"', b'"Float32" Name="offsets"', "'offsets' does not hold integers"),
        (b'Name="types"', b'Name="Types"', "0 arrays for its Cells types"),
        (b"</Points>", b'<DataArray type="Float64"/></Points>', "2 arrays for its Points"),
        (b"<Points>", b"<points>", "mismatched tag"),
        (b"</VTKFile>", b"", "does not end with </VTKFile>"),
        (b'Name="P"', b'Name="P" format="appended" offset="0"', "no appended data"),
        (b'Name="P"', b'Name="P" format="binary"', "'P' has [0-9,]+ bytes, not 96"),
        (b"<VTKFile", b"<!DOCTYPE a [<!ENTITY b 'c'>]><VTKFile", "document type"),
        (b"<VTKFile", b"<?xml version='1.0' encoding='martian'?><VTKFile", "encoding"),
    ],
)
def test_what_is_wrong_is_said(old: bytes, new: bytes, message: str) -> None:
    assert old in TEXT
    with pytest.raises(ReadError, match=message):
        vtu.parse(TEXT.replace(old, new, 1))


def test_sixteen_bits_a_character_are_refused() -> None:
    with pytest.raises(ReadError, match="not where they should be"):
        vtu.parse(b"\xff\xfe" + TEXT.decode().encode("utf-16-le"))


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        (b'compressor="vtkSnappyDataCompressor"', "not known"),
        (b'byte_order="MiddleEndian"', "not known"),
        (b'header_type="Float32"', "not known"),
    ],
)
def test_unknown_encodings_are_named(attributes: bytes, message: str) -> None:
    data = TEXT.replace(b"<VTKFile", b"<VTKFile " + attributes).replace(b'Name="P"', b'Name="P" format="binary"')
    with pytest.raises(ReadError, match=message):
        vtu.parse(data)


def compressed(*header: int, body: bytes = b"") -> bytes:
    """A file whose points are compressed by zlib under a header."""
    packed = base64.b64encode(struct.pack(f"<{len(header)}I", *header)) + base64.b64encode(body)
    data = TEXT.replace(b"<VTKFile", b'<VTKFile compressor="vtkZLibDataCompressor"')
    return re.sub(rb'Name="P"([^>]*)>[^<]*', rb'Name="P" format="binary"\1>' + packed, data)


def test_a_block_is_opened_no_further_than_it_should_be() -> None:
    body = zlib.compress(bytes(96))
    assert not parsed(compressed(1, 96, 0, len(body), body=body)).points.any()
    assert not parsed(compressed(1, 4096, 96, len(body), body=body)).points.any()
    bomb = zlib.compress(bytes(10**7))
    for data, message in (
        (compressed(1, 10**7, 0, len(bomb), body=bomb), "has 10,000,000 bytes, not 96"),
        (compressed(1, 96, 0, len(bomb), body=bomb), "not as long as announced"),
        (compressed(2, 48, 0, len(body), 0, body=body), "not as long as announced"),
        (compressed(1, 48, 96, len(body), body=body), "wrong size"),
        (compressed(1, 0, 96, len(body), body=body), "wrong size"),
        (compressed(1, 48, 0, len(body), body=body), "is truncated: its array 'P' has 48 bytes"),
        (compressed(1, 96, 0, len(body) - 1, body=body[:-1]), "not as long as announced"),
        (compressed(1, 96, 0, len(body), body=body[:-4]), "ends before it should"),
        (compressed(1, 96, 0, len(body), body=body[::-1]), "damaged"),
        (compressed(1, 96, 0, len(body), body=body + bytes(9)), "more bytes than announced"),
        (compressed(4_000_000_000, 96, 0), "ends before it should"),
        (compressed(0, 96, 0), "has 0 bytes"),
    ):
        with pytest.raises(ReadError, match=message):
            vtu.parse(data)


@pytest.mark.parametrize("name", COMPRESSORS)
def test_compressors_refuse_what_they_did_not_make(name: str) -> None:
    if "LZ4" in name:
        pytest.importorskip("lz4.block")
    body = bytes(range(100)) * 50
    packed = COMPRESSORS[name].compress(body)
    assert len(packed) < len(body) <= COMPRESSORS[name].most * len(packed)
    assert COMPRESSORS[name].decompress(packed, len(body)) == body
    for wrong, size in ((packed[:-9], 5000), (packed, 4999), (b"\xff" * 60, 5000)):
        try:
            found = COMPRESSORS[name].decompress(wrong, size)
        except (ValueError, RuntimeError, zlib.error):
            continue
        assert len(found) != size


def test_the_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made("raw_lz4.vtu", tmp_path)
    monkeypatch.setitem(sys.modules, "lz4", None)
    monkeypatch.setitem(sys.modules, "lz4.block", None)
    with pytest.raises(MeshfixError, match="needs the package lz4"):
        read(tmp_path / "raw_lz4.vtu")


def test_points_that_are_not_a_number_keep_their_bytes(tmp_path: Path) -> None:
    data = made("raw_big_endian_float.vtu", tmp_path)
    source = parsed(data)
    points = source.points.copy()
    points[5] = np.nan
    assert source.layout is not None
    assert source.layout.rewritten(source.points, points, {}) == data
    assert source.layout.rounded(points.astype(np.float64)).dtype == np.float32
