"""In .msh, .vtk and .obj files only the coordinates that moved change; everything else keeps its bytes."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest
from conftest import SAMPLES, tangle

from meshfix_cli import read, untangle, write
from meshfix_cli.mesh import Mesh
from meshfix_cli.meshfile import SPLICED, Document
from meshfix_cli.meshfile.splice import splice

SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [2.5, 2.25]]  # the last is free, and tangled
FAN = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
XYZ = [[*p, 0.0] for p in SQUARE]


def vtk_text(kind: str) -> bytes:
    body = "0 0 0 1 0 0 1.000 1e0 0\n0 1 0   2.5 2.25 0"
    cells = "\n".join(f"3 {a} {b} {c}" for a, b, c in FAN)
    return (
        f"# vtk DataFile Version 3.0\nprecious title\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 {kind}\n{body}\n"
        f"CELLS 4 16\n{cells}\nCELL_TYPES 4\n5 5 5 5\nPOINT_DATA 5\n"
        "SCALARS s double 1\nLOOKUP_TABLE default\n1 2 3 4 5\n"
    ).encode()


def vtk_binary(kind: str) -> bytes:
    points = np.array(XYZ).astype(">f4" if kind == "float" else ">f8").tobytes()
    cells = np.array([[3, *t] for t in FAN]).astype(">i4").tobytes()
    head = f"# vtk DataFile Version 3.0\ntitle\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 {kind}\n".encode()
    return head + points + b"\nCELLS 4 16\n" + cells + b"\nCELL_TYPES 4\n" + struct.pack(">4i", 5, 5, 5, 5) + b"\n"


def msh_2_text() -> bytes:
    nodes = "\n".join(f"{10 * i + 1}  {x} {y} {z}" for i, (x, y, z) in enumerate(XYZ))
    elements = "\n".join(f"{i + 1} 2 2 7 1 {10 * a + 1} {10 * b + 1} {10 * c + 1}" for i, (a, b, c) in enumerate(FAN))
    return (
        '$Comments\nkept\n$EndComments\n$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 7 "skin"\n'
        f"$EndPhysicalNames\n$Nodes\n5\n{nodes}\n$EndNodes\n$Elements\n4\n{elements}\n$EndElements\n"
    ).encode()


def msh_2_binary() -> bytes:
    nodes = b"".join(struct.pack("<i3d", i + 1, *p) for i, p in enumerate(XYZ))
    head = struct.pack("<3i", 2, 4, 2)
    elements = head + b"".join(struct.pack("<6i", i + 1, 7, 1, *(v + 1 for v in t)) for i, t in enumerate(FAN))
    return (
        b"$MeshFormat\n2.2 1 8\n" + struct.pack("<i", 1) + b"\n$EndMeshFormat\n$Nodes\n5\n" + nodes
        + b"\n$EndNodes\n$Elements\n4\n" + elements + b"\n$EndElements\n"
    )  # fmt: skip


def msh_4_text(parametric: int = 0) -> bytes:
    """Two node blocks; where the second is parametric, its point carries u and v."""
    last = "2.5 2.25 0 0.125 0.25" if parametric else "2.5 2.25 0"
    elements = "\n".join(f"{i + 1} {a + 1} {b + 1} {c + 1}" for i, (a, b, c) in enumerate(FAN))
    return (
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 1 0\n1 0 0 0 1 1 0 0 0\n$EndEntities\n$Nodes\n2 5 1 5\n"
        f"2 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 1 {parametric} 1\n5\n{last}\n$EndNodes\n"
        f"$Elements\n1 4 1 4\n2 1 2 4\n{elements}\n$EndElements\n"
        '$NodeData\n1\n"t"\n1\n0\n3\n0\n1\n5\n1 7.5\n2 0\n3 0\n4 0\n5 1\n$EndNodeData\n'
    ).encode()


def msh_4_binary() -> bytes:
    blocks = struct.pack("<4Q", 1, 5, 1, 5) + struct.pack("<3iQ", 2, 1, 0, 5) + struct.pack("<5Q", *range(1, 6))
    nodes = blocks + np.array(XYZ).tobytes()
    elements = struct.pack("<4Q3iQ", 1, 4, 1, 4, 2, 1, 2, 4)
    elements += b"".join(struct.pack("<4Q", i + 1, *(v + 1 for v in t)) for i, t in enumerate(FAN))
    entities = struct.pack("<4Q", 0, 0, 1, 0) + struct.pack("<i6dQQ", 1, 0, 0, 0, 1, 1, 0, 0, 0)
    return (
        b"$MeshFormat\n4.1 1 8\n" + struct.pack("<i", 1) + b"\n$EndMeshFormat\n$Entities\n" + entities
        + b"\n$EndEntities\n$Nodes\n" + nodes + b"\n$EndNodes\n$Elements\n" + elements + b"\n$EndElements\n"
    )  # fmt: skip


def obj_text() -> bytes:
    vertices = "".join(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in XYZ)
    faces = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FAN)
    return f"# Blender\nmtllib plate.mtl\no Plate\n{vertices}usemtl steel\ns off\n{faces}".encode()


FILES = {
    "text_float.vtk": vtk_text("float"),
    "text_double.vtk": vtk_text("double"),
    "binary_float.vtk": vtk_binary("float"),
    "binary_double.vtk": vtk_binary("double"),
    "text_2.msh": msh_2_text(),
    "binary_2.msh": msh_2_binary(),
    "text_4.msh": msh_4_text(),
    "binary_4.msh": msh_4_binary(),
    "blender.obj": obj_text(),
    "windows.obj": obj_text().replace(b"\n", b"\r\n"),
}


def assert_only_coordinates_changed(document: Document, after: Document, moved: np.ndarray) -> None:
    """Cut the moved coordinates out of both files: what remains is the same."""
    remains = []
    for one in (document, after):
        places = SPLICED[one.format.reader](one.data)
        assert places is not None
        ends = places.start + places.dtype.itemsize if places.end is None else places.end
        rest, done = b"", 0
        for row in np.flatnonzero(moved):
            for first, last in zip(places.start[row], ends[row], strict=True):
                rest += one.data[done:first]
                done = int(last)
        remains.append(rest + one.data[done:])
    assert remains[0] == remains[1]


@pytest.mark.parametrize("name", FILES)
def test_every_other_byte_stays(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(FILES[name])
    document = read(tmp_path / name)
    outcome = untangle(document.mesh)
    assert outcome.records[0].inverted > 0
    assert outcome.valid
    write(document, outcome.after, tmp_path / f"out_{name}")
    after = read(tmp_path / f"out_{name}")
    np.testing.assert_array_equal(after.mesh.points, document.as_stored(outcome.after).points)
    assert_only_coordinates_changed(document, after, np.arange(5) == 4)


@pytest.mark.parametrize("name", FILES)
def test_a_mesh_that_did_not_move_is_the_same_file(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(FILES[name])
    document = read(tmp_path / name)
    write(document, document.mesh, tmp_path / "out")
    assert (tmp_path / "out").read_bytes() == FILES[name]


@pytest.mark.parametrize("name", ["bracket_tangled.vtk", "two_materials.msh", "plate_tangled.obj"])
def test_samples(name: str, tmp_path: Path) -> None:
    document = read(SAMPLES / name)
    outcome = untangle(document.mesh)
    write(document, outcome.after, tmp_path / name)
    moved = (outcome.after.points != document.mesh.points).any(axis=1)
    assert 0 < moved.sum() < len(moved)
    assert_only_coordinates_changed(document, read(tmp_path / name), moved)


def test_numbers_are_the_shortest_that_read_back(tmp_path: Path, plate: Mesh) -> None:
    document = read(SAMPLES / "plate.vtk")
    moved = document.mesh.with_points(tangle(document.mesh).points.copy())
    write(document, moved, tmp_path / "out.vtk")
    np.testing.assert_array_equal(read(tmp_path / "out.vtk").mesh.points, moved.points)
    words = re.findall(rb"-?\d+\.\d{12,}", (tmp_path / "out.vtk").read_bytes())
    assert words
    assert all(repr(float(word)).encode() == word for word in words)


def test_parametric_nodes_of_gmsh_keep_their_parameters() -> None:
    """meshio does not read them, so the module is asked by itself."""
    data = msh_4_text(parametric=1)
    places = SPLICED["gmsh"](data)
    assert places is not None
    points = np.array(XYZ)
    points[4] = [0.5, 0.1, 0.0]
    assert splice(data, places, np.array(XYZ), points) == data.replace(b"2.5 2.25 0 0.125", b"0.5 0.1 0 0.125")


def test_places_that_do_not_hold_the_coordinates_are_not_written_to() -> None:
    """Were the points read in another order, the file is left to meshio."""
    for name, reader in (("text_2.msh", "gmsh"), ("binary_2.msh", "gmsh"), ("blender.obj", "obj")):
        places = SPLICED[reader](FILES[name])
        assert places is not None
        assert splice(FILES[name], places, np.array(XYZ)[::-1], np.array(XYZ)) is None
