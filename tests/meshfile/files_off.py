"""OFF files in the dialects of programs, and a reader of our own, word by word."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from numpy.typing import NDArray
from programs import TILTED


def text(
    points: NDArray[np.float64], cells: NDArray[np.int64], head: str = "OFF\n", behind: str = "", colour: str = ""
) -> str:
    """A file whose vertices and faces have something behind them."""
    nodes = "".join(" ".join(f"{x:.6f}" for x in p) + f"{behind}\n" for p in points)
    faces = "".join(f"{len(c)}  {' '.join(map(str, c))}{colour}\n" for c in cells)
    return f"{head}{len(points)} {len(cells)} 0\n{nodes}{faces}"


def plain(path: Path) -> None:
    path.write_text(text(*shapes.plate()))


def commented(path: Path) -> None:
    """Comments and empty lines anywhere, counts beside the keyword, ends of lines of Windows."""
    words = text(*shapes.plate(), head="# made here\nOFF  ", colour="  # 3 0 1 2").replace("\n", "\n\n", 4)
    path.write_bytes(words.replace("\n", "\r\n").encode())


def coloured(path: Path) -> None:
    """Normals, colours and texture coordinates; colours of faces as well."""
    path.write_text(text(*shapes.plate(), "STCNOFF\n", " 0 0 1 0.5 0.25 0 1 0 0.1", " 255 0 0"))


def tilted(path: Path) -> None:
    """A skew plane, and a polygon of five vertices and an edge beside it."""
    points, cells = shapes.plate()
    corners = np.array([[0, 0, 9], [1, 0, 9], [2, 1, 9], [1, 2, 9], [0, 1, 9]])
    words = text(np.vstack([points @ TILTED, corners]), cells)
    n, m = len(points), len(cells)
    first, others = words.split("\n", 2)[0], words.split("\n", 2)[2]
    polygon = f"5 {' '.join(str(n + i) for i in range(5))} 7\n2 {n} {n + 2}\n"
    path.write_text(f"{first}\n{n + 5}\t{m + 2}\n{others}{polygon}")


FILES: dict[str, Callable[[Path], None]] = {
    "plain.off": plain, "commented.off": commented, "coloured.off": coloured, "tilted.off": tilted,
}  # fmt: skip


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all words that are no coordinates; comments too."""
    lines = path.read_text().splitlines()
    words = [line.partition("#")[0].split() for line in lines]
    rest: list[Any] = [line.partition("#")[2] for line in lines]
    filled = [row for row in words if row]
    head = filled.pop(0)
    counts = head[1:] or filled.pop(0)
    n = int(counts[0])
    rest += [head, counts, [row[3:] for row in filled[:n]], filled[n:]]
    return np.array([row[:3] for row in filled[:n]], dtype=float), {"words": rest}
