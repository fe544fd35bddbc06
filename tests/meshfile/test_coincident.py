"""Points at one place that cells do not share: counted, and joined on request."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from commands import run
from numpy.typing import NDArray
from shapes import block, plate

from meshfix_cli import read, untangle, write
from meshfix_cli.meshfile.coincident import count, first_of_each_place
from meshfix_cli.meshfile.document import Document


def apart(points: NDArray[np.float64], cells: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The same mesh with points of its own for every cell."""
    return points[cells].reshape(-1, 3), np.arange(cells.size).reshape(cells.shape)


@pytest.mark.parametrize(("kind", "shape"), [("triangle", plate), ("tetra", block)])
def test_joined_points_are_solved_as_one_and_all_written(kind: str, shape: Callable[[], Any], tmp_path: Path) -> None:
    points, cells = shape()
    many, own = apart(points, cells)
    document = read_back(tmp_path / "apart.vtk", kind, many, own, join_points=True)
    outcome = untangle(document.mesh)
    assert outcome.valid
    stored, dropped = write(document, outcome.after, tmp_path / "out.vtk")
    assert (dropped, stored.check()[0]) == ((), 0)
    found = meshio.read(tmp_path / "out.vtk").points[own]
    places = np.full((len(points), 3), np.nan)
    places[cells] = found
    np.testing.assert_array_equal(found, places[cells])  # all copies of a point are at one place
    boundary = np.setdiff1d(np.arange(len(points)), np.unique(cells[(found != points[cells]).any(axis=2)]))
    assert 0 < len(boundary) < len(points)
    assert any(note.startswith("joined ") and note.endswith("each is written") for note in document.notes)


def read_back(
    path: Path, kind: str, points: NDArray[np.float64], cells: NDArray[np.int64], join_points: bool = False
) -> Document:
    meshio.write(path, meshio.Mesh(points, [(kind, cells)]), file_format="vtk42", binary=True)
    return read(path, join_points=join_points)


def test_points_that_are_not_joined_are_counted(tmp_path: Path) -> None:
    points, cells = plate()
    many, own = apart(points, cells)
    read_back(tmp_path / "apart.vtk", "triangle", many, own)
    done = run("quality", "--json", tmp_path / "apart.vtk", code=3)
    (note,) = [note for note in json.loads(done.stdout)["notes"] if "--join-points" in note]
    used = np.unique(points[cells].reshape(-1, 3), axis=0, return_counts=True)[1]
    assert note.startswith(f"{used[used > 1].sum():,} points lie at {(used > 1).sum():,} places and are not joined")


def test_fixed_copies_hold_the_point_that_stands_for_them(tmp_path: Path) -> None:
    points, cells = plate()
    many, own = apart(points, cells)
    middle = int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    last = np.flatnonzero(cells.ravel() == middle)[-1]
    mask = (np.arange(len(many)) == last).astype(float)
    meshio.Mesh(many, [("triangle", own)], {"hold": mask}).write(tmp_path / "in.vtk")
    free, held = (read(tmp_path / "in.vtk", fix, join_points=True).mesh.movable.sum() for fix in (None, "hold"))
    assert free - held == 1


def test_what_collapses_when_points_are_joined_is_named(tmp_path: Path) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]])
    cells = np.array([[0, 1, 2], [1, 2, 3]])
    document = read_back(tmp_path / "in.vtk", "triangle", points, cells, join_points=True)
    assert (document.solved.m, document.not_judged) == (1, {"collapsed_triangle": 1})


def test_signed_zeros_are_one_place_and_numbers_that_are_none_are_not() -> None:
    points = np.array([[0.0, 1], [-0.0, 1], [np.nan, 0], [np.nan, 0], [2, 2], [0, 1]])
    first = first_of_each_place(points, np.arange(6))
    assert first.tolist() == [0, 0, 2, 3, 4, 0]
    assert count(first) == (3, 1)
    assert first_of_each_place(points, np.array([1, 4, 5])).tolist() == [0, 1, 2, 3, 4, 1]
    assert first_of_each_place(points, np.array([], dtype=np.int64)).tolist() == list(range(6))
