"""Verdicts: a mesh with a fault is never called valid, whatever the fault and the format; one without always is.

`MESHFIX_FUZZ=N` tries N meshes; `make fuzz` does.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from bodies import BODIES, Body
from faults import FAULTS
from plain_files import SINGLE, SURFACES, WRITERS

from meshfix_cli.repair import Held, Judge
from meshfix_cli.report.facts import Report

EXAMPLES = int(os.environ.get("MESHFIX_FUZZ", "200"))
ALL = [(f"{name}, {d}-D", make) for d, kinds in BODIES.items() for name, make in kinds.items()]
# STL has no vertices but equal points: there a second simplex at the same place is only the same triangle once more,
# an edge without length is a vertex twice, which is refused; a part and its mirror image are one half inverted mesh.
JOINED = ("mirrored, 2-D", "copy", "two with a common piece", "edge without length")
SHARE = 16  # of the examples, in this many tests that run beside one another


def judged(path: Path) -> Report:
    """What `meshfix quality` finds out."""
    document = Held().read(str(path), 1)
    return Judge().report("quality", document, {"mesh": document.mesh})


def written(random: np.random.Generator, body: Body, folder: Path, unlike: tuple[str, ...] = ()) -> Path:
    """The body as a file of some format that can hold it exactly, and does not end in one of these."""
    flat = body.dimension == 2
    fit = [name for name in WRITERS if name not in SINGLE and (flat or name not in SURFACES)]
    if body.others:
        fit = [name for name in fit if not name.endswith((".stl", ".ply")) and not name.startswith("gmsh41")]
    fit = [name for name in fit if not name.endswith(unlike)]
    path = folder / str(random.choice(fit))
    points = np.column_stack([body.points, np.zeros((len(body.points), 3 - body.dimension))])
    simplices = "triangle" if flat else "tetra"
    WRITERS[path.name](points, {simplices: body.cells, **body.others}, path)
    return path


def random_body(random: np.random.Generator) -> Body:
    kinds = list(BODIES[int(random.integers(2, 4))].values())
    return kinds[int(random.integers(len(kinds)))](random)


@pytest.mark.parametrize("share", range(SHARE))
def test_a_mesh_with_a_fault_is_never_called_valid(share: int, tmp_path: Path) -> None:
    for example in range(share, EXAMPLES, SHARE):
        random = np.random.default_rng([1, example])
        fault = list(FAULTS)[example // SHARE % len(FAULTS)]
        broken = None
        while broken is None:
            broken = FAULTS[fault](random, random_body(random))
        path = written(random, broken, tmp_path, (".stl",) if fault in JOINED else ())
        assert not judged(path).valid, f"{fault}, example {example}, {path.name}"


@pytest.mark.parametrize("share", range(SHARE))
def test_a_mesh_without_a_fault_is_valid(share: int, tmp_path: Path) -> None:
    for example in range(share, EXAMPLES // 2, SHARE):
        random = np.random.default_rng([2, example])
        name, make = ALL[example // SHARE % len(ALL)]
        path = written(random, make(random), tmp_path, (".stl",) if name in JOINED else ())
        assert judged(path).valid, f"{name}, example {example}, {path.name}"
