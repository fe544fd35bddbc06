"""The paper's tables on a mesh of yours: `make tables MESH=FILE`, or `python benchmarks/tables.py FILE`.

Prints tables 4.2 and 4.3 for tetrahedra, 4.1 for triangles, with the paper's figures beside ours (its meshes are
of 11,098 tetrahedra and 333 triangles), then what the default strategy makes of the same cases, and writes the
series of figure 4.4 (P = 25, D = 8h) as CSV.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from meshfix_cli import Mesh, perturb, read, summarise, untangle
from meshfix_cli.report.as_json import history_csv
from meshfix_cli.solve.records import Outcome
from meshfix_cli.solve.strategies import PASSES, SMOOTH, SMOOTHING

CASES = ((5, 1), (10, 1), (25, 1), (50, 1), (25, 2), (25, 4), (25, 8))  # percent, multiples of h

# N, sweeps and smallest angle after untangling, smallest angle after smoothing
TABLE_4_1 = (
    (15, 3, 0.446, 14.5), (28, 2, 0.0856, 17.6), (51, 3, 0.0057, 14.9), (93, 4, 0.62, 19.1),
    (73, 4, 0.21, 12.3), (92, 5, 0.0687, 8.86), (95, 10, 0.233, 2.52),
)  # fmt: skip
TABLE_4_2 = (
    (447, 3, 3.61e-3, 4.34), (910, 3, 6.32e-3, 4.34), (2030, 5, 1.42e-3, 4.34), (3277, 7, 0.392, 4.34),
    (3218, 9, 0.0, 4.34), (3667, 9, 1.04e-5, 4.34), (3891, 29, 0.0, 1.74),
)  # fmt: skip
# sweeps and mean smallest dihedral angle after untangling with US, CS and LUS
TABLE_4_3 = (
    ("3", 28.3, "3", 43.8, "3-1", 36.1), ("3", 27.3, "4", 44.4, "3-1", 36.1), ("5", 26.3, "5", 44.2, "3-1", 44.7),
    ("7", 26.4, "12", 44.3, "3-1", 36.1), ("9", 25.4, "12", 44.2, "3-1", 36.1), ("9", 24.9, "28", 44.4, "3-1", 36.1),
    ("29", 22.1, "-", None, "3-1", 35.9),
)  # fmt: skip


@dataclass(frozen=True)
class Result:
    """One strategy on one case."""

    outcome: Outcome
    sweeps: str
    left: int
    untangled: tuple[float, float]
    smoothed: tuple[float, float]
    milliseconds: float


def run(mesh: Mesh, strategy: str) -> Result:
    """Untangle and smooth, the paper's strategies by its three passes; angles are (smallest, mean of the smallest)."""
    outcome = untangle(mesh, strategy, smooth=SMOOTH if strategy == "auto" else PASSES)
    phases: dict[str, int] = {}
    left = outcome.records[0].inverted
    for record in outcome.records:
        if not record.phase.startswith(("input", "best", SMOOTHING)):
            phases[record.phase] = record.sweep
            left = record.inverted
    before, after = summarise(outcome.untangled), summarise(outcome.after)
    return Result(
        outcome,
        "-".join(map(str, phases.values())) if not left else "-",
        left,
        (before.min_angle, before.mean_min_angle),
        (after.min_angle, after.mean_min_angle),
        1e3 * sum(record.seconds for record in outcome.records),
    )


def print_untangling(
    console: Console, title: str, cases: Sequence[tuple[int, Result]], paper: Sequence[tuple[float, ...]]
) -> None:
    """Print table 4.1 or 4.2: US, then three smoothing passes."""
    table = Table("P", "D", "N", "paper", "S_U", "paper", "min U", "paper", "min S", "paper", title=title)
    for (percent, distance), (inverted, us), (n, sweeps, min_u, min_s) in zip(CASES, cases, paper, strict=True):
        figures = (inverted, n, us.sweeps, sweeps, f"{us.untangled[0]:.3g}", min_u, f"{us.smoothed[0]:.3f}", min_s)
        table.add_row(str(percent), f"{distance}h", *map(str, figures))
    console.print(table)


def print_strategies(console: Console, results: dict[str, list[Result]]) -> None:
    """Print table 4.3, beside LS and the default strategy, which the paper has not."""
    table = Table("P", "D", title="Table 4.3 (paper): sweeps, mean smallest dihedral angle; LS: elements left")
    for name in ("US", "CS", "LUS"):
        table.add_column(name)
    table.add_column("LUS min S")
    table.add_column("LS")
    for i, (percent, distance) in enumerate(CASES):
        cells = []
        for k, name in enumerate(("US", "CS", "LUS")):
            sweeps, mean = TABLE_4_3[i][2 * k : 2 * k + 2]
            ours = results[name][i]
            cells.append(f"{ours.sweeps}, {ours.untangled[1]:.1f} ({sweeps}, {mean or '-'})")
        table.add_row(
            str(percent), f"{distance}h", *cells, f"{results['LUS'][i].smoothed[0]:.3f}", str(results["LS"][i].left)
        )
    console.print(table)


def print_default(console: Console, results: Sequence[Result]) -> None:
    """Print what the default options make of the cases; the numerical part includes the checks of every sweep."""
    table = Table("P", "D", "sweeps", "inverted", "min", "mean", "numerical part [ms]", title="default options")
    for (percent, distance), result in zip(CASES, results, strict=True):
        smallest, mean = result.smoothed
        figures = (result.sweeps, result.outcome.records[-1].inverted, f"{smallest:.3f}", f"{mean:.2f}")
        table.add_row(str(percent), f"{distance}h", *map(str, figures), f"{result.milliseconds:.1f}")
    console.print(table)


def main() -> None:
    """Run the seven cases."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh", help="a valid mesh")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--output", type=Path, default=Path("out"), help="folder for the CSV of figure 4.4")
    options = parser.parse_args()
    console = Console(width=120)
    mesh = read(options.mesh).mesh
    h = mesh.mean_edge_length()
    tangled = [perturb(mesh, percent, distance * h, options.seed)[0] for percent, distance in CASES]
    counts = [case.check()[0] for case in tangled]
    results = {name: [run(case, name) for case in tangled] for name in ("US", "CS", "LUS", "LS", "auto")}
    us = list(zip(counts, results["US"], strict=True))
    if mesh.dimension == 3:
        print_untangling(console, "Table 4.2: US, then 3 smoothing passes", us, TABLE_4_2)
        print_strategies(console, results)
    else:
        print_untangling(console, "Table 4.1: US, then 3 smoothing passes", us, TABLE_4_1)
        untangled = sum(result.left == 0 for result in results["LS"])
        console.print(f"LS untangles {untangled} of {len(CASES)} cases (paper: all)")
    print_default(console, results["auto"])
    options.output.mkdir(parents=True, exist_ok=True)
    for name in ("CS", "LUS", "US"):
        path = options.output / f"figure_4_4_{name}.csv"
        path.write_text(history_csv(results[name][-1].outcome.records))
        console.print(f"wrote {path}")


if __name__ == "__main__":
    main()
