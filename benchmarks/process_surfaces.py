"""The whole process on surfaces: `python benchmarks/process_surfaces.py [--counts N ...]`.

Triangles on a square of waves, and the same ones flat: uneven ones that are only made better, and such of which a
quarter of the vertices were moved along them by 1.5 mean edges. Binary VTK in and out, default options, one thread. CPU
seconds are those of the whole process, the least of several runs in turns; the ratios are those of surfaces to the
plane, and of what is left of both without the seconds of `--version`, which only starts.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import meshio
import numpy as np
from process import MESHFIX, Command
from process_elements import cheapest
from rich.console import Console
from rich.table import Table
from surface_bodies import Body, bumps, jittered, tangled

COUNTS = (250_000, 1_000_000)
PERCENT, DISTANCE = 25, 1.5
FLAT, HEIGHT = 0.0, 0.0833  # of the waves


def make(folder: Path, count: int) -> tuple[int, dict[str, tuple[str, Command]]]:
    """Write the meshes of about so many triangles.

    Returns
    -------
    count : int
        Of the triangles.
    words : dict
        Of each case the plane one that it is beside, and the words of the command.
    """
    side = round((count / 2) ** 0.5) + 1
    for name, body in (("plane", bumps(side, FLAT)), ("waves", bumps(side, HEIGHT))):
        write(folder / f"{name}.vtk", tangled(body, PERCENT, DISTANCE))
        write(folder / f"{name}_before.vtk", body)
    for name, height in (("plane", FLAT), ("waves", HEIGHT)):
        write(folder / f"{name}_uneven.vtk", jittered(side, height))
    return len(body.cells), {
        "a plane": ("a plane", (folder / "plane_uneven.vtk",)),
        "a surface": ("a plane", (folder / "waves_uneven.vtk",)),
        "a plane, tangled": ("a plane, tangled", (folder / "plane.vtk",)),
        "a surface, tangled": ("a plane, tangled", (folder / "waves.vtk",)),
        "the same, --reference": (
            "a plane, tangled",
            ("--reference", folder / "waves_before.vtk", folder / "waves.vtk"),
        ),
    }


def write(path: Path, body: Body) -> None:
    """Write a body as binary VTK."""
    cells = [("triangle", body.cells.astype(np.int32))]
    meshio.write(path, meshio.Mesh(body.points, cells), file_format="vtk42", binary=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS, help="about so many triangles in each mesh")
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    table = Table("triangles", "of", "CPU s", "µs each", "peak MB", "bytes each", "/ plane", "less start")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for wanted in options.counts:
            # Not here: the peak of a process is at least the memory of the one that starts it.
            with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as apart:
                count, words = apart.submit(make, folder, wanted).result()
            own = ("untangle", "--threads", 1)
            commands = [(*MESHFIX, *own, *some, folder / "out.vtk") for _, some in words.values()]
            (start, _), *rows = cheapest([(*MESHFIX, "--version"), *commands], options.repeats)
            costs = dict(zip(words, rows, strict=True))
            for kind, (beside, _) in words.items():
                (cpu, peak), (plane, _) = costs[kind], costs[beside]
                figures = f"{cpu:.2f}", f"{1e6 * cpu / count:.1f}", f"{peak:,.0f}", f"{1e6 * peak / count:,.0f}"
                ratios = f"{cpu / plane:.2f}", f"{(cpu - start) / (plane - start):.2f}"
                table.add_row(f"{count:,}", kind, *figures, *ratios)
    Console(width=120, file=sys.stdout).print(table)


if __name__ == "__main__":
    main()
