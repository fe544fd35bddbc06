"""UCD files of AVS as programs write them, and a reader of our own, line by line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from files_medit import material, surface
from numpy.typing import NDArray

TYPES = {1: "pt", 2: "line", 3: "tri", 4: "tet"}


def cells_of(blocks: list[tuple[NDArray[np.int64], NDArray[np.int64]]], between: str = " ") -> list[str]:
    """Lines of simplices, each block with the materials of its cells, numbered on and on."""
    rows = [(kind, of, row) for block, materials in blocks for kind, of, row in
            zip([TYPES[block.shape[1]]] * len(block), materials, block + 1, strict=True)]  # fmt: skip
    return [between.join(map(str, (i, of, kind, *row))) for i, (kind, of, row) in enumerate(rows, 1)]


def plane(path: Path) -> None:
    """As converters write it: comments, tabs, and lines on the boundary."""
    points, cells = shapes.plate()
    lines = cells_of([(cells, material(points, cells)), (surface(cells), 7 + np.arange(len(surface(cells))) % 2)], "\t")
    nodes = [f"{i}\t" + "\t".join(f"{x: .8e}" for x in p) + "\t" for i, p in enumerate(points, 1)]
    head = ["# FEM Mesh Converter", "# Mesh type: AVS UCD", f"{len(nodes)}\t{len(lines)}\t0\t0\t0"]
    path.write_bytes("\r\n".join([*head, *nodes, *(line + "\t" for line in lines), ""]).encode())


def solid(path: Path) -> None:
    """By hand: numbers of points in another order, facets, and data of points and cells."""
    points, cells = shapes.block()
    order = np.random.default_rng(1).permutation(len(points))
    lines = cells_of([(surface(cells), np.full(len(surface(cells)), -1)), (cells, material(points, cells))])
    nodes = [f"{i + 1:10d} " + " ".join(f"{x:19.12E}" for x in points[i]) for i in order.tolist()]
    data = ["1 1", "temperature, K", *(f"{i + 1} {i / 7:.6f}" for i in range(len(points)))]
    data += ["2 1 1", "a,", "b,", *(f"{i + 1} {i} 0.5" for i in range(len(lines)))]
    path.write_text("\n".join([f"{len(nodes)} {len(lines)} 1 2 0", *nodes, "", *lines, *data, ""]))


def steps(path: Path) -> None:
    """As solvers write results: two steps, of which only the data differ."""
    points, cells = shapes.block()
    lines = cells_of([(cells, material(points, cells))])
    nodes = [f"{i} {x:.6f} {y:.6f} {z:.6f}" for i, (x, y, z) in enumerate(points.tolist(), 1)]
    data = ["1 0", "1 1", "u, m", *(f"{i} 0.5" for i in range(1, len(points) + 1))]
    head = ["2", "data", "step1", f"{len(nodes)} {len(lines)}"]
    path.write_text("\n".join([*head, *nodes, *lines, *data, "step2", *data, ""]))


def meshio(path: Path) -> None:
    import meshio

    points, cells = shapes.block()
    blocks = [("triangle", surface(cells)), ("tetra", cells)]
    data = {"avsucd:material": [np.ones(len(surface(cells)), dtype=int), material(points, cells)]}
    meshio.Mesh(points, blocks, {"t": points[:, 0]}, data).write(path, file_format="avsucd")


FILES: dict[str, Callable[[Path], None]] = {
    "plane.ucd": plane,
    "solid.inp": solid,
    "steps.inp": steps,
    "meshio.avs": meshio,
}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), and all words of all other lines."""
    lines = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    start = next(i for i, words in enumerate(lines) if len(words) > 1)
    end = start + 1 + int(lines[start][0])
    points = np.array([[float(x) for x in words[1:4]] for words in lines[start + 1 : end]])
    numbers = [words[:1] + words[4:] for words in lines[start + 1 : end]]
    return points, {"numbers": numbers, "rest": lines[: start + 1] + lines[end:]}
