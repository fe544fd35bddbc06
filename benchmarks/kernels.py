"""Nanoseconds per vertex of each move, per fixed facet of the search for what crosses and folds, per element judged.

`make bench`, or `python benchmarks/kernels.py [MESH]`.

CPU time of one thread; the best of several runs, each from the same positions. LP and Laplacian steps start from a
perturbed mesh, smoothing steps from the mesh that one untangling has made of it, as in use. Beside them the bound that
memory sets: the bytes that a sweep must read and write, each once, at the speed of a copy of large arrays in the same
run.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

import numpy as np
from elements import box_of_hexahedra, box_of_wedges_and_tets
from rich.console import Console
from rich.table import Table

from meshfix_cli import kernels, perturb, read, untangle
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.solve.strategies import THRESHOLD, Move

sys.path.insert(0, str(Path(__file__).parents[1] / "sample_meshes"))
import generate

TARGETS = {Move.LAPLACIAN: 50, Move.UNTANGLE: 1500, Move.COMBINED_SMOOTH: 1500}  # in 3-D, nanoseconds


def bytes_per_nanosecond(repeats: int) -> float:
    """Return how fast large arrays are copied, reading and writing counted."""
    source = np.ones(1 << 24)
    target, best = np.zeros_like(source), math.inf
    for _ in range(repeats):
        start = time.process_time()
        np.copyto(target, source)
        best = min(best, time.process_time() - start)
    return 2 * source.nbytes / best * 1e-9


def bytes_per_vertex(mesh: Mesh, move: Move) -> float:
    """Return what a sweep reads and writes: positions twice, lists of neighbours and, but for one move, of faces."""
    stars = mesh.topology.stars()
    listed = stars.neighbours.nbytes + stars.neighbour_offsets.nbytes
    if move is not Move.LAPLACIAN:
        listed += stars.faces.nbytes + stars.offsets.nbytes
    return (2 * mesh.points.nbytes + listed) / len(stars.vertices)


def nanoseconds(mesh: Mesh, move: Move, repeats: int) -> float:
    """Return the best time per visited vertex."""
    threshold = math.sin(math.radians(THRESHOLD[mesh.dimension])) ** 2
    stars, best = mesh.topology.stars(), math.inf
    start_points, movable = mesh.along_curve(mesh.points), mesh.along_curve(mesh.movable)
    for _ in range(repeats):
        points, states, visited = start_points.copy(), movable.astype(np.uint8) * kernels.DUE, 0
        start = time.process_time()
        for blocks in mesh.topology.colours:
            visited += kernels.relocate(
                move, points, states, stars, blocks, threshold, -math.inf, start_points, math.inf, 1
            )[0]
        best = min(best, (time.process_time() - start) / max(visited, 1))
    return best * 1e9


def nanoseconds_per_facet(mesh: Mesh, repeats: int) -> tuple[int, float]:
    """Return the number of fixed facets, and the best time for each."""
    points, movable, best = mesh.along_curve(mesh.points), mesh.along_curve(mesh.movable), math.inf
    facets, _, shared = mesh.topology.connectivity.fixed_facets(movable, 1)
    for _ in range(repeats):
        start = time.process_time()
        kernels.crossings_and_folds(points, facets, shared, 1)
        best = min(best, time.process_time() - start)
    return len(facets), best / max(len(facets), 1) * 1e9


def nanoseconds_per_element(mesh: Mesh, repeats: int) -> tuple[float, float]:
    """Return the best times to look at the corners of an element, and to judge all of it."""
    judged, points, best = mesh.judged(), mesh.along_curve(mesh.points), [math.inf, math.inf]
    for _ in range(repeats):
        start = time.process_time()
        kernels.check(points, judged.simplices, 1)
        between = time.process_time()
        judged.judge(points, 1)
        best = [min(best[0], between - start), min(best[1], time.process_time() - between)]
    return best[0] / len(judged) * 1e9, best[1] / len(judged) * 1e9


def main() -> None:
    """Print the tables for triangles, tetrahedra, hexahedra, and wedges with tetrahedra."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh", nargs="?", help="a valid mesh; default: generated ones")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    if options.mesh:
        meshes = {options.mesh: read(options.mesh).mesh}
    else:
        meshes = {
            "triangles": Mesh.build(*generate.plate(0.012)),
            "tetrahedra": Mesh.build(*generate.bracket(0.045, 12)),
            "hexahedra": Mesh.build(*box_of_hexahedra(30_000)),
            "wedges and tetrahedra": Mesh.build(*box_of_wedges_and_tets(60_000)),
        }
    speed = bytes_per_nanosecond(options.repeats)
    title = f"kernels, one thread; memory copies {speed:.1f} GB/s"
    table = Table("step", "mesh", "ns per vertex", "bound by memory", "target", title=title)
    facets = Table("mesh", "fixed facets", "ns per facet", title="what crosses and folds")
    elements = Table("mesh", "corners, ns per element", "all of it", title="what is inverted")
    for kind, mesh in meshes.items():
        name = f"{len(mesh.judged()):,} {kind}, {int(mesh.movable.sum()):,} free"
        tangled, _ = perturb(mesh, 25, mesh.mean_edge_length())
        outcome = untangle(tangled, smooth=0)
        for move in Move:
            if move is Move.UNTANGLE_COEFFICIENTS and mesh.judged().simplicial:
                continue  # those of simplices are their measures
            start = tangled if move <= Move.COMBINED_UNTANGLE or move is Move.UNTANGLE_COEFFICIENTS else outcome.after
            target = TARGETS.get(move) if mesh.dimension == 3 and mesh.judged().simplicial else None
            figures = (nanoseconds(start, move, options.repeats), bytes_per_vertex(mesh, move) / speed)
            table.add_row(move.name.lower(), name, *(f"{one:.0f}" for one in figures), f"{target or ''}")
        count, each = nanoseconds_per_facet(mesh, options.repeats)
        facets.add_row(name, f"{count:,}", f"{each:.0f}")
        elements.add_row(name, *(f"{one:.0f}" for one in nanoseconds_per_element(outcome.after, options.repeats)))
    for one in (table, facets, elements):
        Console(width=120).print(one)


if __name__ == "__main__":
    main()
