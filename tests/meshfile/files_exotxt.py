"""Exodus files as text in the columns in which exotxt writes them, and a reader of our own, line by line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_exodus import SIDES_OF_TETRAHEDRA, halves
from files_medit import surface
from numpy.typing import NDArray

Blocks = Sequence[tuple[int, str, NDArray[np.int64]]]


def tens(values: Sequence[int], width: int = 10) -> list[str]:
    """Eight numbers to a line."""
    return ["".join(f"{one:{width}}" for one in values[at : at + 8]) for at in range(0, len(values), 8)]


def file(
    points: NDArray[np.float64],
    blocks: Blocks,
    nodes: dict[int, Sequence[int]] | None = None,
    sides: dict[int, Sequence[tuple[int, int]]] | None = None,
    numbers: Sequence[int] = (),
    wide: bool = True,
) -> str:
    """Numbers from 1; without columns, where not wide, as people write them."""
    nodes, sides = nodes or {}, sides or {}
    n, m, d = len(points), sum(len(cells) for _, _, cells in blocks), points.shape[1]
    lines = ["! Database Title                             exotxt", "a mesh", "! Database initial variables"]
    lines += [f"{d:10}{4.98:10.2f}{32:10}     ! dimensions, version number, name length"]
    lines += [f"{n:10}{m:10}{len(blocks):10}     ! nodes, elements, element blocks"]
    lines += [f"{len(nodes):10}{len(sides):10}               ! #node sets, #side sets"]
    lines += [f"{0:10}{0:10}               ! len: node set list, dist fact length"]
    lines += [f"{0:10}{0:10}{0:10}     ! side sets len: element, node , dist fact"]
    lines += ["! Coordinate names", " ".join(axis.ljust(32) for axis in "xyz"[:d]), "! Coordinates"]
    lines += ["".join(f"{x:16.7E}" for x in p) if wide else " ".join(f"{x:g}" for x in p) for p in points]
    lines += ["! Node number map", "sequence 1..numnp", "! Element number map"]
    lines += ["explicit map", *tens(numbers)] if numbers else ["sequence 1..numel"]
    lines += ["! Element order map", "sequence 1..numel"]
    for i, (number, name, cells) in enumerate(blocks, start=1):
        lines += [f"! Element block{i:5}", f"{number:10}{len(cells):10}      {name}      ! ID, elements, element type"]
        lines += [f"{cells.shape[1]:10}{1:10}      ! nodes per element, attributes", "! Connectivity"]
        for row in (cells + 1).tolist():
            lines += tens(row) if wide else [" ".join(map(str, row))]
        lines += ["! Attributes", *(f"{1.5:16.7E}" for _ in cells)]
    lines += [f"! Node sets                  {len(nodes):10}"]
    for i, (number, members) in enumerate(nodes.items(), start=1):
        lines += [
            f"! Nodal point set{i:10}",
            f"{number:10}{len(members):10}{len(members):10}      ! ID, nodes, dist factors",
        ]
        lines += [f"{one:10}  {1:16.7E}" for one in members]
    lines += [
        f"! Number of Side Sets{len(sides):7}",
        f"{0:10}{0:10}{0:10}    ! Element list, Node list, Dist Fact lengths",
    ]
    for number, listed in sides.items():
        lines += [f"{number:10}{len(listed):10}{0:10}{0:10}    ! ID, #sides, #nodes, #dist fact"]
        lines += ["! Elements and sides for side sets"]
        pairs = [f"{one:10} {side} " for one, side in listed]
        lines += ["".join(pairs[at : at + 6]) for at in range(0, len(pairs), 6)]
        lines += ["! Nodes and Distribution Factors for side sets"]
    return "\n".join([*lines, "! Properties", f"{0:10}            ! Number of ELEMENT BLOCK Properties", ""])


def solid(path: Path) -> None:
    """Two blocks of tetrahedra, sets of sides and nodes, and numbers of elements."""
    points, cells = shapes.block()
    inner, outer = halves(points, cells)
    both, skin = np.concatenate([inner, outer]), {tuple(sorted(facet)) for facet in surface(cells).tolist()}
    sides = []
    for i, cell in enumerate(both.tolist(), 1):
        for side, corners in enumerate(SIDES_OF_TETRAHEDRA, 1):
            if tuple(sorted(cell[one] for one in corners)) in skin:
                sides.append((i, side))
    blocks = [(10, "TETRA4", inner), (20, "tet", outer)]
    numbers = [3 * i for i in range(1, len(both) + 1)]
    path.write_text(file(points, blocks, {7: [1, 2, 3]}, {4: sides}, numbers))


def plane(path: Path, wide: bool = True, newline: str = "\n") -> None:
    points, cells = shapes.plate()
    path.write_bytes(file(points[:, :2], [(1, "TRI3", cells)], wide=wide).replace("\n", newline).encode())


FILES: dict[str, Callable[[Path], None]] = {
    "solid.exotxt": solid,
    "plane.exotxt": partial(plane, newline="\r\n"),
    "free.exotxt": partial(plane, wide=False),
}
PADDED = {"solid.exotxt", "plane.exotxt"}


def fields(data: bytes) -> list[bytes]:
    """The data, in pieces: a coordinate, of all its columns, or what is none."""
    found: list[bytes] = []
    inside = False
    for line in data.splitlines(keepends=True):
        inside = (inside and not line.startswith(b"!")) or line.startswith(b"! Coordinates")
        if inside and not line.startswith(b"!"):
            end = len(line.rstrip())
            found += [*(line[at : at + 16] for at in range(0, end, 16)), line[end:]]
        else:
            found.append(line)
    return found


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other lines."""
    before, _, rest = path.read_text().partition("! Coordinates\n")
    listed, _, after = rest.partition("! Node number map")
    points = np.array([line.split() for line in listed.splitlines()], dtype=float)
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))]), {"rest": [before, after]}
