"""Variants of .ply files, in the dialects of the programs that write them."""

from __future__ import annotations

import struct
from collections.abc import Callable, Generator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapes
from files_obj import BESIDE
from numpy.typing import NDArray
from programs import vtk_writes_surface

CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d"}
ALIASES = {"int8": "char", "uint8": "uchar", "int16": "short", "uint16": "ushort", "int32": "int", "uint32": "uint",
           "float32": "float", "float64": "double"}  # fmt: skip

Row = list[Any]  # numbers, and lists of numbers


def save(
    path: Path, order: str, remarks: list[str], elements: dict[str, tuple[str, list[Row]]], end: str = "\n"
) -> None:
    """Write elements, each as its properties, `kind name, list length kind name`, and its rows."""
    name = {"": "ascii", "<": "binary_little_endian", ">": "binary_big_endian"}[order]
    lines, body = ["ply", f"format {name} 1.0", *remarks], b""
    for element, (properties, rows) in elements.items():
        declared = [one.split() for one in properties.split(",")]
        lines += [f"element {element} {len(rows)}", *(f"property {' '.join(one)}" for one in declared)]
        body += b"".join(packed(order, declared, row, end) for row in rows)
    path.write_bytes((end.join([*lines, "end_header"]) + end).encode() + body)


def packed(order: str, declared: list[list[str]], row: Row, end: str) -> bytes:
    if not order:
        texts = [f"{len(v)} {' '.join(map(str, v))}" if isinstance(v, list) else str(v) for v in row]
        return (" ".join(texts) + " " + end).encode()
    out = b""
    for one, value in zip(declared, row, strict=True):
        if one[0] == "list":
            out += struct.pack(order + code(one[1]), len(value)) + struct.pack(
                f"{order}{len(value)}{code(one[2])}", *value
            )
        else:
            out += struct.pack(order + code(one[0]), value)
    return out


def code(kind: str) -> str:
    return CODES[ALIASES.get(kind, kind)]


def vertices(points: NDArray[np.float64], *more: Any) -> list[Row]:
    return [[*point, *more] for point in points.tolist()]


def meshlab(path: Path, order: str) -> None:
    points, cells = shapes.plate()
    properties = "float x, float y, float z, uchar red, uchar green, uchar blue, uchar alpha, float quality"
    rows = [[*row, 255, 10, i % 256, 255, 0.25 * i] for i, row in enumerate(points.tolist())]
    faces = [[cell, 2, [0.0, 0.5, 1.0, 0.5, 0.0, 1.0]] for cell in cells.tolist()]
    remarks = ["comment VCGLIB generated", "comment TextureFile wood.png"]
    listed = "list uchar int vertex_indices, int flags, list uchar float texcoord"
    save(path, order, remarks, {"vertex": (properties, rows), "face": (listed, faces)})


def big_with_crlf(path: Path) -> None:
    """Coordinates among others, elements that nobody knows before and behind, and the list behind numbers."""
    points, cells = shapes.plate()
    rows = [[1, x, 0.5, y, 7.5, z] for x, y, z in points.tolist()]
    faces = [[i, 0.5 * i, cell] for i, cell in enumerate(cells.tolist())]
    elements = {
        "camera": ("float view_px, list uchar short lens", [[1.5, [1, 2, 3]], [2.5, []]]),
        "face": ("ushort material, float32 weight, list int32 uint32 vertex_index", faces),
        "vertex": ("uchar flag, float32 x, double confidence, float32 y, float nx, float32 z", rows),
        "multi_patches": ("list uint8 int8 patches", [[[4, 5]], [[6]]]),
    }
    save(path, ">", ["obj_info scanned", "comment a comment"], elements, "\r\n")


def mixed(path: Path, order: str, end: str = "\n") -> None:
    """Triangles, a quadrilateral, a polygon and edges; doubles."""
    points, cells = shapes.plate()
    n = len(points)
    faces = [[7, cell] for cell in cells.tolist()]
    faces[5:5] = [[8, [n, n + 1, n + 2, n + 4]], [9, [n + 4, n + 2, n + 3]], [10, [n, n + 1, n + 2, n + 3, n + 4]]]
    edges = [[n, n + 1, 255], [n + 1, n + 2, 0]]
    elements = {
        "vertex": ("double x, double y, double z", vertices(np.concatenate([points, BESIDE]))),
        "face": ("uchar group, list uchar uint vertex_indices", faces),
        "edge": ("int vertex1, int vertex2, uchar red", edges),
    }
    save(path, order, ["comment mixed"], elements, end)


def trimesh_writes(path: Path, encoding: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    points, cells = shapes.plate()
    mesh = trimesh.Trimesh(points, cells, process=False, vertex_colors=np.full((len(points), 4), 128))
    mesh.vertex_attributes["temperature"] = np.arange(len(points), dtype=np.float64)
    mesh.face_attributes["region"] = np.arange(len(cells), dtype=np.int32) % 2
    path.write_bytes(trimesh.exchange.ply.export_ply(mesh, encoding=encoding, vertex_normal=True))


FILES: dict[str, Callable[[Path], None]] = {
    "meshlab_text.ply": partial(meshlab, order=""),
    "meshlab_binary.ply": partial(meshlab, order="<"),
    "big_with_crlf.ply": big_with_crlf,
    "mixed_text_crlf.ply": partial(mixed, order="", end="\r\n"),
    "mixed_little.ply": partial(mixed, order="<"),
    "mixed_big_cr.ply": partial(mixed, order=">", end="\r"),
    "trimesh_binary.ply": partial(trimesh_writes, encoding="binary"),
    "trimesh_text.ply": partial(trimesh_writes, encoding="ascii"),
    "vtk_skew_text.ply": partial(vtk_writes_surface, module="vtkIOPLY", writer="vtkPLYWriter", binary=False),
    "vtk_skew_binary.ply": partial(vtk_writes_surface, module="vtkIOPLY", writer="vtkPLYWriter", binary=True),
}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points, and all else row by row; VTK finds the same points and faces."""
    remarks, elements = read_rows(path.read_bytes())
    names, rows = elements["vertex"]
    at = [names.index(axis) for axis in "xyz"]
    points = np.array([[row[i] for i in at] for row in rows])
    elements["vertex"] = names, [[v for i, v in enumerate(row) if i not in at] for row in rows]
    if "_cr" not in path.name:  # header lines that VTK takes for others
        names, rows = elements["face"]
        column = next(i for i, name in enumerate(names) if name.startswith("vertex_ind"))
        assert_vtk_agrees(path, points, [row[column] for row in rows])
    return points, {"remarks": remarks, **elements}


def read_rows(data: bytes) -> tuple[list[str], dict[str, tuple[list[str], list[Row]]]]:
    """Remarks, and for each element the names of its properties and its rows."""
    head, _, body = data.partition(b"end_header")
    end = next(end for end in (b"\r\n", b"\n", b"\r") if head[3:].startswith(end))
    lines = [line.decode() for line in head.split(end)]
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[lines[1].split()[1]]
    numbers = from_text(body.decode()) if not order else from_bytes(body[len(end) :], order)
    next(numbers)
    elements: dict[str, tuple[list[str], list[Row]]] = {}
    for i, line in enumerate(lines):
        if line.startswith("element"):
            following = [one.split() for one in lines[i + 1 :]]
            stop = next((k for k, one in enumerate(following) if one[:1] != ["property"]), len(following))
            declared = [one[1:] for one in following[:stop]]
            rows = [[value(numbers, one) for one in declared] for _ in range(int(line.split()[2]))]
            elements[line.split()[1]] = [one[-1] for one in declared], rows
    return [line for line in lines if line.startswith(("comment", "obj_info"))], elements


def value(numbers: Generator[Any, str, None], declared: list[str]) -> Any:
    if declared[0] != "list":
        return numbers.send(declared[0])
    return [numbers.send(declared[2]) for _ in range(numbers.send(declared[1]))]


def from_text(body: str) -> Generator[Any, str, None]:
    kind = yield ""
    for word in body.split():
        number = float(word) if code(kind) in "fd" else int(word)
        kind = yield float(np.float32(number)) if code(kind) == "f" else number


def from_bytes(body: bytes, order: str) -> Generator[Any, str, None]:
    at, kind = 0, (yield "")
    while True:
        form = order + code(kind)
        (number,) = struct.unpack_from(form, body, at)
        at += struct.calcsize(form)
        kind = yield number


def assert_vtk_agrees(path: Path, points: NDArray[np.float64], faces: list[list[int]]) -> None:
    pytest.importorskip("vtk")
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOPLY import vtkPLYReader

    reader = vtkPLYReader()
    reader.SetDuplicatePointsForFaceTexture(False)
    reader.SetFileName(str(path))
    reader.Update()
    mesh = reader.GetOutput()
    np.testing.assert_array_equal(vtk_to_numpy(mesh.GetPoints().GetData()), points.astype(np.float32))
    polygons = mesh.GetPolys()
    assert vtk_to_numpy(polygons.GetConnectivityArray()).tolist() == [v for face in faces for v in face]
    assert np.diff(vtk_to_numpy(polygons.GetOffsetsArray())).tolist() == [len(face) for face in faces]
