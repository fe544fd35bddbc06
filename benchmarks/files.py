"""Seconds to write a mesh back: `make bench`, or `python benchmarks/files.py [--tets N]`.

Each file is read once; then meshfix puts all coordinates of free vertices into its bytes, and meshio writes the same
mesh in the same format. Both write to the same disk, in turns; the best of several runs. What meshfix wrote is compared
with the original, byte by byte outside the coordinates, and is read by meshio.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from meshfix_cli import perturb, read, write

sys.path.insert(0, str(Path(__file__).parents[1] / "sample_meshes"))
import generate

VARIANTS = {
    "vtk, text": ("vtk42", {"binary": False}),
    "vtk, binary": ("vtk42", {"binary": True}),
    "msh 2.2, text": ("gmsh22", {"binary": False}),
    "msh 4.1, text": ("gmsh", {"binary": False}),
    "vtu, binary": ("vtu", {"binary": True}),
    "inp": ("abaqus", {}),
}


def seconds(work: Callable[[], object]) -> float:
    """Return the wall time of one call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def check(before: bytes, path: Path, points: NDArray[Any], tets: NDArray[Any]) -> None:
    """Raise AssertionError unless the coordinates are the points, and nothing else in the file has changed."""
    mesh, after = meshio.read(path), path.read_bytes()
    assert (mesh.points == points).all()
    assert (mesh.cells[0].data == tets).all()
    if path.suffix == ".vtu":
        return  # compressed
    same, length = np.frombuffer(before, np.uint8), min(len(before), len(after))
    other = np.frombuffer(after, np.uint8)
    first = int((same[:length] != other[:length]).argmax())
    last = int((same[::-1][:length] != other[::-1][:length]).argmax())
    changed = [data[first : len(data) - last] for data in (before, after)]
    binary = b"\0" in before
    assert len(changed[0]) <= points.nbytes if binary else len(changed[0].split()) <= 4 * len(points)
    assert len(changed[0]) == len(changed[1]) if binary else len(changed[0].split()) == len(changed[1].split())


def main() -> None:
    """Print one row for each format."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tets", type=int, default=1_000_000, help="about so many")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    layers = max(2, round(18 * (options.tets / 1e6) ** (1 / 3)))
    points, tets = generate.bracket(math.sqrt(layers / (29600 / 1e6 * options.tets)), layers)
    mesh = meshio.Mesh(points, [("tetra", tets)], cell_data={"gmsh:physical": [tets[:, 0] * 0 + 1]})
    mesh.cell_data["gmsh:geometrical"] = mesh.cell_data["gmsh:physical"]
    table = Table(
        "file", "MB", "read", "meshfix writes", "meshio writes", "ratio", title=f"seconds, {len(tets):,} tets"
    )
    with tempfile.TemporaryDirectory() as folder:
        for name, (form, kind) in VARIANTS.items():
            path = Path(folder) / f"mesh.{name.split(',')[0].split()[0]}"
            meshio.write(path, mesh, file_format=form, **kind)
            original = path.read_bytes()
            start = time.perf_counter()
            document = read(path)
            reading = time.perf_counter() - start
            moved, _ = perturb(document.mesh, 100, 0.01 * document.mesh.mean_edge_length())
            write(document, moved, path)
            check(original, path, document.file_points(moved), document.parts[0].vertices)
            ours, theirs = [], []
            for _ in range(options.repeats):
                ours.append(seconds(lambda: write(document, moved, path)))  # noqa: B023
                theirs.append(seconds(lambda: meshio.write(path, mesh, file_format=form, **kind)))  # noqa: B023
            figures = [path.stat().st_size / 1e6, reading, min(ours), min(theirs), min(theirs) / min(ours)]
            table.add_row(name, *(f"{figure:.2f}" for figure in figures))
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
