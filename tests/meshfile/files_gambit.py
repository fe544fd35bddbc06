"""Neutral files of Gambit as it writes them, and a reader of our own, line by line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, surface
from numpy.typing import NDArray

TYPES = {3: 3, 4: 6}  # of simplices, by the number of their points


def section(name: str, lines: Sequence[str]) -> str:
    return "\n".join([f"{name:>20} 2.4.6", *lines, "ENDOFSECTION\n"])


def eights(values: Sequence[int]) -> list[str]:
    return ["".join(f"{value:8}" for value in values[at : at + 10]) for at in range(0, len(values), 10)]


def element(number: int, kind: int, nodes: Sequence[int]) -> list[str]:
    """Seven points to a line."""
    words = [f"{node:8}" for node in nodes]
    lines = ["".join(words[at : at + 7]) for at in range(0, len(words), 7)]
    return [f"{number:8} {kind:2} {len(nodes):2} {lines[0]}", *(f"{'':15}{line}" for line in lines[1:])]


def file(points: NDArray[np.float64], elements: Sequence[tuple[int, Sequence[int]]], others: Sequence[str] = ()) -> str:
    """Types and points, from 1, of elements; and other sections."""
    n, m, d = len(points), len(elements), points.shape[1]
    groups = sum("GROUP:" in one for one in others)
    head = [
        "** GAMBIT NEUTRAL FILE",
        "a mesh",
        "PROGRAM:                Gambit     VERSION:  2.4.6",
        "30 Nov 2026    10:00:00",
    ]
    head += ["     NUMNP     NELEM     NGRPS    NBSETS     NDFCD     NDFVL"]
    head += ["".join(f"{one:10}" for one in (n, m, groups, len(others) - groups, d, d))]
    nodes = [f"{i:10}" + "".join(f"{x:20.11e}" for x in p) for i, p in enumerate(points, 1)]
    listed = [line for i, (kind, row) in enumerate(elements, 1) for line in element(i, kind, row)]
    return (
        section("CONTROL INFO", head)
        + section("NODAL COORDINATES", nodes)
        + section("ELEMENTS/CELLS", listed)
        + "".join(others)
    )


def group(number: int, name: str, members: Sequence[int]) -> str:
    head = f"GROUP: {number:10} ELEMENTS: {len(members):10} MATERIAL: {2:10} NFLAGS: {1:10}"
    return section("ELEMENT GROUP", [head, f"{name:>32}", f"{0:8}", *eights(members)])


def condition(name: str, of_faces: bool, listed: Sequence[Sequence[int]]) -> str:
    head = f"{name:>32}{int(of_faces):8}{len(listed):8}{0:8}{6:8}"
    return section("BOUNDARY CONDITIONS", [head, *("".join(f"{one:10}" for one in row) for row in listed)])


def plain(points: NDArray[np.float64], cells: NDArray[np.int64]) -> list[tuple[int, list[int]]]:
    return [(TYPES[cells.shape[1]], row) for row in (cells + 1).tolist()]


def solid(path: Path) -> None:
    """Two groups, some faces of the boundary, and points."""
    points, cells = shapes.block()
    parts = material(points, cells)
    groups = [group(i, name, (np.flatnonzero(parts == i) + 1).tolist()) for i, name in ((1, "fluid"), (2, "a solid"))]
    skin = {tuple(sorted(facet)) for facet in surface(cells).tolist()}
    listed = []
    for i, cell in enumerate(cells.tolist(), 1):
        for face, corners in enumerate(((1, 0, 2), (0, 1, 3), (1, 2, 3), (2, 0, 3)), 1):
            if tuple(sorted(cell[one] for one in corners)) in skin:
                listed.append([i, 6, face])
    conditions = [condition("wall", True, listed), condition("tips", False, [[1], [2]])]
    path.write_text(file(points, plain(points, cells), [*groups, *conditions]))


def plane(path: Path) -> None:
    points, cells = shapes.plate()
    text = file(points[:, :2], plain(points, cells), [group(1, "sheet", range(1, len(cells) + 1))])
    path.write_bytes((text + section("TIMESTEPDATA", ["1 2 3"])).replace("\n", "\r\n").encode())


FILES: dict[str, Callable[[Path], None]] = {"solid.neu": solid, "plane.neu": plane}
PADDED = set(FILES)


def fields(data: bytes) -> list[bytes]:
    """The data, in pieces: a coordinate, of all its columns, or what is none."""
    found: list[bytes] = []
    inside = False
    for line in data.splitlines(keepends=True):
        inside = (inside or b"NODAL" in line) and b"ENDOF" not in line
        if inside and b"NODAL" not in line:
            end = len(line.rstrip())
            found += [line[:10], *(line[at : at + 20] for at in range(10, end, 20)), line[end:]]
        else:
            found.append(line)
    assert b"".join(found) == data
    return found


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other lines."""
    before, _, nodes = path.read_text().partition("NODAL COORDINATES 2.4.6\n")
    nodes, _, after = nodes.partition("ENDOFSECTION")
    words = [line.split() for line in nodes.splitlines()]
    points = np.array([row[1:] for row in words], dtype=float)
    rest = {"rest": [before, after, [row[0] for row in words]]}
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))]), rest
