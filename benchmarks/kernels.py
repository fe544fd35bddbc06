"""Microseconds per vertex of each move: `make bench`, or `python benchmarks/kernels.py [MESH]`.

One thread; the best of several runs, each from the same positions. LP and Laplacian steps start from a perturbed
mesh, smoothing steps from the mesh that one untangling has made of it, as in use.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

from meshfix_cli import _kernels, perturb, read, untangle
from meshfix_cli.mesh import Mesh
from meshfix_cli.untangle import THRESHOLD, Move

sys.path.insert(0, str(Path(__file__).parents[1] / "sample_meshes"))
import generate

TARGETS = {Move.LAPLACIAN: 0.05, Move.UNTANGLE: 1.5, Move.COMBINED_SMOOTH: 1.5}  # in 3-D, microseconds


def microseconds(mesh: Mesh, move: Move, repeats: int) -> float:
    """Return the best time per visited vertex."""
    threshold = math.sin(math.radians(THRESHOLD[mesh.dimension])) ** 2
    stars, best = mesh.topology.stars(), math.inf
    start_points, movable = mesh.along_curve(mesh.points), mesh.along_curve(mesh.movable)
    for _ in range(repeats):
        points, visited = start_points.copy(), 0
        start = time.perf_counter()
        for blocks in mesh.topology.colours:
            visited += _kernels.relocate(
                move, points, movable, stars, blocks, threshold, -math.inf, start_points, math.inf, 1
            )[0]
        best = min(best, (time.perf_counter() - start) / max(visited, 1))
    return best * 1e6


def main() -> None:
    """Print one table for a 2-D and a 3-D mesh."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh", nargs="?", help="a valid mesh; default: generated ones")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    meshes = [read(options.mesh).mesh] if options.mesh else []
    meshes = meshes or [Mesh.build(*generate.plate(0.012)), Mesh.build(*generate.bracket(0.045, 12))]
    table = Table("step", "mesh", "us per vertex", "target", title="kernels, one thread")
    for mesh in meshes:
        tangled, _ = perturb(mesh, 25, mesh.mean_edge_length())
        outcome = untangle(tangled, smooth=0)
        name = f"{mesh.dimension}-D, {len(mesh.topology.simplices):,} elements, {int(mesh.movable.sum()):,} free"
        for move in Move:
            start = tangled if move <= Move.COMBINED_UNTANGLE else outcome.after
            target = TARGETS.get(move) if mesh.dimension == 3 else None
            figure = f"{microseconds(start, move, options.repeats):.3f}"
            table.add_row(move.name.lower(), name, figure, f"{target:g}" if target else "")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
