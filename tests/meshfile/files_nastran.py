"""Decks of Nastran as programs write them and as people do, and a reader of our own, line by line."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, surface
from numpy.typing import NDArray
from programs import gmsh_session

NAMES = {3: "CTRIA3", 4: "CTETRA"}


def real(x: float, columns: int = 8) -> str:
    """As Nastran tells numbers: with a point, and as many digits as the columns hold."""
    for digits in range(15, 0, -1):
        text = re.sub(r"^(-?)0(\.\d)", r"\1\2", f"{x:.{digits}f}".rstrip("0"))
        if len(text) <= columns:
            return text
    raise AssertionError(x)


def elements(points: NDArray[np.float64], cells: NDArray[np.int64], first: int = 1, between: str = ",") -> str:
    """Elements of two properties; between commas, or in columns."""
    rows = enumerate(zip(material(points, cells), cells + 1, strict=True), first)
    fields = [[NAMES[cells.shape[1]], *map(str, (number, pid, *cell))] for number, (pid, cell) in rows]
    return "".join((between.join(row) if between else "".join(f"{one:<8}" for one in row)) + "\n" for row in fields)


def by_gmsh(path: Path, form: int, plane: bool = False) -> None:
    points, cells = shapes.plate() if plane else shapes.block()
    with gmsh_session(SaveAll=1, BdfFieldFormat=form) as gmsh:
        dimension = cells.shape[1] - 1
        for d, simplices in ((dimension - 1, surface(cells)), (dimension, cells)):
            tag = gmsh.model.addDiscreteEntity(d)
            if d == dimension - 1:
                gmsh.model.mesh.addNodes(d, tag, np.arange(1, len(points) + 1), points.ravel())
            gmsh.model.mesh.addElementsByType(tag, {1: 1, 2: 2, 3: 4}[d], [], (simplices + 1).ravel())
        gmsh.write(str(path))


def by_meshio(path: Path, **options: str) -> None:
    import meshio

    points, cells = shapes.block()
    meshio.write(
        path, meshio.Mesh(points, [("tetra", cells)], cell_data={"nastran:ref": [material(points, cells)]}),
        file_format="nastran", **options,
    )  # fmt: skip


def flat(path: Path) -> None:
    """By hand: free fields, no third coordinate, executive control, comments, ends of lines of Windows."""
    points, cells = shapes.plate()
    grids = "".join(f"GRID,{i},,{x:.6f},{y:.6f} $ {i}\n" for i, (x, y, _) in enumerate(points, 1))
    text = f"ID A, B\nSOL 101\nCEND\n  SPC = 1\nBEGIN BULK\n$ {'-' * 20}\nMAT1,1,2.1+11,,0.3\n{grids}"
    text += elements(points, cells) + "SPC1,1,123456,1,THRU,3\nFORCE,1,1,,1.0,1.,0.,0.\nENDDATA\nGRID,1,,0.,0.,0.\n"
    path.write_bytes(text.replace("\n", "\r\n").encode())


def tabs(path: Path) -> None:
    """By hand: tabs from field to field, small letters, points and elements in turn."""
    points, cells = shapes.plate()
    grids = [f"grid\t{10 * i}\t\t{x:.4f}\t{y:.4f}\t0.\n" for i, (x, y, _) in enumerate(points, 1)]
    rows = [f"ctria3\t{i}\t1\t" + "\t".join(map(str, 10 * (row + 1))) + "\n" for i, row in enumerate(cells, 1)]
    path.write_text("begin bulk\n" + "".join(grids[:5]) + "".join(rows) + "".join(grids[5:]) + "enddata\n")


def widths(path: Path) -> None:
    """By hand: coordinates in small and in large fields and between commas, some at the end of their lines."""
    points, cells = shapes.block()
    lines = []
    for i, p in enumerate(points, 1):
        if i % 3 == 0:
            x, y, z = (f"{real(c, 16):>16}" for c in p)
            lines.append(f"GRID*   {i:<16}{'':16}{x}{y}*G{i}\n$ between\n*G{i:<6}{z}\n")
        elif i % 3 == 1:
            x, y, z = (f"{real(c):>8}" for c in p)
            lines.append(f"GRID    {i:<8}{'':8}{x}{y}{z if i % 2 else z.strip()}\n")
        else:
            lines.append(f"GRID, {i}, , " + ", ".join(map(real, p)) + ",,\n")
    rigid = f"RBE2    {90001:8}{1:8}{'123456':>8}{2:8}{3:8}{4:8}{5:8}{6:8}+       \n+       {7:8}\n"
    path.write_text("".join(lines) + elements(points, cells, between="") + rigid)


FILES: dict[str, Callable[[Path], None]] = {
    "free.bdf": partial(by_gmsh, form=0, plane=True),
    "small.bdf": partial(by_gmsh, form=1),
    "large.nas": partial(by_gmsh, form=2),
    "meshio.bdf": by_meshio,
    "meshio.fem": partial(by_meshio, point_format="fixed-small"),
    "flat.dat": flat,
    "tabs.dat": tabs,
    "widths.blk": widths,
}
PADDED = {"small.bdf", "large.nas", "meshio.bdf", "meshio.fem", "tabs.dat", "widths.blk"}


def fields(data: bytes) -> list[bytes]:
    """The data, in pieces: a field, of all its columns, or what stands between fields."""
    found: list[bytes] = []
    for line in data.expandtabs(8).splitlines(keepends=True):
        text = line.rstrip(b"\r\n")
        body, dollar, comment = text.partition(b"$")
        found += re.split(rb"([\s,]+)", body) if b"," in body else columns(body)
        found.append(dollar + comment + line[len(text) :])
    assert b"".join(found) == data.expandtabs(8)
    return found


def columns(line: bytes) -> list[bytes]:
    width = 16 if b"*" in line[:8] else 8
    return [line[:8], *(line[at : at + width] for at in range(8, max(len(line), 72), width))]


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all that is no coordinate, field by field; what follows ENDDATA is one text."""
    bulk, end, behind = re.split(r"(?im)(^enddata)", path.read_bytes().decode() + "\nenddata", maxsplit=1)
    points, rest, left = [], [behind], 0
    for line in bulk.expandtabs(8).splitlines():
        text, _, comment = line.partition("$")
        words = [one.strip() for one in (text.split(",") if "," in text else map(bytes.decode, columns(text.encode())))]
        words += [""] * (6 - len(words))
        if words[0].upper() in ("GRID", "GRID*"):
            large = words[0].endswith("*")
            left = 1 if large else 0
            here, words = (words[3:5], words[:3] + words[5:]) if large else (words[3:6], words[:3] + words[6:])
            points.append([number(word) for word in here])
        elif left and words[0].startswith("*"):
            points[-1].append(number(words.pop(1)))
            left = 0
        rest.append(str([word for word in (*words, comment) if word]))
    return np.array(points), {"rest": rest, "end": end}


def number(word: str) -> float:
    return float(re.sub(r"(?<=[\d.])([+-])", r"e\1", word)) if word else 0.0
