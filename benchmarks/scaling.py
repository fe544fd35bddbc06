"""One mesh over several processes: `python benchmarks/scaling.py [--tets N] [--ranks 1 2 4]`; needs mpiexec.

Strong scaling shares one mesh, weak scaling gives each process as many tetrahedra. For each number of processes: the
work and the halo of the largest part, what it sends in a sweep, and seconds of a sweep. From the figures of one
process, and the halos of the others, follows a prediction for larger machines; benchmarks/SCALING.md has the
assumptions.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from process import make
from rich.console import Console
from rich.table import Table

from meshfix_cli import kernels, read
from meshfix_cli.workers.distributed import partition

MPIEXEC = shutil.which("mpiexec", path=str(Path(sys.executable).parent)) or "mpiexec"
LATENCY, BANDWIDTH = 2e-6, 10e9  # assumed: seconds a message, bytes a second
TARGET = 1_000_000_000  # tetrahedra of the prediction
SWEEPS = {"Laplacian": 7, "smoothing": 3}  # of the prediction: those of a million tetrahedra, P=10, D=h


def waiting(path: Path, ranks: int) -> float:
    """Return how much longer sweeps take because processes have unlike numbers of corners in a colour."""
    stars = read(path, threads=2).mesh.topology.stars(2)
    work = np.diff(stars.offsets[:: kernels.BLOCK_SIZE], append=len(stars.corners))
    of_block = partition(stars, ranks)
    colours = np.split(stars.colour_blocks, stars.colour_offsets[1:-1])
    longest = sum(np.bincount(of_block[c], weights=work[c], minlength=ranks).max() for c in colours)
    return float(longest * ranks / work.sum())


@dataclass(frozen=True)
class Run:
    """One run; what is said of a part is said of the largest. A sweep's seconds are wall, the check included."""

    ranks: int
    elements: int
    vertices: int
    ghosts: int
    messages: float
    bytes: float
    seconds: dict[str, float]
    sweeps: dict[str, int]
    peaks: list[float]
    waiting: float

    @classmethod
    def of(cls, path: Path, ranks: int, waits: float) -> Run:
        """Run the command; `waits` is that of `waiting`, which is the same in each run."""
        command = [MPIEXEC, "-n", str(ranks), sys.executable, "-m", "meshfix_cli", "untangle", "--mpi", "--json"]
        done = subprocess.run([*command, str(path), str(path) + ".out"], capture_output=True, check=True)
        facts: dict[str, Any] = json.loads(done.stdout)
        parts, records = facts["ranks"], [one for one in facts["sweeps"] if one["sweep"]]
        names = [one["phase"] for one in records]
        sweeps = {name: names.count(name) for name in SWEEPS}
        seconds = {name: sum(r["seconds"] for r in records if r["phase"] == name) / sweeps[name] for name in SWEEPS}
        return cls(
            ranks, facts["elements"], max(part["vertices"] for part in parts), max(part["ghosts"] for part in parts),
            max(part["messages"] for part in parts) / len(records),
            max(part["megabytes"] for part in parts) * 1e6 / len(records), seconds, sweeps,
            [part["peak_mb"] for part in parts], waits,
        )  # fmt: skip


def best(path: Path, ranks: int, repeats: int) -> Run:
    """Return the run with the quickest smoothing."""
    waits = waiting(path, ranks)
    return min((Run.of(path, ranks, waits) for _ in range(repeats)), key=lambda run: run.seconds["smoothing"])


def table_of(title: str, runs: Sequence[Run]) -> Table:
    """Return the figures of some runs; the last columns are ratios to the first run, a vertex of the largest part."""
    table = Table(
        "processes", "tets", "vertices of the largest part", "its ghosts", "messages a sweep", "kB a sweep",
        "peak MB, root / others", "work of colours", "Laplacian sweep", "smoothing sweep", "a vertex, to one process",
        title=title,
    )  # fmt: skip
    first = runs[0].seconds["smoothing"] / runs[0].vertices
    for run in runs:
        others = f"{max(run.peaks[1:]):,.0f}" if run.ranks > 1 else "-"
        table.add_row(
            str(run.ranks), f"{run.elements:,}", f"{run.vertices:,}", f"{run.ghosts:,}", f"{run.messages:.1f}",
            f"{run.bytes / 1e3:,.1f}", f"{run.peaks[0]:,.0f} / {others}", f"{run.waiting:.2f}",
            *(f"{run.seconds[name] * 1e3:.1f} ms" for name in SWEEPS),
            f"{run.seconds['smoothing'] / run.vertices / first:.2f}",
        )  # fmt: skip
    return table


def prediction(one: Run, shared: Sequence[Run], ranks: Sequence[int]) -> Table:
    """Return what the model says of larger machines.

    A sweep takes t n w + latency messages + bytes / bandwidth, with n vertices a process, t of one process, w for
    colours of unlike work as in the largest run, its messages for each of 26 neighbours, and bytes that grow with the
    surface n^(2/3) as in the shared runs.
    """
    surface = np.median([run.bytes / run.vertices ** (2 / 3) for run in shared])
    ghosts = np.median([run.ghosts / run.vertices ** (2 / 3) for run in shared])
    largest = max(shared, key=lambda run: run.ranks)
    messages = largest.messages * 26 / (largest.ranks - 1)
    table = Table("processes", "vertices each", "ghosts", "MB a sweep", "Laplacian", "smoothing", "efficiency",
                  title=f"predicted, {TARGET:,} tetrahedra: seconds of all sweeps of a phase")  # fmt: skip
    for count in ranks:
        n = one.vertices * TARGET / one.elements / count
        halo = LATENCY * messages + surface * n ** (2 / 3) / BANDWIDTH
        work = {name: one.seconds[name] / one.vertices * n for name in SWEEPS}
        seconds = {name: SWEEPS[name] * (work[name] * largest.waiting + halo) for name in SWEEPS}
        share = sum(SWEEPS[name] * work[name] for name in SWEEPS) / sum(seconds.values())
        table.add_row(
            f"{count:,}", f"{n:,.0f}", f"{ghosts * n ** (2 / 3):,.0f}", f"{surface * n ** (2 / 3) / 1e6:.2f}",
            *(f"{seconds[name]:.2f}" for name in SWEEPS), f"{share:.3f}",
        )  # fmt: skip
    return table


def main() -> None:
    """Print both kinds of scaling and the prediction."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tets", type=int, default=1_000_000, help="of the shared mesh, about")
    parser.add_argument("--ranks", type=int, nargs="+", default=(1, 2, 4))
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    console = Console(width=160)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path, _ = make(folder, options.tets)
        strong = [best(path, ranks, options.repeats) for ranks in options.ranks]
        each = options.tets // max(options.ranks)
        weak = [best(make(folder, each * ranks)[0], ranks, options.repeats) for ranks in options.ranks]
    console.print(table_of("strong scaling", strong))
    console.print(table_of("weak scaling", weak))
    shared = [run for run in (*strong, *weak) if run.ranks > 1]
    if shared:
        console.print(prediction(strong[0], shared, (64, 1024)))


if __name__ == "__main__":
    main()
