"""The whole process on other elements than simplices: `python benchmarks/process_elements.py [--counts N ...]`.

Boxes of hexahedra, and of wedges and tetrahedra, of several sizes (P=25, D=2h) are repaired by the command with default
options and one thread, from and to each kind of file: CPU seconds, microseconds and peak bytes per element. Then the
ratios of the cost per element of the largest and the smallest boxes. With --beside MESHFIX, another installation's
command runs in turns with this one, and its CPU seconds and peak memory are what the ratios are of.
"""

from __future__ import annotations

import argparse
import multiprocessing
import statistics
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import meshio
from elements import box_of_hexahedra, box_of_wedges_and_tets
from process import MESHFIX, Command, run
from rich.console import Console
from rich.table import Table

from meshfix_cli import Mesh, perturb

COUNTS = (100_000, 1_000_000)
BOXES = {"hexahedra": box_of_hexahedra, "wedges and tets": box_of_wedges_and_tets}
# How meshio writes them, and the ends of their names.
FILES = {
    "binary VTK": (".vtk", {"file_format": "vtk42", "binary": True}),
    "text VTK": (".vtk", {"file_format": "vtk42", "binary": False}),
    "binary VTU": (".vtu", {"file_format": "vtu", "binary": True}),
    "text VTU": (".vtu", {"file_format": "vtu", "binary": False}),
}


def make(folder: Path, box: str, count: int, files: list[str]) -> tuple[int, dict[str, Path]]:
    """Write a tangled box as each kind of file; return the number of its elements, and the files."""
    points, blocks = BOXES[box](count)
    mesh = Mesh.build(points, blocks)
    tangled, _ = perturb(mesh, 25, 2 * mesh.mean_edge_length())
    paths = {}
    for kind in files:
        end, options = FILES[kind]
        paths[kind] = folder / f"{box} {kind}{end}"
        meshio.write(paths[kind], meshio.Mesh(tangled.points, blocks), **options)
    return mesh.topology.m, paths


def cheapest(commands: list[Command], repeats: int) -> list[tuple[float, float]]:
    """Return the least CPU seconds and the median peak in MB of each command; they run in turns."""
    rounds = [[run(command) for command in commands] for _ in range(repeats)]
    return [
        (min(one[1] for one in runs), statistics.median(one[2] for one in runs)) for runs in zip(*rounds, strict=True)
    ]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS, help="about so many elements in each box")
    parser.add_argument("--files", nargs="+", choices=FILES, default=list(FILES))
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--beside", metavar="MESHFIX", help="the command of another installation")
    options = parser.parse_args()
    programs = [MESHFIX, *([(options.beside,)] if options.beside else [])]
    columns = ("box", "file", "elements", "CPU s", "µs an element", "peak MB", "bytes an element")
    table = Table(*columns, *(("CPU / beside", "peak / beside") if options.beside else ()))
    cost: dict[tuple[str, str], list[float]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for box in BOXES:
            for wanted in options.counts:
                # Not here: the peak of a process is at least the memory of the one that starts it.
                with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as apart:
                    count, paths = apart.submit(make, folder, box, wanted, options.files).result()
                for kind, path in paths.items():
                    words = ("untangle", "--quiet", "--threads", 1, path, folder / f"out{path.suffix}")
                    (cpu, peak), *other = cheapest([(*program, *words) for program in programs], options.repeats)
                    ratios = [f"{cpu / other[0][0]:.2f}", f"{peak / other[0][1]:.2f}"] if other else []
                    figures = f"{cpu:.2f}", f"{1e6 * cpu / count:.1f}", f"{peak:,.0f}", f"{1e6 * peak / count:,.0f}"
                    table.add_row(box, kind, f"{count:,}", *figures, *ratios)
                    cost.setdefault((box, kind), []).append(cpu / count)
                    path.unlink()
    console = Console(width=140, file=sys.stdout)
    console.print(table)
    for (box, kind), each in cost.items():
        console.print(f"{box}, {kind}: an element of the last box costs {each[-1] / each[0]:.2f} of one of the first")


if __name__ == "__main__":
    main()
