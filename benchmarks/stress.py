"""Hard tangles of many geometries: `make stress`, or `python benchmarks/stress.py [--strategy NAME]`.

Every case starts from a mesh that is valid by construction, so it has a solution, but for those of the family
"impossible". A case is solved where no element is inverted and no facet folded, and the fixed vertices have not
moved; the exit code is 1 where one fails, or where success is reported wrongly.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from geometries import GEOMETRIES, Points, block, gear, pipes, shell, thin_plate
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from meshfix_cli import Mesh, perturb, summarise, untangle
from meshfix_cli.solve.strategies import STRATEGIES

PERTURBATIONS = ((5, 1), (10, 1), (25, 1), (50, 2), (100, 1), (25, 8), (100, 8), (100, 32), (100, 100))
SOLVED, IMPOSSIBLE, FAILED, WRONG = "solved", "impossible", "failed", "wrong"

Map = Callable[[Points], Points]


@dataclass(frozen=True, eq=False)
class Case:
    """A tangled mesh; `possible`: it has a valid solution."""

    family: str
    name: str
    mesh: Mesh
    possible: bool = True


@dataclass(frozen=True)
class Result:
    """What became of a case; angles in degrees."""

    case: Case
    verdict: str
    seconds: float
    min_angle: float
    mean_angle: float


def cases(seed: int = 0) -> Iterator[Case]:
    """Yield every case, in a fixed order."""
    for family, make in GEOMETRIES.items():
        mesh = Mesh.build(*make())
        yield from _tangled(family, mesh, seed)
    yield from _two_materials(seed)
    yield from _morphed()
    yield from _impossible()


def _tangled(family: str, mesh: Mesh, seed: int) -> Iterator[Case]:
    h, free, random = mesh.mean_edge_length(), mesh.movable, np.random.default_rng(seed)
    for percent, distance in PERTURBATIONS:
        yield Case(family, f"P={percent} D={distance}h", perturb(mesh, percent, distance * h, seed)[0])
    low, high, inner = mesh.points.min(axis=0), mesh.points.max(axis=0), mesh.points[free]
    starts = {
        "random": random.uniform(low, high, inner.shape),
        "permuted": random.permutation(inner),
        "collapsed": np.broadcast_to(inner.mean(axis=0), inner.shape),
    }
    for k in range(4):
        starts[f"inverted patch {k}"] = _turned_over(inner, inner[random.integers(len(inner))], (k + 1) * 2 * h)
    for name, positions in starts.items():
        points = mesh.points.copy()
        points[free] = positions
        yield Case(family, name, mesh.with_points(points))


def _turned_over(points: Points, centre: NDArray[np.float64], radius: float) -> Points:
    """Mirror what is near the centre in a plane through it."""
    near = np.linalg.norm(points - centre, axis=1) < radius
    mirrored = points.copy()
    mirrored[near, 0] = 2 * centre[0] - mirrored[near, 0]
    return mirrored


def _two_materials(seed: int) -> Iterator[Case]:
    """Yield cases of a box whose middle layer of vertices, the interface, is held."""
    points, cells = pipes()
    middle = np.unique(points[:, 2])[3]
    yield from _tangled("two materials", Mesh.build(points, cells, fixed=points[:, 2] == middle), seed)


def _morphed() -> Iterator[Case]:
    """Yield meshes whose boundary was moved and whose interior was left behind."""
    for family, make, name, maps in (
        ("annulus", GEOMETRIES["annulus"], "hole turned by", {f"{a}°": _turning(a, 1.0, 0.4) for a in (30, 60, 90)}),
        ("sphere shell", shell, "core turned by", {f"{a}°": _turning(a, 1.0, 0.5) for a in (30, 60)}),
        ("block", block, "twisted by", {f"{a}°": _twisted(a) for a in (60, 120, 180, 240, 360)}),
        ("block", block, "bent by", {f"{a}°": _bent(a, 2) for a in (45, 90, 180, 270)}),
        ("thin plate", thin_plate, "bent by", {f"{a}°": _bent(a, 0) for a in (45, 90, 180)}),
        ("block", block, "sheared by", {f"{s:g}": _sheared(s) for s in (0.5, 1, 2, 4)}),
        ("box with pipes", pipes, "sheared by", {f"{s:g}": _sheared(s) for s in (0.5, 1, 2, 4)}),
        ("gear", gear, "sheared by", {f"{s:g}": _sheared(s) for s in (0.5, 1, 2)}),
        ("block", block, "squeezed to", {f"{s:g}": _squeezed(s) for s in (0.3, 0.1, 0.03)}),
    ):
        mesh = Mesh.build(*make())
        for how, moved in maps.items():
            target = moved(mesh.points)
            if mesh.with_points(target.copy()).check()[0]:
                raise ValueError(f"{family}, {name} {how}: the map itself tangles the mesh")
            points = np.where(mesh.movable[:, None], mesh.points, target)
            yield Case(family, f"{name} {how}", Mesh.build(points, mesh.topology.simplices))


def _turned(points: Points, angle: NDArray[np.float64], centre: float = 0.0) -> Points:
    x, y = points[:, 0] - centre, points[:, 1] - centre
    turned = points.copy()
    turned[:, 0] = centre + np.cos(angle) * x - np.sin(angle) * y
    turned[:, 1] = centre + np.sin(angle) * x + np.cos(angle) * y
    return turned


def _turning(degrees: float, outer: float, inner: float) -> Map:
    """Turn the inner boundary; the outer one stays."""
    angle = np.radians(degrees)
    return lambda p: _turned(p, angle * (outer - np.linalg.norm(p, axis=1)) / (outer - inner))


def _twisted(degrees: float) -> Map:
    angle = np.radians(degrees)
    return lambda p: _turned(p, angle * p[:, 2] / 3.0, 0.5)


def _bent(degrees: float, axis: int) -> Map:
    radius, across = 3.0 / np.radians(degrees), 2 - axis

    def bend(points: Points) -> Points:
        turn, r, bent = points[:, axis] / radius, radius + points[:, across], points.copy()
        bent[:, axis], bent[:, across] = r * np.sin(turn), r * np.cos(turn) - radius
        return bent

    return bend


def _sheared(slope: float) -> Map:
    return lambda p: p + slope * p[:, 2:] * np.array([1.0, 0.0, 0.0])


def _squeezed(factor: float) -> Map:
    return lambda p: p * np.array([1.0, 1.0, factor])


def _impossible() -> Iterator[Case]:
    """Yield meshes that no motion of the free vertices makes valid."""
    for name in ("plate with holes", "box with pipes"):
        mesh = Mesh.build(*GEOMETRIES[name]())
        simplices = mesh.topology.simplices
        first, *others = simplices[~mesh.movable[simplices].any(axis=1)][0]
        points = mesh.points.copy()
        points[first] = 2 * points[others].mean(axis=0) - points[first]
        yield Case("impossible", f"{name}: an inverted fixed simplex", mesh.with_points(points), possible=False)
        points = mesh.points.copy()
        hole = np.linalg.norm(points[:, :2] - np.array([0.8, 1.25]), axis=1) < 0.36
        points[hole & ~mesh.movable, 1] += 0.5
        yield Case("impossible", f"{name}: a hole across the rim", mesh.with_points(points), possible=False)


def run(case: Case, strategy: str, threads: int = 1) -> Result:
    """Untangle, and judge the result by its own measures."""
    start = time.perf_counter()
    outcome = untangle(case.mesh, strategy, threads=threads)
    seconds = time.perf_counter() - start
    summary = summarise(outcome.after)
    held = ~case.mesh.movable
    still = outcome.after.points[held].tobytes() == case.mesh.points[held].tobytes()
    valid = summary.inverted == 0 and summary.folded == 0 and still and case.possible
    if outcome.valid != valid:
        verdict = WRONG
    elif valid:
        verdict = SOLVED
    else:
        verdict = IMPOSSIBLE if outcome.obstacles and not case.possible else FAILED
    return Result(case, verdict, seconds, summary.min_angle, summary.mean_min_angle)


def print_results(results: list[Result], console: Console) -> None:
    """Print a line for each family, then whatever failed."""
    verdicts = (SOLVED, IMPOSSIBLE, FAILED, WRONG)
    columns = ("family", "cases", *verdicts, "seconds", "longest", "smallest angle", "mean angle")
    table = Table(
        *columns, title="angles: the worst case's smallest, the mean over the cases of the elements' smallest"
    )
    families = list(dict.fromkeys(result.case.family for result in results))
    for family in [*families, ""]:
        rows = [result for result in results if family in ("", result.case.family)]
        solved = [result for result in rows if result.verdict == SOLVED] or rows
        counts = [str(sum(result.verdict == verdict for result in rows)) for verdict in verdicts]
        times = [result.seconds for result in rows]
        table.add_row(
            family or "all", str(len(rows)), *counts, f"{sum(times):.2f}", f"{max(times):.2f}",
            f"{min(result.min_angle for result in solved):.3f}",
            f"{sum(result.mean_angle for result in solved) / len(solved):.2f}", end_section=family == families[-1],
        )  # fmt: skip
    console.print(table)
    for result in results:
        if result.verdict in (FAILED, WRONG):
            console.print(f"{result.verdict}: {result.case.family}, {result.case.name}")


def main() -> None:
    """Run all cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--strategy", choices=tuple(STRATEGIES), default="auto")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, help="a CSV file with a line for each case")
    options = parser.parse_args()
    results = [run(case, options.strategy) for case in cases(options.seed)]
    print_results(results, Console(width=120))
    if options.output is not None:
        lines = [
            f"{r.case.family},{r.case.name},{r.verdict},{r.seconds:.4f},{r.min_angle:.4f},{r.mean_angle:.3f}"
            for r in results
        ]
        options.output.write_text("\n".join(["family,case,verdict,seconds,smallest,mean", *lines]) + "\n")
    sys.exit(any(result.verdict in (FAILED, WRONG) for result in results))


if __name__ == "__main__":
    main()
