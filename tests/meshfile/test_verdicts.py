"""Verdicts: a mesh with a fault is never called valid, whatever the fault and the format; one without always is.

`MESHFIX_FUZZ=N` tries N meshes; `make fuzz` does.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from bodies import BODIES, Body
from faults import FAULTS, another, free_vertex
from plain_files import WRITERS, writers
from zones import ZONES

from meshfix_cli.errors import InvalidMeshError, ReadError
from meshfix_cli.repair import Held
from meshfix_cli.repair.judge import Judge
from meshfix_cli.report.facts import Report

EXAMPLES = int(os.environ.get("MESHFIX_FUZZ", "200"))
ALL = [(f"{name}, {d}-D", make) for d, kinds in BODIES.items() for name, make in kinds.items()]
# STL has no vertices but equal points: there a second simplex at the same place is only the same triangle once more,
# an edge without length is a vertex twice, which is refused; a part and its mirror image are one half inverted mesh.
JOINED = ("mirrored, 2-D", "copy", "two with a common piece", "edge without length")
# dolfin numbers with no regard to orientation, and meshio's writer of FLAC3D turns what is not positive.
RENUMBERED = ("misnumbered",)
SHARE = 16  # of the examples, in this many tests that run beside one another


def is_valid(path: Path) -> bool:
    """Whether a file is read, and called valid."""
    try:
        return judged(path).valid
    except (InvalidMeshError, ReadError):
        return False


def judged(path: Path) -> Report:
    """What `meshfix quality` finds out."""
    document = Held().read(str(path), 1)
    return Judge().report("quality", document, {"mesh": document.mesh})


def written(random: np.random.Generator, body: Body, folder: Path, unlike: tuple[str, ...] = ()) -> Path:
    """The body as a file of some format that can hold it exactly, and does not end in one of these."""
    fit = [name for name in writers(body.dimension, bool(body.others)) if not name.endswith(unlike)]
    path = folder / str(random.choice(fit))
    write(body, path)
    return path


def write(body: Body, path: Path) -> None:
    points = np.column_stack([body.points, np.zeros((len(body.points), 3 - body.dimension))])
    simplices = "triangle" if body.dimension == 2 else "tetra"
    WRITERS[path.name](points, {simplices: body.cells, **body.others}, path)


def untold_in(name: str) -> tuple[str, ...]:
    """Return the extensions of formats that cannot tell what is so called."""
    return (*((".stl",) if name in JOINED else ()), *((".f3grid", ".xml") if name in RENUMBERED else ()))


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
        path = written(random, broken, tmp_path, untold_in(fault))
        assert not is_valid(path), f"{fault}, example {example}, {path.name}"


@pytest.mark.parametrize("share", range(SHARE))
def test_a_mesh_without_a_fault_is_valid(share: int, tmp_path: Path) -> None:
    for example in range(share, EXAMPLES // 2, SHARE):
        random = np.random.default_rng([2, example])
        name, make = ALL[example // SHARE % len(ALL)]
        path = written(random, make(random), tmp_path, untold_in(name))
        assert judged(path).valid, f"{name}, example {example}, {path.name}"


@pytest.mark.parametrize(
    ("row", "d"), [(row, d) for row, (name, _) in enumerate(ZONES) for d in (2, 3) if name in writers(d, False)]
)
def test_a_fault_in_one_of_several_meshes_is_never_overlooked(row: int, d: int, tmp_path: Path) -> None:
    """The other, before or behind it, has the same connectivity or one of its own."""
    name, put_together = ZONES[row]
    random = np.random.default_rng([3, row, d])
    broken = None
    while broken is None:
        sound = another(random, d)
        broken = free_vertex(random, sound)
    one, other, both = (tmp_path / folder / name for folder in ("one", "other", "both"))
    for path in (one, other, both):
        path.parent.mkdir()
    write(broken, other)
    for body in (sound, another(random, d)):
        write(body, one)
        assert is_valid(one)
        for first, second in ((one, other), (other, one)):
            put_together(first, second, both)
            assert not is_valid(both)
