"""Universal files of I-deas as programs write them and as people do, and a reader of our own, line by line."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, surface
from numpy.typing import NDArray
from programs import gmsh_session

KINDS = {2: 11, 3: 91, 4: 111}  # of simplices, by the number of their points


def data_set(number: int, lines: Iterable[str]) -> str:
    return "\n".join(["    -1", f"{number:6}", *lines, "    -1\n"])


def columns(values: Iterable[int], width: int = 10) -> list[str]:
    """Lines of eight integers."""
    words = [f"{value:{width}}" for value in values]
    return ["".join(words[at : at + 8]) for at in range(0, len(words), 8)]


def nodes(points: NDArray[np.float64], number: int = 2411) -> str:
    rows = [(f"{i:10}{1:10}{1:10}{11:10}", "".join(f"{x:25.16E}" for x in p)) for i, p in enumerate(points, 1)]
    return data_set(number, [line for row in rows for line in row])


def elements(cells: NDArray[np.int64], properties: NDArray[np.int64], first: int = 1) -> list[str]:
    size = cells.shape[1]
    beam = ["         0         1         1"] * (size == 2)
    rows = enumerate(zip(properties.tolist(), (cells + 1).tolist(), strict=True), first)
    return [
        line for i, (of, row) in rows for line in (*columns([i, KINDS[size], of, 1, 7, size]), *beam, *columns(row))
    ]


def group(number: int, name: str, kind: int, members: Iterable[int]) -> list[str]:
    listed = [value for member in members for value in (kind, member, 0, 0)]
    return [*columns([number, 0, 0, 0, 0, 0, 0, len(listed) // 4]), name, *columns(listed)]


def salome(path: Path) -> None:
    """Units and a system, elements of all dimensions in one data set, groups of faces, solids and points."""
    points, cells = shapes.block()
    skin = surface(cells)
    units = data_set(164, ["         1  SI: Meter (newton)         2", "    1.0000000000000000E+0" * 3])
    rows = ["1.0 0.0 0.0", "0.0 1.0 0.0", "0.0 0.0 1.0", "0.0 0.0 0.0"]
    frame = data_set(2420, ["         1", "SMESH_Mesh", "         1         0         0", "Global", *rows])
    faces = elements(skin, np.full(len(skin), 2))
    solids = elements(cells, np.full(len(cells), 2), len(skin) + 1)
    here = len(skin) + 1 + np.flatnonzero(material(points, cells) == 2)
    groups = [*group(1, "wall", 8, [1, 2, 3]), *group(2, "a core", 8, here.tolist()), *group(3, "", 7, [1, 5])]
    path.write_text(units + frame + nodes(points) + data_set(2412, faces + solids) + data_set(2467, groups))


def by_gmsh(path: Path) -> None:
    points, cells = shapes.plate()
    with gmsh_session(SaveAll=1) as gmsh:
        for i, (d, some) in enumerate(((1, surface(cells)), (2, cells))):
            tag = gmsh.model.addDiscreteEntity(d)
            if i == 0:
                gmsh.model.mesh.addNodes(d, tag, np.arange(1, len(points) + 1), points.ravel())
            gmsh.model.mesh.addElementsByType(tag, d, [], (some + 1).ravel())
        gmsh.write(str(path))


def free(path: Path) -> None:
    """By hand: words that stand anywhere, exponents behind D, beams, ends of lines of Windows, two properties."""
    points, cells = shapes.plate()
    rows = [f" {i} 0 0 7\n {x:.6f}D0 {y * 10:.6f}D-01 {z:.1f}" for i, (x, y, z) in enumerate(points.tolist(), 1)]
    beams = elements(np.array([[0, 1], [1, 2]]), np.array([3, 3]), 9001)
    text = data_set(781, rows) + data_set(2412, beams + elements(cells, material(points, cells)))
    path.write_bytes(text.replace("\n", "\r\n").encode())


def older(path: Path) -> None:
    """Points on one line each, and elements with more columns."""
    points, cells = shapes.plate()
    rows = [f"{i:10}{0:10}{0:10}{7:10}" + "".join(f"{x:13.5E}" for x in p) for i, p in enumerate(points, 1)]
    listed = enumerate((cells + 1).tolist(), 1)
    faces = [line for i, row in listed for line in (*columns([i, 91, 0, 1, 0, 1, 7, 3]), *columns(row))]
    path.write_text(data_set(15, rows) + data_set(780, faces) + data_set(2435, group(4, "rim", 7, [1, 2])))


FILES: dict[str, Callable[[Path], None]] = {
    "salome.unv": salome, "gmsh.unv": by_gmsh, "free.unv": free, "older.UNV": older,
}  # fmt: skip
PADDED = {"salome.unv", "gmsh.unv", "older.UNV"}


def fields(data: bytes) -> list[bytes]:
    """The data, in pieces: a coordinate, of all its columns, or what is no coordinate."""
    found: list[bytes] = []
    for line in data.splitlines(keepends=True):
        width, head = (13, 40) if re.fullmatch(rb"[ \d]{40}[^\n]{39}\n", line) else (25, 0)
        if (head or re.fullmatch(rb"[^\n]{75}\n", line)) and b"." in line:
            found += [line[:head], *(line[head + width * i : head + width * (i + 1)] for i in range(3)), b"\n"]
        else:
            found.append(line)
    assert b"".join(found) == data
    return found


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other lines."""
    points, rest, number = [], [], ""
    lines = iter(path.read_text().splitlines())
    for line in lines:
        rest.append(line)
        if line.strip() == "-1":
            number = "" if number else next(lines).strip()
            rest.append(number)
        elif number in ("781", "2411", "15"):
            words = line[40:].split() if number == "15" else next(lines).split()
            rest[-1] = line[:40]
            points.append([float(word.replace("D", "e")) for word in words])
    return np.array(points), {"lines": rest}
