"""The whole process: `make bench`, or `python benchmarks/process.py [--tets N ...]`.

Meshes of several sizes (generated, P=10, D=h, binary VTK) are repaired by the command with default options, with one
thread and with two: wall and CPU seconds, peak memory, and, from runs inside Python, the wall seconds of each phase.
Then ratios, each of two things measured in turns: the cost per element of small and large meshes, two threads and one
beside what two processes at once cost each other on this machine, what meshio takes to read the same mesh as text, and
what a small mesh and --help take beside imports.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import meshio
from phases import PHASES
from rich.console import Console
from rich.table import Table

from meshfix_cli import Mesh, perturb

sys.path.insert(0, str(Path(__file__).parents[1] / "sample_meshes"))
import generate

SIZES = (10_000, 100_000, 1_000_000, 10_000_000)
MESHFIX = (sys.executable, "-m", "meshfix_cli")
Command = Sequence[object]


def run(command: Command) -> tuple[float, float, float]:
    """Return wall and CPU seconds, and the peak memory in MB, of a process that must succeed."""
    start = time.perf_counter()
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, command
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e3 * 1.024


def ratio(one: Command, other: Command, repeats: int) -> tuple[float, float]:
    """Return the median ratios of wall and CPU seconds of two commands that run in turns."""
    pairs = [(run(one), run(other)) for _ in range(repeats)]
    wall, cpu = (statistics.median(a[k] / b[k] for a, b in pairs) for k in (0, 1))
    return wall, cpu


def two_at_once(command: Command) -> float:
    """Return how much more CPU a command takes while another of the same runs."""
    alone = run(command)[1]
    other = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL)
    beside = run(command)[1]
    other.wait()
    return beside / alone


def make(folder: Path, tets: int) -> tuple[Path, int]:
    """Write a tangled mesh of about so many tetrahedra; return the file and their number."""
    layers = max(2, round(18 * (tets / 1e6) ** (1 / 3)))
    mesh = Mesh.build(*generate.bracket((layers / (29600 / 1e6 * tets)) ** 0.5, layers))
    tangled, _ = perturb(mesh, 10, mesh.mean_edge_length())
    path, cells = folder / f"{tets}.vtk", tangled.topology.simplices
    meshio.write(path, meshio.Mesh(tangled.points, [("tetra", cells)]), file_format="vtk42", binary=True)
    return path, len(cells)


def untangle_command(path: Path, threads: int) -> Command:
    """Return the command with default options."""
    return (*MESHFIX, "untangle", "--threads", threads, path, path.with_suffix(".out.vtk"))


def seconds_of_phases(path: Path, threads: int) -> dict[str, float]:
    """Return the wall seconds of each phase."""
    script = Path(__file__).with_name("phases.py")
    command = (sys.executable, script, path, path.with_suffix(".out.vtk"), threads, time.time())
    done = subprocess.run([str(word) for word in command], capture_output=True, check=True, text=True)
    result: dict[str, float] = json.loads(done.stdout)
    return result


def measured(folder: Path, tets: int, table: Table) -> dict[str, float]:
    """Add the rows of a size; return microseconds per element, one thread, of each phase."""
    path, count = make(folder, tets)
    per_element = {}
    for threads in (1, 2):
        wall, cpu, peak = run(untangle_command(path, threads))
        runs = [seconds_of_phases(path, threads) for _ in range(3)]
        seconds = {phase: min(one[phase] for one in runs) for phase in PHASES}
        whole = (f"{count:,}", str(threads), f"{wall:.2f}", f"{cpu:.2f}", f"{peak:,.0f}")
        table.add_row(*whole, *(f"{figure:.3f}" for figure in seconds.values()), end_section=threads == 2)
        if threads == 1:
            per_element = {phase: 1e6 * figure / count for phase, figure in seconds.items()}
    return per_element


def text_copy(path: Path) -> Path:
    """Write a mesh as text."""
    copy = path.with_name("text.vtk")
    meshio.write(copy, meshio.read(path), file_format="vtk42", binary=False)
    return copy


def ratios(folder: Path, sizes: Sequence[int], per_element: dict[int, dict[str, float]], repeats: int) -> Table:
    """Measure the ratios."""
    table = Table("ratio", "wall", "CPU")
    large = [size for size in sizes if size >= 100_000]
    for phase in ("topology", "untangle", "smooth"):
        costs = [per_element[size][phase] for size in large]
        if costs:
            name = f"{phase} per element: the dearest size from 100,000 on / the cheapest"
            table.add_row(name, f"{max(costs) / min(costs):.2f}", "")
    path = folder / f"{max(size for size in sizes if size <= 1_000_000)}.vtk"
    one, two, text = untangle_command(path, 1), untangle_command(path, 2), text_copy(path)
    reading = (sys.executable, "-c", "import meshio, sys; meshio.read(sys.argv[1])", text)
    imports = (sys.executable, "-c", "import numpy, meshio, click, rich.table")
    sample = Path(__file__).parents[1] / "sample_meshes" / "plate_tangled.vtk"
    for name, first, second in (
        ("two threads / one", two, one),
        ("one thread, text in and out / meshio reads the text", untangle_command(text, 1), reading),
        ("one thread, binary in and out / meshio reads the text", one, reading),
        ("332 triangles / import numpy, meshio, click, rich.table",
         (*MESHFIX, "untangle", sample, folder / "small.vtk"), imports),
        ("--help / the same imports", (*MESHFIX, "--help"), imports),
    ):  # fmt: skip
        table.add_row(name, *(f"{figure:.2f}" for figure in ratio(first, second, repeats)))
    beside = statistics.median(two_at_once(one) for _ in range(repeats))
    table.add_row("one of two processes at once / alone", "", f"{beside:.2f}")
    return table


def main() -> None:
    """Print the seconds of each size, and the ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tets", type=int, nargs="+", default=SIZES, help="about so many in each mesh")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    title = "seconds; phases: wall, the best of three runs inside Python"
    table = Table("tets", "threads", "wall", "CPU", "peak MB", *PHASES, title=title)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        per_element = {size: measured(folder, size, table) for size in options.tets}
        Console(width=140).print(table)
        Console(width=140).print(ratios(folder, options.tets, per_element, options.repeats))


if __name__ == "__main__":
    main()
