"""Hard tangles of many geometries: `make stress`, or `python benchmarks/stress.py [--strategy NAME]`.

Every case starts from a mesh that is valid by construction, so it has a solution, but for those of the family
"impossible". A case is solved where no element is inverted and no facet folded, and the fixed vertices have not
moved; the exit code is 1 where one fails, or where success is reported wrongly. A result is poor where its smallest
quality is below half of that of the mesh before it was tangled. Quality is the smallest angle of an element in degrees,
and its scaled Jacobian where elements are not all simplices.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from elements import MESHES, tangles
from geometries import (
    GEOMETRIES,
    Points,
    airfoil,
    block,
    chamber,
    cylinder,
    gear,
    o_grid,
    pipes,
    rings,
    shell,
    thin_plate,
)
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from meshfix_cli import Mesh, perturb, summarise, untangle
from meshfix_cli.quality.summary import Summary
from meshfix_cli.solve.strategies import SMOOTH, STRATEGIES, Smooth

PERTURBATIONS = ((5, 1), (10, 1), (25, 1), (50, 2), (100, 1), (25, 8), (100, 8), (100, 32), (100, 100))
SOLVED, IMPOSSIBLE, FAILED, WRONG = "solved", "impossible", "failed", "wrong"

Map = Callable[[Points], Points]


@dataclass(frozen=True, eq=False)
class Case:
    """A tangled mesh, and the smallest quality that it had before; `possible`: it has a valid solution."""

    family: str
    name: str
    mesh: Mesh
    before: float
    possible: bool = True


@dataclass(frozen=True)
class Result:
    """What became of a case; the smallest and the mean quality of the elements."""

    case: Case
    verdict: str
    seconds: float
    smallest: float
    mean: float

    @property
    def poor(self) -> bool:
        """Whether the smallest quality is below half of what it was."""
        return self.case.possible and self.smallest < 0.5 * self.case.before

    @property
    def unit(self) -> str:
        """That of its quality."""
        return "°" if self.case.mesh.topology.simplicial else ""


def cases(seed: int = 0) -> Iterator[Case]:
    """Yield every case, in a fixed order."""
    for family, make in GEOMETRIES.items():
        mesh = Mesh.build(*make())
        yield from _tangled(family, mesh, seed)
    yield from _two_materials(seed)
    yield from _curves(seed)
    yield from _morphed()
    yield from _elements(seed)
    yield from _impossible()


def _tangled(family: str, mesh: Mesh, seed: int) -> Iterator[Case]:
    h, free, random = mesh.mean_edge_length(), mesh.movable, np.random.default_rng(seed)
    before = summarise(mesh).min_angle
    for percent, distance in PERTURBATIONS:
        yield Case(family, f"P={percent} D={distance}h", perturb(mesh, percent, distance * h, seed)[0], before)
    low, high, inner = mesh.points.min(axis=0), mesh.points.max(axis=0), mesh.points[free]
    starts = {
        "random": random.uniform(low, high, inner.shape),
        "permuted": random.permutation(inner),
        "collapsed": np.broadcast_to(inner.mean(axis=0), inner.shape),
        "flattened": np.column_stack([inner[:, :-1], np.full(len(inner), low[-1])]),
    }
    for k in range(4):
        starts[f"inverted patch {k}"] = _turned_over(inner, inner[random.integers(len(inner))], (k + 1) * 2 * h)
    for name, positions in starts.items():
        points = mesh.points.copy()
        points[free] = positions
        yield Case(family, name, mesh.with_points(points), before)


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


def _curves(seed: int) -> Iterator[Case]:
    """Yield cases of rings around a hole, in which the vertices of a circle and those of a ray are held."""
    points, cells = rings(1.0, 3.0, 60, 22)
    radius, turn = np.linalg.norm(points, axis=1), np.arctan2(points[:, 1], points[:, 0])
    circle, ray = np.isclose(radius, radius[10 * 60]), (np.abs(turn) < 0.06) & (radius > radius[10 * 60])
    yield from _tangled("embedded curves", Mesh.build(points, cells, fixed=circle | ray), seed)


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
        ("piston, 2-D", chamber, "pressed to", {f"{s:g}": _squeezed(s) for s in (0.5, 0.2, 0.1, 0.05)}),
        ("piston, 3-D", cylinder, "pressed to", {f"{s:g}": _squeezed(s) for s in (0.5, 0.2, 0.1, 0.05)}),
        ("O-grid", o_grid, "hole turned by", {f"{a}°": _turning(a, 4.0, 1.0) for a in (10, 30, 60)}),
        ("airfoil 1:1000", airfoil, "turned by", {f"{a}°": _turning(a, 4.0, 1.0) for a in (1, 3, 10)}),
    ):
        mesh = Mesh.build(*make())
        for how, moved in maps.items():
            target = moved(mesh.points)
            if mesh.with_points(target.copy()).check()[0]:
                raise ValueError(f"{family}, {name} {how}: the map itself tangles the mesh")
            points, before = (
                np.where(mesh.movable[:, None], mesh.points, target),
                summarise(mesh.with_points(target)).min_angle,
            )
            yield Case(family, f"{name} {how}", Mesh.build(points, mesh.topology.simplices), before)


def _turned(points: Points, angle: NDArray[np.float64], centre: float = 0.0) -> Points:
    x, y = points[:, 0] - centre, points[:, 1] - centre
    turned = points.copy()
    turned[:, 0] = centre + np.cos(angle) * x - np.sin(angle) * y
    turned[:, 1] = centre + np.sin(angle) * x + np.cos(angle) * y
    return turned


def _turning(degrees: float, outer: float, inner: float) -> Map:
    """Turn the inner boundary; the outer one stays."""
    angle = np.radians(degrees)
    return lambda p: _turned(p, angle * (outer - np.maximum(np.linalg.norm(p, axis=1), inner)) / (outer - inner))


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
    return lambda p: p * np.array([1.0] * (p.shape[1] - 1) + [factor])


def _elements(seed: int) -> Iterator[Case]:
    """Yield tangles of the meshes of other elements than simplices, by the rarest type that stands in them."""
    families = {"pyramid": "pyramids", "wedge": "wedges", "hexahedron": "hexahedra", "quad": "quads"}
    for name, make in MESHES.items():
        points, blocks = make()
        family = next(families[key] for key in families if key in dict(blocks))
        mesh = Mesh.build(points, blocks)
        before, _ = _quality(summarise(mesh))
        for how, moved in tangles(name, mesh.points, mesh.movable, mesh.mean_edge_length(), seed).items():
            yield Case(family, f"{name}: {how}", mesh.with_points(moved), before)


def _impossible() -> Iterator[Case]:
    """Yield meshes that no motion of the free vertices makes valid."""
    for name in ("plate with holes", "box with pipes"):
        mesh = Mesh.build(*GEOMETRIES[name]())
        simplices = mesh.topology.simplices
        first, *others = simplices[~mesh.movable[simplices].any(axis=1)][0]
        points = mesh.points.copy()
        points[first] = 2 * points[others].mean(axis=0) - points[first]
        yield Case("impossible", f"{name}: an inverted fixed simplex", mesh.with_points(points), 0.0, possible=False)
        points = mesh.points.copy()
        hole = np.linalg.norm(points[:, :2] - np.array([0.8, 1.25]), axis=1) < 0.36
        points[hole & ~mesh.movable, 1] += 0.5
        yield Case("impossible", f"{name}: a hole across the rim", mesh.with_points(points), 0.0, possible=False)


def _quality(summary: Summary) -> tuple[float, float]:
    """Return the smallest and the mean quality of the elements."""
    if summary.jacobians is not None:
        return summary.jacobians.smallest, summary.jacobians.mean
    return summary.min_angle, summary.mean_min_angle


def run(case: Case, strategy: str, smooth: Smooth = SMOOTH, threads: int = 1) -> Result:
    """Untangle, and judge the result by its own measures."""
    start = time.perf_counter()
    outcome = untangle(case.mesh, strategy, smooth=smooth, threads=threads)
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
    return Result(case, verdict, seconds, *_quality(summary))


def print_results(results: list[Result], console: Console) -> None:
    """Print a line for each family, then whatever failed."""
    verdicts = (SOLVED, IMPOSSIBLE, FAILED, WRONG)
    columns = ("family", "cases", *verdicts, "poor", "seconds", "longest", "smallest", "mean")
    table = Table(*columns, title="the worst case's smallest angle or scaled Jacobian; the mean of the cases' means")
    families = list(dict.fromkeys(result.case.family for result in results))
    for family in [*families, ""]:
        rows = [result for result in results if family in ("", result.case.family)]
        counts = [sum(result.verdict == verdict for result in rows) for verdict in verdicts]
        counts.append(sum(result.poor for result in rows))
        times = [result.seconds for result in rows]
        table.add_row(
            family or "all", str(len(rows)), *map(str, counts), f"{sum(times):.2f}", f"{max(times):.2f}",
            *_worst_and_mean([result for result in rows if result.verdict == SOLVED] or rows),
            end_section=family == families[-1],
        )  # fmt: skip
    console.print(table)
    for result in results:
        if result.verdict in (FAILED, WRONG) or result.poor:
            quality = f"{result.smallest:.4g}{result.unit} of {result.case.before:.4g}{result.unit}"
            verdict = "poor" if result.verdict == SOLVED else result.verdict
            console.print(f"{verdict}: {result.case.family}, {result.case.name}: {quality}")


def _worst_and_mean(results: list[Result]) -> tuple[str, str]:
    """Return the smallest quality of all and the mean of the means; nothing where they differ in their measure."""
    unit, *others = {result.unit for result in results}
    smallest, mean = min(result.smallest for result in results), sum(result.mean for result in results) / len(results)
    return ("", "") if others else (f"{smallest:.3f}{unit}", f"{mean:.{2 if unit else 3}f}{unit}")


def main() -> None:
    """Run all cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--strategy", choices=tuple(STRATEGIES), default="auto")
    parser.add_argument("--smooth", type=lambda word: word if word in ("auto", "best") else int(word), default=SMOOTH)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, help="a CSV file with a line for each case")
    options = parser.parse_args()
    results = [run(case, options.strategy, options.smooth) for case in cases(options.seed)]
    print_results(results, Console(width=120))
    if options.output is not None:
        lines = [
            f"{r.case.family},{r.case.name},{r.verdict},{r.seconds:.4f},{r.smallest:.4f},{r.mean:.3f},{r.case.before:.4f}"
            for r in results
        ]
        options.output.write_text("\n".join(["family,case,verdict,seconds,smallest,mean,before", *lines]) + "\n")
    sys.exit(any(result.verdict in (FAILED, WRONG) for result in results))


if __name__ == "__main__":
    main()
