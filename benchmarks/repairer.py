"""A mesh that moves in a loop: `python benchmarks/repairer.py [--tets N] [--steps N]`, part of `make bench`.

A call of a `Repairer`, which holds the mesh, beside one of `untangle` on the same points, which builds it anew and tells
how good it is: seconds, the median over some steps, for points that tangle nothing and for those that do.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from statistics import median

import meshio
import numpy as np
from box import box
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from meshfix_cli import Mesh, Repairer, perturb, untangle

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
    """Print a row for each case."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tets", type=int, default=100_000)
    parser.add_argument("--steps", type=int, default=5)
    options = parser.parse_args()
    points, tets = box(options.tets)
    mesh = Mesh.build(points, tets)
    repair = Repairer(meshio.Mesh(points, [("tetra", tets)]))
    title = f"{len(tets):,} tetrahedra, seconds a call, one thread"
    table = Table("points", "untangle", "Repairer", "ratio", title=title)
    for name, percent in CASES.items():
        steps = [perturb(mesh, percent, "2h", seed)[0].points for seed in range(options.steps)]
        anew = seconds(lambda moved: untangle(meshio.Mesh(moved, [("tetra", tets)])), steps)
        held = seconds(repair, steps)
        table.add_row(name, f"{anew:.4f}", f"{held:.4f}", f"{anew / held:.1f}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
