"""Meshes of OpenFOAM, made here of elements, and VTK's reader of them."""

from __future__ import annotations

import gzip
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import ELEMENTS

Blocks = Sequence[tuple[str, NDArray[Any]]]
Face = tuple[int, ...]
END = "\n\n// ************************************************************************* //\n"


def header(kind: str, name: str, binary: bool = False, scalar: int = 64) -> str:
    form = "binary" if binary else "ascii"
    return (
        "/*--------------------------------*- C++ -*----------------------------------*\\\n  1 ( 2 { a banner }\n"
        "\\*---------------------------------------------------------------------------*/\nFoamFile\n{\n"
        f'    version     2.0;\n    format      {form};\n    arch        "LSB;label=32;scalar={scalar}";\n'
        f'    class       {kind};\n    location    "constant/polyMesh";\n    object      {name};\n}}\n'
        "// * * * * * * * * * * * * * * * * * * * * * * * * * * * * * * * * * * * * * //\n\n\n"
    )


def faces_of(blocks: Blocks) -> tuple[list[Face], list[int], list[int]]:
    """Faces, owners and neighbours as OpenFOAM orders them: inner ones by owner and neighbour, then the boundary."""
    sides: dict[Face, list[tuple[int, Face]]] = {}
    cell = 0
    for key, rows in blocks:
        for row in rows.tolist():
            for facet in ELEMENTS[key].shape.facets:
                loop = tuple(row[node] for node in facet)
                sides.setdefault(tuple(sorted(loop)), []).append((cell, loop))
            cell += 1
    both = sorted((pair[0][0], pair[1][0], pair[0][1]) for pair in sides.values() if len(pair) == 2)
    alone = sorted(pair[0] for pair in sides.values() if len(pair) == 1)
    faces = [loop for _, _, loop in both] + [loop for _, loop in alone]
    return faces, [one for one, _, _ in both] + [one for one, _ in alone], [other for _, other, _ in both]


def labels(values: Iterable[int], binary: bool = False) -> bytes:
    numbers = list(values)
    if binary:
        return f"{len(numbers)}\n(".encode() + np.array(numbers, "<i4").tobytes() + b")"
    return "\n".join([str(len(numbers)), "(", *map(str, numbers), ")"]).encode()


def write(
    folder: Path,
    points: NDArray[np.float64],
    blocks: Blocks,
    *,
    binary: bool = False,
    packed: bool = False,
    scalar: int = 64,
    rotor: NDArray[np.int64] | None = None,
) -> Path:
    """Write a case with two patches of the boundary, two zones of cells, one of faces, and one of points."""
    there = folder / "constant" / "polyMesh"
    there.mkdir(parents=True)
    faces, owner, neighbour = faces_of(blocks)
    inner, count = len(neighbour), max(owner) + 1
    rotor = np.arange(count // 2) if rotor is None else rotor

    def put(kind: str, name: str, content: bytes) -> None:
        data = header(kind, name, binary and name != "boundary", scalar).encode() + content + END.encode()
        (there / f"{name}.gz").write_bytes(gzip.compress(data)) if packed else (there / name).write_bytes(data)

    if binary:
        put("vectorField", "points", f"{len(points)}\n(".encode() + points.astype(f"<f{scalar // 8}").tobytes() + b")")
        offsets = np.cumsum([0, *map(len, faces)])
        put("faceCompactList", "faces", labels(offsets, True) + b"\n" + labels(np.concatenate(faces), True))
    else:
        rows = "".join(f"({' '.join(f'{x:.6f}' for x in p)})\n" for p in points)
        put("vectorField", "points", f"{len(points)}\n(\n{rows})\n".encode())
        rows = "".join(f"{len(face)}({' '.join(map(str, face))})\n" for face in faces)
        put("faceList", "faces", f"{len(faces)}\n(\n{rows})\n".encode())
    put("labelList", "owner", labels(owner, binary))
    put("labelList", "neighbour", labels(neighbour, binary))
    half = (len(faces) - inner) // 2
    patches = {"inlet": ("patch", half, inner), "outer wall": ("wall", len(faces) - inner - half, inner + half)}
    entries = "".join(
        f'    "{name}"\n    {{\n        type            {kind};\n        inGroups        List<word> 1({kind});\n'
        f"        nFaces          {number};\n        startFace       {start};\n    }}\n"
        for name, (kind, number, start) in patches.items()
    )
    put("polyBoundaryMesh", "boundary", f"2\n(\n{entries})\n".encode())
    for kind, name, zones in (
        ("cell", "cellZones", {"rotor": rotor, "stator": np.setdiff1d(np.arange(count), rotor)}),
        ("face", "faceZones", {"baffle": [0, 1]}),
        ("point", "pointZones", {"probes": [3]}),
    ):
        body = b"".join(
            f"{zone}\n{{\n    type {kind}Zone;\n{kind}Labels      List<label> \n".encode()
            + labels(members, binary)
            + (b"\n;\nflipMap List<bool> 2{0};\n}\n" if kind == "face" else b"\n;\n}\n")
            for zone, members in zones.items()
        )
        put("regIOobject", name, f"{len(zones)}\n(\n".encode() + body + b")\n")
    (folder / "case.foam").write_bytes(b"")
    return folder


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """What VTK finds in a case: points (n, 3), and the vertices of each cell by its type."""
    reader_of = pytest.importorskip("vtkmodules.vtkIOGeometry")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    reader = reader_of.vtkOpenFOAMReader()
    reader.SetFileName(str(path / "case.foam"))
    reader.Update()
    grid = reader.GetOutput().GetBlock(0)
    cells = [(grid.GetCellType(i), *(grid.GetCell(i).GetPointId(j) for j in range(grid.GetCell(i).GetNumberOfPoints())))
             for i in range(grid.GetNumberOfCells())]  # fmt: skip
    return vtk_to_numpy(grid.GetPoints().GetData()), {"cells": cells}
