"""Many small meshes: `make bench`, or `python benchmarks/batch.py [--files N]`.

The same files are repaired by one command for each, one after another, and by `meshfix batch`: wall and CPU seconds,
and what a file costs.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from pathlib import Path

from process import MESHFIX, run
from rich.console import Console
from rich.table import Table

SAMPLE = Path(__file__).parents[1] / "sample_meshes" / "plate_tangled.vtk"


def main() -> None:
    """Print a row for each way, and the ratio of the first to each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=200)
    options = parser.parse_args()
    table = Table("332 triangles each", "wall s", "CPU s", "ms a file", "ratio", title=f"{options.files} files")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = [Path(shutil.copy(SAMPLE, folder / f"{i}.vtk")) for i in range(options.files)]
        single = [run((*MESHFIX, "untangle", "--quiet", path, folder / "out.vtk")) for path in paths]
        rows = {"one command for each": (sum(one[0] for one in single), sum(one[1] for one in single), 0.0)}
        for jobs in (1, 2):
            command = (*MESHFIX, "batch", "--quiet", "--jobs", jobs, "--output-dir", folder / f"out{jobs}", *paths)
            rows[f"batch --jobs {jobs}"] = run(command)
    for way, (wall, cpu, _) in rows.items():
        ratio = rows["one command for each"][0] / wall
        table.add_row(way, f"{wall:.2f}", f"{cpu:.2f}", f"{1e3 * wall / options.files:.1f}", f"{ratio:.1f}")
    Console(width=100).print(table)


if __name__ == "__main__":
    main()
