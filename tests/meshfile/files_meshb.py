"""Binary files of MEDIT, written keyword by keyword, and a reader of our own of the same kind."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import interior, material, surface
from numpy.typing import NDArray

KEYWORDS = {
    "Vertices": 4, "Edges": 5, "Triangles": 6, "Quadrilaterals": 7, "Tetrahedra": 8, "Prisms": 9, "Hexahedra": 10,
    "Corners": 13, "Ridges": 14, "RequiredVertices": 15, "RequiredTriangles": 17, "NormalAtVertices": 20,
    "TrianglesP2": 24, "EdgesP2": 25, "QuadrilateralsQ2": 27, "TetrahedraP2": 30, "HexahedraQ2": 33, "Pyramids": 49,
    "Normals": 60, "PrismsP2": 86, "PyramidsP2": 87, "BezierBasis": 125, "TetrahedraP2Ordering": 133,
    "PyramidsP2Ordering": 135, "PrismsP2Ordering": 137, "HexahedraQ2Ordering": 139, "FloatingPointPrecision": 155,
}  # fmt: skip
DIMENSION, END = 3, 54
Sections = Sequence[tuple[str, NDArray[Any]]]


def with_references(rows: NDArray[Any], references: Any = 0) -> NDArray[Any]:
    """Numbers from 1, and references."""
    return np.column_stack([rows + 1, np.broadcast_to(references, len(rows))])


def binary(
    points: NDArray[Any],
    sections: Sections,
    version: int = 2,
    order: str = "<",
    real: str = "",
    references: Any = 0,
    end: bool = True,
) -> bytes:
    """A file; tables of floating-point numbers are those of reals."""
    real = f"{order}{real or ('f4' if version == 1 else 'f8')}"
    offset, integer = f"{order}{'i' if version < 3 else 'q'}", f"{order}i{4 if version < 4 else 8}"
    kind = np.dtype([("x", real, (points.shape[1],)), ("ref", integer)])
    table = np.empty(len(points), kind)
    table["x"], table["ref"] = points, references
    bodies = [(KEYWORDS["Vertices"], table.tobytes(), len(points))]
    for name, rows in sections:
        bodies.append((KEYWORDS[name], rows.astype(real if rows.dtype.kind == "f" else integer).tobytes(), len(rows)))
    data = struct.pack(f"{order}iii", 1, version, DIMENSION)
    data += struct.pack(offset, len(data) + struct.calcsize(offset) + 4) + struct.pack(f"{order}i", points.shape[1])
    for number, body, count in bodies:
        counted = np.array(count, integer).tobytes() + body
        data += struct.pack(f"{order}i", number)
        data += struct.pack(offset, len(data) + struct.calcsize(offset) + len(counted)) + counted
    return data + (struct.pack(f"{order}i", END) + struct.pack(offset, 0) if end else b"")


def solid(path: Path, **options: Any) -> None:
    points, cells = shapes.block()
    skin = surface(cells)
    held = interior(points, cells)[2]
    sections = [
        ("Triangles", with_references(skin, np.arange(len(skin)) % 3)),
        ("RequiredVertices", np.array([[held + 1], [5]])),
        ("Ridges", np.array([[1], [2]])),
        ("NormalAtVertices", np.array([[1, 1], [2, 1]])),
        ("Normals", np.array([[0.0, 0.0, -1.0]])),
        ("Tetrahedra", with_references(cells, material(points, cells))),
        ("RequiredTriangles", np.array([[2]])),
    ]
    path.write_bytes(binary(points, sections, references=np.arange(len(points)) % 3, **options))


def plane(path: Path, **options: Any) -> None:
    points, cells = shapes.plate()
    sections = [("Edges", with_references(surface(cells))), ("Triangles", with_references(cells, 4))]
    path.write_bytes(binary(points[:, :2], sections, **options))


def single_by_keyword(path: Path) -> None:
    """Numbers in single precision in a version that has the double one."""
    points, cells = shapes.block()
    sections = [("FloatingPointPrecision", np.array([[32]])), ("Tetrahedra", with_references(cells))]
    path.write_bytes(binary(points, sections, 3, real="f4"))


def by_meshio(path: Path, kind: str = "i8") -> None:
    import meshio

    points, cells = shapes.block()
    blocks = [("triangle", surface(cells).astype(kind)), ("tetra", cells.astype(kind))]
    references = [np.zeros(len(blocks[0][1]), kind), material(points, cells).astype(kind)]
    mesh = meshio.Mesh(points, blocks, {"medit:ref": np.arange(len(points), dtype=kind)}, {"medit:ref": references})
    mesh.write(path, "medit")


FILES: dict[str, Callable[[Path], None]] = {
    "1_big.meshb": partial(solid, version=1, order=">"),
    "1.meshb": partial(solid, version=1),
    "2.meshb": solid,
    "2_plane.meshb": plane,
    "3_big.meshb": partial(solid, version=3, order=">"),
    "4_plane.meshb": partial(plane, version=4),
    "meshio_3.meshb": partial(by_meshio, kind="i4"),
    "meshio_4.meshb": by_meshio,
}


def read_independently(path: Path) -> tuple[NDArray[Any], dict[str, Any]]:
    """Points (n, 3), and what stands behind each keyword as text of numbers, but for the coordinates."""
    data = path.read_bytes()
    order = "<" if data[0] else ">"
    (version,) = struct.unpack_from(f"{order}i", data, 4)
    offset, integer, real = (
        order + one for one in ("i" if version < 3 else "q", "i" if version < 4 else "q", "f" if version == 1 else "d")
    )
    found: dict[str, Any] = {}
    at, dimension, points = 8, 0, np.empty((0, 3))
    while at < len(data):
        (number,) = struct.unpack_from(f"{order}i", data, at)
        (following,) = struct.unpack_from(offset, data, at + 4)
        begin, end = at + 4 + struct.calcsize(offset), following or len(data)
        if number == DIMENSION:
            (dimension,) = struct.unpack_from(f"{order}i", data, begin)
        elif number != END:
            (count,) = struct.unpack_from(integer, data, begin)
            begin += struct.calcsize(integer)
            if number == KEYWORDS["Vertices"]:
                rows = list(struct.iter_unpack(f"{order}{dimension}{real[1]}{integer[1]}", data[begin:end]))
                points = np.zeros((count, 3), dtype=real)
                points[:, :dimension] = [row[:-1] for row in rows]
                found["references"] = [row[-1] for row in rows]
            else:
                kind = real if number == KEYWORDS["Normals"] else integer
                found[f"{number}"] = (count, [one[0] for one in struct.iter_unpack(kind, data[begin:end])])
        at = end
    return points.astype(points.dtype.newbyteorder("=")), found
