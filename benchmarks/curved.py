"""Curved elements against gmsh's optimisers with the boundary held: `python benchmarks/curved.py [MESH ...]`.

Both get the same mesh in one run: coarse ones that gmsh makes around what is round, or files that it reads. Of each
result: invalid elements, the smallest coefficient of a Jacobian determinant relative to the straight element, the
smallest scaled Jacobian at a node, both by meshfix's own judge, and CPU seconds of the algorithm alone.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import gmsh
from curved_bodies import made
from rich.console import Console
from rich.table import Table

from meshfix_cli import read
from meshfix_cli.mesh.judged import VALID
from meshfix_cli.meshfile.document import Document
from meshfix_cli.repair import Method
from meshfix_cli.solve.quadratic import giving_way

LONGEST = 300  # seconds for an optimiser
OPTIMISERS = {"HighOrder": "HighOrder", "Elastic": "HighOrderElastic", "FastCurving": "HighOrderFastCurving"}


def figures(document: Document) -> tuple[int, str]:
    """Return how many elements are invalid, and the smallest coefficient and scaled Jacobian."""
    mesh = document.mesh
    if mesh.quadratic is None:
        return mesh.check()[0], "straight"
    found = mesh.quadratic.judge(mesh.points, 1)
    smallest = f"{found.smallest.min():.3f} {found.scaled_jacobians.min():.3f}"
    return int((found.verdicts != VALID).sum()), smallest


def timed(action: Callable[[], Any]) -> tuple[Any, float]:
    """Return what an action gives, and its CPU seconds."""
    start = time.process_time()
    return action(), time.process_time() - start


def repaired(document: Document, smooth: Any = "auto") -> tuple[int, str, float, str]:
    """Run meshfix; return the figures, CPU seconds and what it proves or offers."""
    outcome, seconds = timed(lambda: Method(smooth=smooth).solve(document.mesh, math.inf, 1))
    left, smallest = figures(replace(document, mesh=outcome.after))
    note = ""
    if left:
        proved = len(outcome.obstacles.inverted) + len(outcome.obstacles.exclusive)
        way = giving_way(outcome.after, document.mesh.points, math.inf, 1)
        far = "none" if way is None else f"{way[1] / document.mesh.mean_edge_length():.3f}h"
        note = f"{proved} proved; relax {far}"
    return left, smallest, seconds, note


def begin() -> None:
    """Begin a session of gmsh without a word."""
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("General.NumThreads", 1)


def optimised(path: Path, method: str) -> tuple[int, str, float]:
    """Run an optimiser of gmsh; return the figures and CPU seconds."""
    begin()
    gmsh.open(str(path))
    gmsh.option.setNumber("Mesh.HighOrderFixBoundaryNodes", 1)
    _, seconds = timed(lambda: gmsh.model.mesh.optimize(method))
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "optimised.msh")
        gmsh.write(str(target))
        return (*figures(read(target)), seconds)


def by_gmsh(path: Path, method: str) -> str:
    """Run it in a process of its own: it ends some."""
    words = [sys.executable, __file__, "--with", method, str(path)]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=LONGEST)
    except subprocess.TimeoutExpired:
        return f"over {LONGEST} s"
    return done.stdout.splitlines()[-1] if done.returncode == 0 else "ended"


def cases(names: list[str], folder: Path, order: int) -> Iterator[tuple[str, Path]]:
    """Give names and files: those that are given, or made ones of an order."""
    if names:
        yield from ((Path(name).name, Path(name)) for name in names)
        return
    for name in made(gmsh):
        path = folder / "mesh.msh"
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))
        yield name, path


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("meshes", nargs="*", metavar="MESH")
    parser.add_argument("--order", type=int, default=2, help="of the meshes that are made")
    parser.add_argument("--with", dest="method", choices=OPTIMISERS.values(), help="print what this makes of a mesh")
    given = parser.parse_args()
    if given.method:
        print("{} {} {:.2f} s".format(*optimised(Path(given.meshes[0]), given.method)))
        return
    table = Table("mesh", "elements", "as it is", "meshfix", "best", *OPTIMISERS, "left")
    begin()
    with tempfile.TemporaryDirectory() as folder:
        for name, path in cases(given.meshes, Path(folder), given.order):
            document = read(path)
            if document.mesh.quadratic is None:
                continue
            ours, best = repaired(document), repaired(document, "best")
            others = [by_gmsh(path, method) for method in OPTIMISERS.values()]
            mine = [f"{left} {smallest} {seconds:.2f} s" for left, smallest, seconds, _ in (ours, best)]
            cells = ["{} {}".format(*figures(document)), *mine, *others]
            table.add_row(name, str(document.mesh.topology.m), *cells, ours[3])
    Console(width=200).print(table)


if __name__ == "__main__":
    main()
