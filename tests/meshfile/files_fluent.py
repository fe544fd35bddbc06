"""Files of Ansys Fluent as programs write them, in text and binary, and a reader of our own."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import ELEMENTS

Blocks = Sequence[tuple[str, NDArray[np.integer[Any]]]]
Face = tuple[list[int], int, int]


def faces(blocks: Blocks) -> list[Face]:
    """Nodes and both cells of each face, all from 1; a cell has the nodes of its faces so that it lies behind them."""
    found: dict[tuple[int, ...], Face] = {}
    number = 0
    for key, rows in blocks:
        for row in (rows + 1).tolist():
            number += 1
            for facet in ELEMENTS[key].shape.facets:
                nodes = [row[i] for i in facet]
                mark = tuple(sorted(nodes))
                nodes = nodes if len(nodes) == 2 else nodes[::-1]
                found[mark] = (found[mark][0], found[mark][1], number) if mark in found else (nodes, number, 0)
    return list(found.values())


def hexes(values: Sequence[int]) -> str:
    return " ".join(f"{value:x}" for value in values)


def text(
    points: NDArray[np.float64], blocks: Blocks, parts: NDArray[np.int64], mixed: bool = False, binary: bool = False
) -> bytes:
    """Write inner faces, and the boundary in two zones; cells of the first part come first."""
    n, m, d = len(points), sum(len(rows) for _, rows in blocks), points.shape[1]
    listed = faces(blocks)
    inner = [one for one in listed if one[2]]
    outer = [one for one in listed if not one[2]]
    half = len(outer) // 2
    first = int((parts == 1).sum())
    out = [
        b'(0 "made (here)")\n(2 %d)\n' % d,
        f"(10 (0 1 {n:x} 0))\n(12 (0 1 {m:x} 0))\n(13 (0 1 {len(listed):x} 0))\n".encode(),
    ]
    head = f"(1 1 {n:x} 1 {d})("
    if binary:
        out.append(b"(3010 " + head.encode() + points.astype("<f8").tobytes() + b")\nEnd of Binary Section   3010)\n")
    else:
        nodes = "".join(" ".join(f"{x:.9e}" for x in p) + "\n" for p in points)
        out.append(f"(10 {head}\n{nodes}))\n".encode())
    out.append(f"(12 (2 1 {first:x} 1 {0 if mixed else 2}))\n".encode())
    if first < m:
        out.append(f"(12 (a {first + 1:x} {m:x} 1 2))\n".encode())
    at = 1
    for zone, kind, some in ((3, 2, inner), (4, 3, outer[:half]), (0xB, 0x24, outer[half:])):
        size = 0 if mixed else len(some[0][0])
        zones = f"({zone:x} {at:x} {at + len(some) - 1:x} {kind:x} {size:x})("
        rows = [[*([len(nodes)] * mixed), *nodes, one, other] for nodes, one, other in some]
        if binary:
            data = np.array([value for row in rows for value in row], dtype="<i4").tobytes()
            out.append(b"(2013 " + zones.encode() + data + b")\nEnd of Binary Section   2013)\n")
        else:
            out.append(f"(13 {zones}\n{''.join(hexes(row) + chr(10) for row in rows)}))\n".encode())
        at += len(some)
    names = "(45 (2 fluid steel)())\n(39 (10 solid copper 1)(\n (material . air)\n))\n"
    names += "(45 (4 wall left)())\n(45 (11 wall right)())\n"
    return b"".join([*out, names.encode()])


def by_parts(points: NDArray[np.float64], cells: NDArray[np.int64]) -> tuple[Any, Any]:
    parts = material(points, cells)
    order = np.argsort(parts, kind="stable")
    return cells[order], parts[order]


def solid(path: Path) -> None:
    points, cells = shapes.block()
    cells, parts = by_parts(points, cells)
    path.write_bytes(text(points, [("tetra", cells)], parts, mixed=True))


def plane(path: Path) -> None:
    points, cells = shapes.plate()
    cells, parts = by_parts(points, cells)
    path.write_bytes(text(points[:, :2], [("triangle", cells)], parts).replace(b"\n", b"\r\n"))


def binary(path: Path) -> None:
    points, cells = shapes.block()
    path.write_bytes(text(points, [("tetra", cells)], np.ones(len(cells), dtype=np.int64), binary=True))


FILES: dict[str, Callable[[Path], None]] = {"solid.cas": solid, "plane.msh": plane, "binary.cas": binary}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all other bytes."""
    data = path.read_bytes()
    head = re.search(rb"\((?:30)?10 \(1 1 ([0-9a-f]+) 1 ([23])\)\(", data)
    assert head is not None
    n, d = int(head[1], 16), int(head[2])
    if data[head.start() + 1 :].startswith(b"3010"):
        end = head.end() + 8 * n * d
        points = np.frombuffer(data[head.end() : end], dtype="<f8").reshape(n, d)
    else:
        end = data.index(b")", head.end())
        points = np.array(data[head.end() : end].split(), dtype=float).reshape(n, d)
    return np.column_stack([points, np.zeros((n, 3 - d))]), {"rest": data[: head.end()] + data[end:]}
