"""MOVIE.BYU files in columns, as its own programs write them, and as VTK does; and a reader of our own."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from shapes import plate


def columns(words: Sequence[str], each: int) -> list[str]:
    return ["".join(words[at : at + each]) for at in range(0, len(words), each)]


def file(points: NDArray[np.float64], polygons: Sequence[Sequence[int]], parts: Sequence[tuple[int, int]]) -> str:
    """Numbers of E12.5 and I8, which may touch one another; polygons from 0."""
    listed = [one for row in polygons for one in (*(i + 1 for i in row[:-1]), -(row[-1] + 1))]
    lines = [f"{len(parts):8}{len(points):8}{len(polygons):8}{len(listed):8}"]
    lines += columns([f"{one:8}" for part in parts for one in part], 10)
    lines += columns([f"{x:12.5E}" for x in points.ravel()], 6)
    lines += columns([f"{one:8}" for one in listed], 10)
    return "\n".join([*lines, ""])


def sheet(path: Path, newline: str = "\n") -> None:
    """A bent sheet of triangles, in one part, of which some coordinates are negative."""
    points, cells = plate()
    bent = np.column_stack([points[:, :2] - [0.5, 0.5], 0.1 * points[:, 0] ** 2])
    path.write_bytes(file(bent, cells.tolist(), [(1, len(cells))]).replace("\n", newline).encode())


def by_vtk(path: Path) -> None:
    io = pytest.importorskip("vtkmodules.vtkIOGeometry")
    files_vtp = pytest.importorskip("files_vtp")
    points, cells = plate()
    writer = io.vtkBYUWriter()
    writer.SetInputData(files_vtp.polydata(points, cells.tolist()))
    for what in ("Displacement", "Scalar", "Texture"):
        getattr(writer, f"Write{what}Off")()
    writer.SetGeometryFileName(str(path))
    writer.Write()


FILES: dict[str, Callable[[Path], None]] = {
    "sheet.byu": sheet,
    "windows.byu": partial(sheet, newline="\r\n"),
    "vtk.byu": by_vtk,
}
PADDED = set(FILES)
NUMBER = re.compile(rb"([ ]*[-+]?\d*\.\d*(?:[eE][-+]?\d+)?)")


def fields(data: bytes) -> list[bytes]:
    """The data, in pieces: a coordinate, with the blanks in front of it, or what is none."""
    return NUMBER.split(data)


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all integers."""
    data = path.read_bytes()
    pieces = NUMBER.split(data)
    points = np.array([float(one) for one in pieces[1::2]]).reshape(-1, 3)
    others = [int(one) for piece in pieces[::2] for one in re.findall(rb"-?\d+", piece)]
    return points, {"others": others}
