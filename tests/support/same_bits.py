"""What must have the same bits whatever compiled the kernels: `python same_bits.py` prints a line for each case.

The cases are those that are solved over processes as well, elements of second order, and files, from text to text.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path += [str(Path(__file__).parents[2] / name) for name in ("sample_meshes", "benchmarks", "tests/support")]
import numpy as np
from bent import FAMILIES, curved, mesh_of, straight
from over_ranks import METHODS, facts, reference_of
from over_ranks import mesh_of as mesh_over_ranks

from meshfix_cli.repair import Method

SAMPLES = sorted((Path(__file__).parents[2] / "sample_meshes").glob("*_tangled.*"))


def show(case: str, found: object) -> None:
    """Print a case and what tells its result from any other."""
    print(case, hashlib.sha256(found if isinstance(found, bytes) else repr(found).encode()).hexdigest(), flush=True)


for case, method in METHODS.items():
    mesh = mesh_over_ranks(case)
    show(case, facts(method.solve(mesh, method.reach(mesh, 1), 2, reference=reference_of(case, mesh))))
for key in FAMILIES:
    quadratic, points, free = curved(key, 0.8)
    show(key, facts(Method().solve(mesh_of(quadratic, points, key, straight(key)[1], free), np.inf, 2)))
with TemporaryDirectory() as folder:
    for sample in SAMPLES:
        command = [sys.executable, "-m", "meshfix_cli", "untangle", "--quiet", str(sample), sample.name]
        subprocess.run(command, check=True, cwd=folder)  # from where the source is, that would be what runs
        show(sample.name, Path(folder, sample.name).read_bytes())
