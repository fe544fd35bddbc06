"""Text files of Tecplot as programs write them and as people do, and a reader of our own, word by word."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, rows
from numpy.typing import NDArray

ET = {3: "TRIANGLE", 4: "TETRAHEDRON"}


def numbers(points: NDArray[np.float64], *others: NDArray[np.float64]) -> NDArray[np.str_]:
    """The texts (n, k) of coordinates and of other variables."""
    return np.array([[f"{x:.6f}" for x in row] for row in np.column_stack([points, *others])])


def wrapped(words: NDArray[np.str_]) -> str:
    """Seven numbers to a line."""
    return rows(words[at : at + 7] for at in range(0, len(words), 7))


def by_points(path: Path) -> None:
    """Old keys, a variable before the coordinates, and ends of lines of Windows."""
    points, cells = shapes.plate()
    text = f'Title="a plate"\nVariables="P","X","Y"\nZone N={len(points):8}, E={len(cells)}, F=FEPOINT, ET=TRIANGLE\n'
    body = rows(numbers(points[:, 2], points[:, :2])) + rows(cells + 1)
    path.write_bytes((text + body).replace("\n", "\r\n").encode())


def by_variables(path: Path) -> None:
    """New keys, comments, auxiliary data, and a variable that has a number for each cell."""
    points, cells = shapes.block()
    head = '# made here\nTITLE = "X"\nVARIABLES = "X [m]", "Y [m]"\n"Z [m]" "T" , Q\n'
    head += '# the zone\nZONE\n T="a block, VARIABLES="\n'
    head += f" STRANDID=0, SOLUTIONTIME=0\n Nodes={len(points)}, Elements={len(cells)}, ZONETYPE=FETetrahedron\n"
    head += (
        ' DATAPACKING=BLOCK\n AUXDATA Key="1 2 3"\n VARLOCATION=([4]=CELLCENTERED, [5]=NODAL)\n DT=(DOUBLE DOUBLE)\n'
    )
    variables = [*numbers(points).T, numbers(np.arange(len(cells)) / 7)[:, 0], numbers(points[:, 0])[:, 0]]
    path.write_text(head + "".join(map(wrapped, variables)) + rows(cells + 1))


def zones(path: Path) -> None:
    """Two zones, the second of the same points; a text between them; and a block of points beside them."""
    points, cells = shapes.plate()
    cells = cells[np.argsort(material(points, cells), kind="stable")]
    half = int((material(points, cells) == 1).sum())
    keys = f"N={len(points)} DATAPACKING=POINT ZONETYPE=FETRIANGLE"
    text = f'VARIABLES = x y\nZONE T="left" E={half} {keys}\n{rows(numbers(points[:, :2]))}{rows(cells[:half] + 1)}'
    text += 'TEXT X=5, Y=90, T="ZONE of a note"\n'
    text += f'ZONE T="right" E={len(cells) - half} {keys} VARSHARELIST=([1,2]=1)\n{rows(cells[half:] + 1)}'
    path.write_text(text + "ZONE I=3, J=2, F=BLOCK\n90 91 92 90 91 92\n0 0 0 1 1 1\n")


FILES: dict[str, Callable[[Path], None]] = {
    "points.tec": by_points, "variables.dat": by_variables, "zones.plt": zones,
}  # fmt: skip


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other words."""
    text = re.sub(r"(?m)^#.*", "", path.read_text())
    heads = [*re.finditer(r"(?is)(?:title.*?)?(?:variables.*?)?^\s*zone.*?(?=^\d|^-)", text, re.MULTILINE)]
    words = [text[a.end() : b].split() for a, b in zip(heads, [*(h.start() for h in heads[1:]), None], strict=True)]
    rest: list[Any] = [head[0] for head in heads]
    if "points" in path.name:
        n = len(shapes.plate()[0])
        table = np.array(words[0][: 3 * n], dtype=float).reshape(n, 3)
        return np.column_stack([table[:, 1:], 0 * table[:, 0]]), {
            "rest": [*rest, table[:, 0].tolist(), words[0][3 * n :]]
        }
    if "zones" in path.name:
        n = len(shapes.plate()[0])
        flat = [words[0][: 2 * n], words[2][:12]]
        first, last = np.array(flat[0], dtype=float).reshape(n, 2), np.array(flat[1], dtype=float).reshape(2, -1).T
        points = np.concatenate([first, last])
        return np.column_stack([points, 0 * points[:, 0]]), {
            "rest": [*rest, words[0][2 * n :], words[1], words[2][12:]]
        }
    n = len(shapes.block()[0])
    return np.array(words[0][: 3 * n], dtype=float).reshape(3, n).T, {"rest": [*rest, words[0][3 * n :]]}
