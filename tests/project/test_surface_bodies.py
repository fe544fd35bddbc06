"""The surfaces that benchmarks and tests use lie where their formulas say; the distances between them are exact."""

from __future__ import annotations

import sys
from functools import cache
from pathlib import Path

import compare_surfaces
import numpy as np
import pytest
from exact_surfaces import Bumps, Ellipsoid, Points, Torus, unit
from numpy.typing import NDArray
from small_surfaces import SMALL
from surface_bodies import BODIES, HELD, Body, Cells, icosphere, smallest_angles, tangled
from surface_measures import Triangles, apart, folds, volume
from surface_programs import PROGRAMS, read_off, write_off

EULER = {"ellipsoid": 2, "torus": 0, "bumps": 1, "cylinder": 2, "part": -2}
NAMES = [f"small {name}" for name in SMALL]


@cache
def made(name: str) -> Body:
    """A body of the benchmark, or a small one."""
    return SMALL[name.removeprefix("small ")]() if name in NAMES else BODIES[name]()


def edges_of(cells: Cells) -> tuple[Cells, NDArray[np.int64], NDArray[np.int64]]:
    """The distinct edges, how many cells have each, and in how many more of these it runs upwards than downwards."""
    directed = np.stack([cells, np.roll(cells, -1, axis=1)], axis=2).reshape(-1, 2)
    ends, number, counts = np.unique(np.sort(directed, axis=1), axis=0, return_inverse=True, return_counts=True)
    sides = np.zeros(len(ends), dtype=np.int64)
    np.add.at(sides, number.ravel(), np.where(directed[:, 0] < directed[:, 1], 1, -1))
    return ends, counts, sides


@pytest.mark.parametrize("name", [*BODIES, *NAMES])
def test_bodies_are_conforming_and_numbered_outwards(name: str) -> None:
    body = made(name)
    ends, counts, sides = edges_of(body.cells)
    assert counts.max() == 2
    assert not sides[counts == 2].any()
    assert (counts == 1).any() == ("bumps" in name)
    assert len(body.points) - len(ends) + len(body.cells) == EULER[name.split()[-1]]
    assert len(np.unique(body.cells)) == len(body.points)
    assert folds(body, body.points) == 0
    if "bumps" not in name:
        assert volume(body.points, body.cells) > 0


@pytest.mark.parametrize("name", NAMES)
def test_points_lie_on_their_surfaces_and_stay_there_when_moved(name: str) -> None:
    body = made(name)
    moved = tangled(body, 25, 1.5)
    for points in (body.points, moved.points):
        free = points[body.free]
        assert np.allclose(body.project(body.free, free), free, rtol=0, atol=1e-12)
        assert body.inside(body.free, free, 0.0).all()
    changed = (moved.points != body.points).any(axis=1)
    assert 0 < changed.sum() <= round(0.25 * len(body.points))
    assert not changed[body.of_points == HELD].any()
    assert folds(body, moved.points) > len(body.cells) / 20


@pytest.mark.parametrize("name", NAMES)
def test_held_points_are_those_of_the_rims(name: str) -> None:
    body = made(name)
    assert set(body.rims.ravel().tolist()) == set(np.flatnonzero(body.of_points == HELD).tolist())


@pytest.mark.parametrize(
    ("name", "smallest", "mean"),
    [("ellipsoid", 17.0, 32.7), ("torus", 29.3, 37.5), ("bumps", 37.5, 42.1), ("cylinder", 4.2, 35), ("part", 4, 36)],
)
def test_angles_of_the_bodies(name: str, smallest: float, mean: float) -> None:
    angles = smallest_angles(made(name).points, made(name).cells)
    assert angles.min() == pytest.approx(smallest, abs=0.3)
    assert angles.mean() == pytest.approx(mean, abs=1.0)
    assert 4000 < len(angles) < 10_000


@pytest.mark.parametrize("surface", [Ellipsoid((2.0, 1.0, 0.5)), Torus(0.4)])
def test_projections_are_the_closest_points(surface: Ellipsoid | Torus) -> None:
    """No other point of the surface is closer, of many beside them."""
    random = np.random.default_rng(0)
    base = surface.project(random.normal((0.5, 0, 0), size=(20, 3)))
    places = base + 0.1 * surface.normal(base)
    assert np.allclose(surface.project(places), base, atol=1e-12)
    for place, point in zip(places, base, strict=True):
        for reach in (1.0, 0.1, 0.01):
            others = surface.project(point + reach * random.normal(size=(500, 3)))
            assert np.linalg.norm(others - place, axis=1).min() >= np.linalg.norm(point - place) - 1e-12


@pytest.mark.parametrize("name", NAMES)
def test_normals_are_those_of_fine_triangles(name: str) -> None:
    """Two small steps along the surface span its tangent plane."""
    body, step = made(name), 1e-6
    normals, points = body.normals(body.free), body.points[body.free]
    one = unit(np.cross(normals, [0.3, 0.5, 0.8]))
    here, there = (body.project(body.free, points + step * way) - points for way in (one, np.cross(normals, one)))
    assert np.allclose(unit(np.cross(here, there)), normals, atol=1e-4)


def test_distances_of_surfaces_that_are_known() -> None:
    points, cells = icosphere(2)
    flat = np.cos(np.arcsin(np.linalg.norm(points[cells[:, 0]] - points[cells[:, 1]], axis=1).max() / 2))
    there, back = apart(points, 1.5 * points, cells)
    assert back == pytest.approx(0.5, abs=1e-12)  # a corner is closest to the one below
    assert 0.5 * flat**2 < there <= 0.5
    plane = Bumps(0.0, (1.0, 1.0)).over(np.random.default_rng(1).uniform(size=(3, 2)))
    assert apart(plane, plane + np.array([0, 0, 0.25]), np.array([[0, 1, 2]])) == pytest.approx((0.25, 0.25), abs=1e-15)
    edge, other = np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([[0.0, 0, 0], [2, 0, 0]])
    assert apart(edge, other, np.array([[0, 1, 1]])) == pytest.approx((0, 1), abs=1e-15)


def test_distances_are_those_of_vtk() -> None:
    core, model = (pytest.importorskip(f"vtkmodules.{name}") for name in ("vtkCommonCore", "vtkCommonDataModel"))
    body = made("small part")
    folded = tangled(body, 25, 1.5).points
    points, cells, surface = core.vtkPoints(), model.vtkCellArray(), model.vtkPolyData()
    points.SetDataTypeToDouble()
    for point in folded:
        points.InsertNextPoint(point)
    for cell in body.cells.tolist():
        cells.InsertNextCell(3, cell)
    surface.SetPoints(points)
    surface.SetPolys(cells)
    locator = model.vtkCellLocator()
    locator.SetDataSet(surface)
    locator.BuildLocator()
    random = np.random.default_rng(0)
    places = body.points[random.integers(len(body.points), size=200)] + 0.2 * random.normal(size=(200, 3))
    squares = []
    for place in places:
        square = core.reference(0.0)
        locator.FindClosestPoint(place, [0.0] * 3, core.reference(0), core.reference(0), square)
        squares.append(float(square))
    found = Triangles(folded, body.cells)
    assert np.allclose(found.distances(places, found.bounds(places)), np.sqrt(squares), rtol=0, atol=1e-12)


def test_files_keep_each_coordinate(tmp_path: Path) -> None:
    body = made("small torus")
    write_off(tmp_path / "torus.off", body.points, body.cells)
    assert (read_off(tmp_path / "torus.off") == body.points).all()


def test_surfaces_are_compared(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """With a command that gives its reference back, where it has one, and else its input."""

    def absent(body: Body) -> tuple[Points, float]:
        raise ModuleNotFoundError("No module named 'absent'")

    copy = tmp_path / "copy.py"
    copy.write_text(
        "import shutil, sys\n"
        "if sys.argv[1] == 'untangle':\n"
        "    shutil.copy('reference.off' if '--reference' in sys.argv else sys.argv[-2], sys.argv[-1])\n"
    )
    monkeypatch.setitem(BODIES, "torus", SMALL["torus"])
    for name in PROGRAMS:
        monkeypatch.setitem(PROGRAMS, name, absent)
    monkeypatch.setattr(sys, "argv", ["compare_surfaces.py", "--meshfix", f"{sys.executable} {copy}", "torus"])
    compare_surfaces.main()
    printed = capsys.readouterr().out
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in printed.splitlines() if line.startswith("│")]
    assert [row[1] for row in rows] == ["(input)", *compare_surfaces.OPTIONS, "(input)", *compare_surfaces.TANGLED]
    still_folded = [row[4] != "0" for row in rows]
    assert still_folded == [*4 * [False], *3 * [True], *2 * [False]]
    assert printed.count("left out: ") == len(PROGRAMS)
