"""A script as a user would write it runs without a surprise, warnings included."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest

from meshfix_cli import InvalidMeshError, Mesh, MeshfixError, OptionError, perturb, quality, untangle

pyvista = pytest.importorskip("pyvista")

GRID = np.array([[x, y] for y in range(3) for x in range(3)], dtype=float)
QUADS = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]])
FLAT = np.column_stack([GRID, np.zeros(9)])


def test_the_script_runs_without_a_surprise() -> None:
    script = Path(__file__).with_name("as_a_user.py")
    done = subprocess.run([sys.executable, "-W", "error", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("<Result meshio.Mesh: 0 of 750 elements inverted (113 before), smallest angle ")


def test_what_was_meant_is_told() -> None:
    with pytest.raises(OptionError, match=r"no ndarray; points and cells are one argument, a pair"):
        untangle(GRID, QUADS)  # type: ignore[call-overload]
    with pytest.raises(InvalidMeshError, match=r"are in a plane: quadrilaterals are \{'quad': array\}"):
        untangle((FLAT, QUADS))
    with pytest.raises(InvalidMeshError, match="there is no type of cells called 'quads'; there are vertex, line"):
        untangle((FLAT, {"quads": QUADS}))
    for ask in (untangle, quality):
        with pytest.raises(InvalidMeshError, match="a Result is no mesh: give its `mesh`"):
            ask(untangle((GRID, QUADS)))
    with pytest.raises(MeshfixError, match=r"\(points, cells\): as a reference: it has 9 points and 3 quad"):
        untangle((GRID, QUADS), reference=(GRID, QUADS[:3]))


@pytest.mark.parametrize("build", [Mesh.build, lambda points, cells: untangle((points, cells))])
@pytest.mark.parametrize(("points", "cells", "words"), [
    (GRID, [[0, 1, 4], [1, 2, 5, 4]], "the cells are rows of several lengths"),
    (GRID, {"quad": [[0, 1, 4], [1, 2, 5, 4]]}, "the quad cells are rows of several lengths"),
    (GRID, None, "the cells are no array of numbers"),
    ("it.vtk", QUADS, "the points are no array of numbers"),
    (GRID.astype(complex), QUADS, "the points are no array of numbers"),
])  # fmt: skip
def test_what_is_no_array_of_numbers_is_one_sentence(build: Any, points: Any, cells: Any, words: str) -> None:
    with pytest.raises(InvalidMeshError, match=words):
        build(points, cells)


def test_what_where_gives_is_held() -> None:
    where = np.where((GRID == 1).all(axis=1))
    assert untangle((GRID, QUADS), fixed=where).document.fixed["by fixed"] == 1


def test_a_name_that_tells_no_format_is_named(tmp_path: Path) -> None:
    with pytest.raises(MeshfixError, match="out: its extension tells no format that is known"):
        untangle((GRID, QUADS)).write(tmp_path / "out")


def test_cells_that_are_broken_are_not_called_flat() -> None:
    for rows in ([[0, 1, 2, 9]], [[0, 1, 2, -1]], [[0, 1, 2, 2]]):
        with pytest.raises(MeshfixError) as caught:
            untangle((FLAT, rows))
        assert "quad" not in str(caught.value) or rows[0][3] == 2


def test_where_nothing_may_move_nothing_is_said_by_numpy(recwarn: pytest.WarningsRecorder) -> None:
    grid = pyvista.ImageData(dimensions=(4, 4, 4)).cast_to_unstructured_grid()
    moved = perturb(grid, 100, "h").mesh
    result = untangle(moved, fixed=np.arange(64))
    assert not result.valid and "no vertex is free to move" in result.notes and not recwarn


def test_blocks_of_meshio_are_cells() -> None:
    mesh = meshio.Mesh(GRID, {"quad": QUADS})
    assert untangle((mesh.points, mesh.cells)).valid
    assert Mesh.build(GRID, {"quad": QUADS}).topology.m == 4


def test_a_mesh_is_shown_in_one_line() -> None:
    assert repr(Mesh.build(GRID, {"quad": QUADS})) == "<Mesh: 4 quadrilaterals, 9 vertices: 1 free>"
