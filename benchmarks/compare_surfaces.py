"""Triangles on curved surfaces beside what others make of them: `python benchmarks/compare_surfaces.py [BODY ...]`.

Each body lies on a surface that is known exactly; it is given as it is, and tangled along that surface. Of each result:
the smallest and the mean of the triangles' smallest angles, triangles that face away from the exact normal, the largest
distance of the result from the input surface and back, and from the exact one (of the middles of triangles and edges),
that of boundaries and sharp edges of result and input, and the change of the volume of a closed one. Distances are in
mean edge lengths of the body before it was tangled.

CPU seconds: of the other programs those of the algorithm alone, see `surface_programs.py`; of meshfix those of the
whole process, with all its threads, and beside them what is left without those of `meshfix quality`, which starts,
reads and judges the same mesh. Programs that are not installed are left out (pip install pymeshlab meshlib trimesh
pyvista; apt install libcgal-dev).
"""

from __future__ import annotations

import argparse
import os
import shlex
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from exact_surfaces import Points
from rich.console import Console
from rich.table import Table
from surface_bodies import BODIES, Body, smallest_angles, tangled
from surface_measures import apart, folds, volume
from surface_programs import PROGRAMS, MissingError, read_off, write_off

PERCENT, DISTANCE = 25, 1.5
LONGEST = 600  # seconds for a run of meshfix
REFUSED = 1  # its exit code where it writes nothing
COLUMNS = (
    "body",
    "program",
    "smallest",
    "mean",
    "folds",
    "there",
    "back",
    "exact",
    "edges",
    "volume",
    "CPU s",
    "less start",
)

OPTIONS: dict[str, tuple[str, ...]] = {
    "meshfix": (),
    "meshfix, best": ("--smooth", "best"),
    "meshfix, best, sliding": ("--smooth", "best", "--slide", "curved"),
}
TANGLED = {
    "meshfix": (),
    "meshfix, best": ("--smooth", "best"),
    "meshfix, reference": ("--reference", "reference.off"),
    "meshfix, best, reference": ("--smooth", "best", "--reference", "reference.off"),
}


class RefusedError(Exception):
    """A program writes nothing; the message is its own."""


def process(words: list[str], folder: Path) -> float:
    """Return the CPU seconds of a process."""
    with Path(folder, "said.txt").open("w") as said:
        running = subprocess.Popen(["timeout", str(LONGEST), *words], cwd=folder, stdout=said, stderr=said)
        _, status, usage = os.wait4(running.pid, 0)
    running.returncode = os.waitstatus_to_exitcode(status)
    if not Path(folder, words[-1]).exists() or running.returncode == REFUSED:
        lines = Path(folder, "said.txt").read_text().splitlines()
        raise RefusedError(lines[-1] if lines else f"ended with {running.returncode}")
    return usage.ru_utime + usage.ru_stime


class Row:
    """Measures the results for one body."""

    def __init__(self, body: Body, start: Body) -> None:
        self.body, self.start, self.h = body, start, body.h
        rims = body.rims
        self.rims = np.column_stack([rims, rims[:, 1]])
        ends = np.sort(np.concatenate([body.cells[:, [k, k - 1]] for k in range(3)]), axis=1)
        self.closed = bool((np.unique(ends, axis=0, return_counts=True)[1] > 1).all())

    def of(self, points: Points, *seconds: float) -> list[str]:
        """Return the cells of the table for points (n, 3)."""
        if not np.isfinite(points).all():
            return ["-", "gives points without numbers"]
        cells = self.body.cells
        angles = smallest_angles(points, cells)
        there, back = apart(points, self.body.points, cells)
        edges = max(apart(points, self.body.points, self.rims)) if len(self.rims) else None
        before = volume(self.body.points, cells)
        change = f"{volume(points, cells) / before - 1:+.1e}" if self.closed else "-"
        return [
            f"{angles.min():.1f}", f"{angles.mean():.1f}", f"{folds(self.body, points):,}",
            f"{there / self.h:.3f}h", f"{back / self.h:.3f}h", f"{self.body.off(points).max() / self.h:.3f}h",
            "-" if edges is None else f"{edges / self.h:.4f}h", change, *(f"{one:.3f}" for one in seconds),
        ]  # fmt: skip


def with_meshfix(meshfix: list[str], row: Row, options: dict[str, tuple[str, ...]]) -> Iterator[tuple[str, list[str]]]:
    """Yield the names and cells of the runs of meshfix."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_off(folder / "in.off", row.start.points, row.body.cells)
        write_off(folder / "reference.off", row.body.points, row.body.cells)
        try:
            start = process([*meshfix, "quality", "in.off"], folder)
        except RefusedError as error:
            yield "meshfix", ["-", str(error)]
            return
        for program, given in options.items():
            (folder / "out.off").unlink(missing_ok=True)
            try:
                seconds = process([*meshfix, "untangle", *given, "in.off", "out.off"], folder)
            except RefusedError as error:
                yield program, ["-", str(error)]
            else:
                yield program, row.of(read_off(folder / "out.off"), seconds, max(0.0, seconds - start))


def with_others(row: Row, left_out: dict[str, str]) -> Iterator[tuple[str, list[str]]]:
    """Yield the names and cells of the other programs; those that are not there are noted."""
    for program in PROGRAMS:
        cells = with_other(program, row, left_out)
        if cells:
            yield program, cells


def with_other(program: str, row: Row, left_out: dict[str, str]) -> list[str]:
    """Return the cells of another program; none where it is not there."""
    try:
        points, seconds = PROGRAMS[program](row.start)
    except (ImportError, MissingError) as error:
        left_out[program] = str(error)
        return []
    except (ValueError, RuntimeError) as error:
        return ["-", str(error)]
    return row.of(points, seconds)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("bodies", nargs="*", metavar="BODY", help=f"some of {', '.join(BODIES)}; default: all")
    parser.add_argument("--meshfix", default="meshfix", help="the command, with options that all runs get")
    parser.add_argument("--alone", action="store_true", help="leave out the other programs")
    parser.add_argument("--seed", type=int, default=0, help="of the tangles")
    given = parser.parse_args()
    if unknown := set(given.bodies) - set(BODIES):
        parser.error(f"no such body: {', '.join(sorted(unknown))}")
    table = Table(*COLUMNS, title=f"angles in degrees; tangled: {PERCENT} % by {DISTANCE}h along the surface")
    left_out: dict[str, str] = {}
    notes: list[str] = []
    makers: dict[str, Callable[[], Body]] = {name: BODIES[name] for name in given.bodies or BODIES}
    for name, make in makers.items():
        body = make()
        starts = {name: (body, OPTIONS), f"{name}, tangled": (tangled(body, PERCENT, DISTANCE, given.seed), TANGLED)}
        for case, (start, options) in starts.items():
            row = Row(body, start)
            table.add_row(case, "(input)", *row.of(start.points))
            others = () if given.alone else with_others(row, left_out)
            for program, cells in (*with_meshfix(shlex.split(given.meshfix), row, options), *others):
                if cells[0] == "-":
                    notes.append(f"{case}: {program}: {cells.pop()}")
                table.add_row("", program, *cells)
            table.add_section()
    console = Console(width=160)
    console.print(table)
    notes += [f"left out: {program} ({why})" for program, why in left_out.items()]
    console.print("\n".join(notes), highlight=False, markup=False)


if __name__ == "__main__":
    main()
