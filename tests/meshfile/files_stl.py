"""Variants of .stl files, in the dialects of the programs that write them."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapes
from numpy.typing import NDArray
from programs import gmsh_session, vtk_writes_surface

REPEATED = 20  # at most: a coordinate at the corners of its facets, and the normals of these
BINARY = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def normals_of(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return cross / np.linalg.norm(cross, axis=1, keepdims=True)


def solid(name: str, cells: NDArray[np.int64], number: str = "{:.6e}", indent: str = "  ") -> list[str]:
    """Lines of a solid of some triangles of the plate."""
    corners = shapes.plate()[0][cells]
    lines = [f"solid {name}".rstrip()]
    for normal, facet in zip(normals_of(corners).tolist(), corners.tolist(), strict=True):
        points = [f"{indent * 3}vertex {' '.join(number.format(x) for x in point)}" for point in facet]
        first = f"{indent}facet normal {' '.join(number.format(x) for x in normal)}"
        lines += [first, f"{indent * 2}outer loop", *points, f"{indent * 2}endloop", f"{indent}endfacet"]
    return [*lines, f"endsolid {name}".rstrip()]


def odd_text(path: Path) -> None:
    """With colours that do not belong there."""
    lines = solid("facet of a plate, vertex 1", shapes.plate()[1])
    path.write_text("\n".join([lines[0], "color 0.5 0.5 0.5", *lines[1:8], "  color 1 0 0", *lines[8:]]) + "\n")


def patches(path: Path) -> None:
    """Two solids, as for the patches of a boundary; capital letters, \\r\\n, tabs, and no end of the last line."""
    points, cells = shapes.plate()
    left = points[cells].mean(axis=1)[:, 0] < 1.0
    lines = [*solid("inlet", cells[left], "{!r}", "\t"), "", *solid("", cells[~left], "{!r}", "\t")]
    path.write_bytes("\r\n".join(lines).upper().replace("E-", "e-").encode())


def binary(path: Path) -> None:
    """A head that begins as text does, and colours in the attributes."""
    points, cells = shapes.plate()
    table = np.zeros(len(cells), dtype=BINARY)
    table["corners"] = points[cells]
    table["normal"] = normals_of(points[cells])
    table["attribute"] = 0x8000 + np.arange(len(cells))
    head = b"solid facet COLOR=\x80\x80\x80\xff".ljust(80, b"\0")
    path.write_bytes(head + len(cells).to_bytes(4, "little") + table.tobytes())


def trimesh_writes(path: Path, form: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    points, cells = shapes.plate()
    trimesh.Trimesh(points, cells, process=False).export(path, file_type=form)


def gmsh_writes(path: Path, binary: bool) -> None:
    points, cells = shapes.plate()
    with gmsh_session(Binary=int(binary)) as gmsh:
        gmsh.model.addDiscreteEntity(2, 1)
        gmsh.model.mesh.addNodes(2, 1, np.arange(1, len(points) + 1), points.ravel())
        gmsh.model.mesh.addElementsByType(1, 2, [], (cells + 1).ravel())
        gmsh.write(str(path))


FILES: dict[str, Callable[[Path], None]] = {
    "odd_text.stl": odd_text,
    "patches.stl": patches,
    "binary.stl": binary,
    "trimesh_text.stl": partial(trimesh_writes, form="stl_ascii"),
    "trimesh_binary.stl": partial(trimesh_writes, form="stl"),
    "gmsh_text.stl": partial(gmsh_writes, binary=False),
    "gmsh_binary.stl": partial(gmsh_writes, binary=True),
    "vtk_skew_text.stl": partial(vtk_writes_surface, module="vtkIOGeometry", writer="vtkSTLWriter", binary=False),
    "vtk_skew_binary.stl": partial(vtk_writes_surface, module="vtkIOGeometry", writer="vtkSTLWriter", binary=True),
}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Distinct points in their order, where they are used, whether the normals are right, and all else."""
    data = path.read_bytes()
    if len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        table = np.frombuffer(data[84:], dtype=BINARY)
        corners, normals = table["corners"].astype(np.float64), table["normal"].astype(np.float64)
        others: Any = [data[:84], table["attribute"].tolist()]
    else:
        lines = data.decode().splitlines()
        normals = numbers("facet", lines)
        corners = numbers("vertex", lines).reshape(-1, 3, 3)
        others = [
            line
            for line in lines
            if line.split()[:1] not in ([word] for word in ("facet", "FACET", "vertex", "VERTEX"))
        ]
    if not path.name.endswith("odd_text.stl"):  # trimesh looks for keywords in names
        assert_trimesh_agrees(path, corners)
    known: dict[tuple[float, ...], int] = {}
    cells = [known.setdefault(tuple(point), len(known)) for point in corners.reshape(-1, 3).tolist()]
    right = np.allclose(normals, normals_of(corners), atol=1e-4)
    return np.array(list(known)), {"cells": cells, "normals are right": right, "others": others}


def numbers(keyword: str, lines: list[str]) -> NDArray[np.float64]:
    pattern = re.compile(rf"\s*{keyword}(?:\s+normal)?\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
    return np.array([[float(x) for x in match.groups()] for match in map(pattern.match, lines) if match])


def assert_trimesh_agrees(path: Path, corners: NDArray[np.float64]) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.load(path, process=False, force="mesh")
    np.testing.assert_allclose(mesh.triangles, corners, rtol=0, atol=1e-7)
