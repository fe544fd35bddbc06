"""Keyword files of LS-DYNA as programs write them and as people do, and a reader of our own, line by line."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material
from numpy.typing import NDArray


def nodes(points: NDArray[np.float64], columns: int = 8, reals: int = 16, digits: int = 8) -> str:
    rows = (f"{i:{columns}}" + "".join(f"{x:{reals}.{digits}f}" for x in p) for i, p in enumerate(points, 1))
    return "".join(f"{row}{0:{columns}}{0:{columns}}\n" for row in rows)


def elements(cells: NDArray[np.int64], parts: NDArray[np.int64], columns: int = 8, two: bool = False) -> str:
    """Shells or solids of three or four corners, of which the last is repeated; in one card or two."""
    full = np.hstack([cells + 1, *[cells[:, -1:] + 1] * ({3: 4, 4: 8}[cells.shape[1]] - cells.shape[1])])
    text = ""
    for i, (part, row) in enumerate(zip(parts.tolist(), full.tolist(), strict=True), 1):
        head, rest = (f"{one:{columns}}" for one in (i, part)), (f"{one:{columns}}" for one in row)
        text += "".join(head) + "\n" * two + "".join(rest) + "\n"
    return text


PARTS = "*PART\na block of steel\n         1         1         1\n$ between\ncopper\n         2         1         2\n"


def prepost(path: Path) -> None:
    """Two cards for each solid, parts, sets."""
    points, cells = shapes.block()
    sets = "*SET_NODE_LIST_TITLE\nclamped\n$      sid\n         1       0.0\n         1         2         3\n"
    sets += "*SET_PART_LIST\n         7\n         2\n*SET_SOLID_GENERATE\n         3\n         1         4\n"
    solids = elements(cells, material(points, cells), two=True)
    text = f"$ made here\n*KEYWORD\n*TITLE\na block\n{PARTS}*ELEMENT_SOLID\n{solids}"
    path.write_text(f"{text}*NODE\n$    nid               x\n{nodes(points)}{sets}*END\n*NODE\n 1\n")


def shells(path: Path) -> None:
    """One card for each shell, with another for its thickness, and ends of lines of Windows."""
    points, cells = shapes.plate()
    body = elements(cells, material(points, cells)).splitlines()
    thick = "".join(f"{line}\n             1.0             1.0             1.0             1.0\n" for line in body)
    text = f"*KEYWORD\n*NODE\n{nodes(points)}*ELEMENT_SHELL_THICKNESS\n{thick}*END\n"
    path.write_bytes(text.replace("\n", "\r\n").encode())


def long(path: Path) -> None:
    """In columns of 20, filled to the last, and beams."""
    points, cells = shapes.block()
    solids = elements(cells, np.ones(len(cells), dtype=np.int64), 20)
    beam = "".join(f"{one:20}" for one in (90000, 3, 1, 2))
    path.write_text(
        f"*KEYWORD LONG=Y\n*NODE\n{nodes(points, 20, 20, 17)}*ELEMENT_BEAM\n{beam}\n*ELEMENT_SOLID\n{solids}*END\n"
    )


def free(path: Path) -> None:
    """By hand: between commas."""
    points, cells = shapes.plate()
    rows = "".join(f"{i}, {x:.6f},{y:.6f} , 0.0\n" for i, (x, y, _) in enumerate(points.tolist(), 1))
    faces = "".join(f"{i},1,{a},{b},{c},{c}\n" for i, (a, b, c) in enumerate((cells + 1).tolist(), 1))
    path.write_text(f"*NODE\n{rows}*ELEMENT_SHELL\n{faces}*END\n")


FILES: dict[str, Callable[[Path], None]] = {
    "prepost.k": prepost, "shells.key": shells, "long.dyn": long, "free.k": free,
}  # fmt: skip
PADDED = {"prepost.k", "shells.key", "long.dyn"}


def fields(data: bytes) -> list[bytes]:
    """The data, in pieces: a coordinate, of all its columns, or what is none."""
    found: list[bytes] = []
    columns, reals = (20, 20) if b"LONG=Y" in data else (8, 16)
    keyword = b""
    for line in data.splitlines(keepends=True):
        keyword = line.strip() if line[:1] == b"*" else keyword
        if keyword == b"*NODE" and line[:1] == b" " and len(line) > 40:
            ends = [columns + reals * i for i in range(4)]
            found += [line[:columns], *(line[a:b] for a, b in pairwise(ends)), line[ends[-1] :]]
        else:
            found.append(line)
    assert b"".join(found) == data
    return found


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other lines."""
    text = path.read_bytes().decode().partition("*END")[0]
    columns, reals = (20, 20) if "LONG=Y" in text else (8, 16)
    points, rest, keyword = [], [], ""
    for line in text.splitlines():
        keyword = line if line[:1] == "*" else keyword
        if keyword != "*NODE" or line[:1] in "*$":
            rest.append(line)
        elif "," in line:
            number, *words = line.split(",")
            points.append([*map(float, words)])
            rest.append(number)
        else:
            points.append([float(line[columns + reals * i : columns + reals * (i + 1)]) for i in range(3)])
            rest.append(line[:columns] + line[columns + 3 * reals :])
    return np.array(points), {"rest": rest, "numbers": re.findall(r"\*\w+", text)}
