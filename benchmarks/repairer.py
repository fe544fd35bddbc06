"""A mesh that moves in a loop: `python benchmarks/repairer.py [--sizes H ...] [--steps N]`, part of `make bench`.

A call of a `Repairer`, which holds the mesh, beside one of `untangle` on the same points, which builds it anew and
tells how good it is: seconds, the median over some steps, for points that tangle nothing and for those that do.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

import meshio
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from meshfix_cli import Mesh, Repairer, perturb, untangle

sys.path.insert(0, str(Path(__file__).parents[1] / "sample_meshes"))
import generate

THICKNESS = 0.75  # of the bracket, by 0.8
CASES = {"nothing is inverted": 0.0, "1 percent moved by 2h": 1.0, "25 percent moved by 2h": 25.0}


def seconds(call: Callable[[NDArray[np.float64]], object], steps: list[NDArray[np.float64]]) -> float:
    """Return the median of what a call takes."""
    taken = []
    for points in steps:
        start = time.perf_counter()
        call(points)
        taken.append(time.perf_counter() - start)
    return median(taken)


def main() -> None:
    """Print a table for each size, and a row for each case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sizes", type=float, nargs="+", default=[0.18, 0.055], help="of the edges of a bracket")
    parser.add_argument("--steps", type=int, default=5)
    options = parser.parse_args()
    for size in options.sizes:
        mesh = Mesh.build(*generate.bracket(size, round(THICKNESS / size)))
        cells = [("tetra", mesh.topology.simplices)]
        repair = Repairer(meshio.Mesh(mesh.points, cells))
        title = f"{mesh.topology.m:,} tetrahedra, seconds a call, one thread"
        table = Table("points", "untangle", "Repairer", "ratio", title=title)
        for name, percent in CASES.items():
            steps = [perturb(mesh, percent, "2h", seed)[0].points for seed in range(options.steps)]
            anew = seconds(partial(_anew, cells), steps)
            held = seconds(repair, steps)
            table.add_row(name, f"{anew:.4f}", f"{held:.4f}", f"{anew / held:.1f}")
        Console(width=100).print(table)


def _anew(cells: list[tuple[str, NDArray[np.int32]]], points: NDArray[np.float64]) -> object:
    return untangle(meshio.Mesh(points, cells))


if __name__ == "__main__":
    main()
