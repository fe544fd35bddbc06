"""SU2 files as programs write them, and a reader of our own, line by line."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import surface, write_with_gmsh
from numpy.typing import NDArray

NUMBERS = {2: 3, 3: 5, 4: 10}  # of VTK, by the number of vertices of a simplex


def elements(cells: NDArray[np.int64], start: int | None = 0) -> str:
    """Lines of simplices, with the number of each if there is a first one."""
    numbers = [""] * len(cells) if start is None else [f" {i}" for i in range(start, start + len(cells))]
    kind = NUMBERS[cells.shape[1]]
    return "".join(f"{kind} {' '.join(map(str, c))}{number}\n" for c, number in zip(cells, numbers, strict=True))


def nodes(points: NDArray[np.float64], d: int, numbered: bool = True) -> str:
    text = [" ".join(f"{x:.6f}" for x in p[:d]) for p in points]
    return "".join(f"{line} {i}\n" if numbered else f"  {line}\n" for i, line in enumerate(text))


def zone(points: NDArray[np.float64], cells: NDArray[np.int64], *, numbered: bool = True) -> str:
    d = cells.shape[1] - 1
    skin = surface(cells)
    half = len(skin) // 2
    first = 0 if numbered else None
    return (
        f"NDIME= {d}\nNELEM= {len(cells)}\n{elements(cells, first)}NPOIN= {len(points)} {len(points)}\n"
        f"{nodes(points, d, numbered)}NMARK= 2\nMARKER_TAG= wall\nMARKER_ELEMS= {half}\n{elements(skin[:half], first)}"
        f"MARKER_TAG= far field\nMARKER_ELEMS= {len(skin) - half}\n{elements(skin[half:], first)}"
    )


def plane(path: Path) -> None:
    path.write_text(zone(*shapes.plate()))


def solid(path: Path) -> None:
    """By hand: comments anywhere, no numbers of points and elements, ends of lines of Windows, a box of deformation."""
    text = zone(*shapes.block(), numbered=False).replace("NPOIN", "% the points: NPOIN= 1\n%\nNPOIN")
    text = text.replace("MARKER_TAG= wall", "MARKER_TAG= wall   % NELEM= 3\n")
    box = "FFD_NBOX= 1\nFFD_NLEVEL= 1\nFFD_TAG= BOX\nFFD_CORNER_POINTS= 2\n0 0 0\n1 1 1\n"
    path.write_bytes(("% a block\n\n" + text + box).replace("\n", "\r\n").encode())


def zones(path: Path) -> None:
    """Two zones, the second beside the first."""
    points, cells = shapes.plate()
    there = points + np.array([100.0, 0.0, 0.0])
    path.write_text(f"NZONE= 2\nIZONE= 1\n{zone(points, cells)}IZONE= 2\n{zone(there, cells)}")


def gmsh(path: Path) -> None:
    write_with_gmsh(path, *shapes.block())


FILES: dict[str, Callable[[Path], None]] = {
    "plane.su2": plane,
    "solid.su2": solid,
    "zones.su2": zones,
    "gmsh.su2": gmsh,
}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3) of all zones, and all other lines."""
    points, rest, left, dimension = [], [], 0, 0
    for line in path.read_bytes().decode().splitlines():
        words = line.partition("%")[0].split()
        if left and words:
            points.append([*map(float, words[:dimension])] + [0.0] * (3 - dimension))
            rest.append(str(words[dimension:]))
            left -= 1
            continue
        rest.append(line)
        if match := re.match(r"(NDIME|NPOIN)\s*=\s*(\d+)", line):
            left, dimension = (int(match[2]), dimension) if match[1] == "NPOIN" else (0, int(match[2]))
    return np.array(points), {"lines": rest}
