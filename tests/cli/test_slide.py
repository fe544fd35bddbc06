"""`--slide` and `perturb --boundary` at the command line."""

from __future__ import annotations

import json
from pathlib import Path

import meshio
import numpy as np
import pytest
from commands import run
from geometries import grid, shell
from meshes import sliding_on_curves
from numpy.typing import NDArray
from places import SAMPLES

from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.meshfile.reading import read
from meshfix_cli.solve.perturb import perturb


def box(path: Path, *, line: bool = False, regions: bool = False, hold: bool = False) -> Path:
    """A cube of tetrahedra in a file, maybe with a line in one of its faces, two materials, or a face to be held."""
    points, tets = grid(*[np.linspace(0, 1, 6)] * 3)
    cells: list[tuple[str, object]] = [("tetra", tets)]
    if line:
        across = np.flatnonzero((points[:, 2] == 0) & (np.abs(points[:, 1] - 0.4) < 1e-9))
        cells.append(("line", np.stack([across[:-1], across[1:]], axis=1)))
    material = {"material": [(points[tets].mean(axis=1)[:, 0] > 0.6).astype(np.int32)]}
    held = {"hold": (points[:, 2] == 0).astype(np.int32)}
    meshio.Mesh(points, cells, held if hold else None, material if regions else None).write(path, binary=False)
    return path


def points_of(path: Path) -> NDArray[np.float64]:
    return np.asarray(read(str(path)).source.points, dtype=np.float64)


def tangled(path: Path, **options: bool) -> tuple[Path, Path, Path]:
    """A box, the same tangled in its planes and edges, and the name of a third file."""
    clean = box(path / "box.vtk", **options)
    run("perturb", "--percent", "40", "--dist", "1h", "--seed", "3", "--boundary", clean, path / "bad.vtk")
    return clean, path / "bad.vtk", path / "good.vtk"


def test_a_boundary_tangled_in_its_planes_comes_back(tmp_path: Path) -> None:
    clean, bad, good = tangled(tmp_path)
    run("untangle", bad, good, code=3)
    report = json.loads(run("untangle", "--slide", "flat", "--reference", clean, "--json", bad, good).stdout)
    assert report["sliding"] == {"lines": 48, "planes": 96}
    before, after = points_of(clean), points_of(good)
    flat = np.isin(before, (0.0, 1.0))
    assert np.array_equal(after[flat], before[flat])
    assert np.abs(after - before).max() < 1e-3  # the elements have their shapes back
    run("quality", good)


def test_lines_in_a_face_end_patches_and_their_vertices_slide_along_them(tmp_path: Path) -> None:
    clean, bad, good = tangled(tmp_path, line=True)
    before, between, after = points_of(clean), points_of(bad), None
    across = (before[:, 2] == 0) & (np.abs(before[:, 1] - 0.4) < 1e-9)
    assert np.array_equal(between[across][:, 1:], before[across][:, 1:])
    assert (between[across, 0] != before[across, 0]).any()
    run("untangle", "--slide", "flat", "--reference", clean, bad, good)
    after = points_of(good)
    assert np.array_equal(after[across][:, 1:], before[across][:, 1:])
    assert (np.diff(after[across, 0]) > 0).all()


def test_edges_in_an_oblique_plane_are_those_of_the_reference(tmp_path: Path) -> None:
    flat, triangles = grid(np.linspace(0, 2, 9), np.linspace(0, 1, 5))
    frame = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    clean, bad, good = (tmp_path / f"{name}.vtk" for name in ("clean", "bad", "good"))
    meshio.Mesh(np.insert(flat, 2, 0.0, axis=1) @ frame, [("triangle", triangles)]).write(clean)
    run("perturb", "--percent", "60", "--dist", "1h", "--boundary", clean, bad)
    run("untangle", "--slide", "flat", "--reference", clean, bad, good)
    after = points_of(good) @ frame.T
    assert np.abs(after[:, 2]).max() < 1e-13
    for k, sides in enumerate(((0, 2), (0, 1))):
        for side in sides:
            assert np.abs(after[flat[:, k] == side, k] - side).max() < 1e-13


@pytest.mark.parametrize("angle", [0, 30])
def test_what_has_been_turned_since_the_reference_does_not_slide_as_it_lay_there(tmp_path: Path, angle: float) -> None:
    points, triangles = grid(*[np.linspace(-3, 3, 25)] * 2)
    triangles = triangles[(np.abs(points[triangles].mean(axis=1)) > 1).any(axis=1)]  # a square hole
    clean, bad, good = (tmp_path / f"{name}.vtk" for name in ("clean", "bad", "good"))
    hole, turn = (np.abs(points) <= 1).all(axis=1), np.exp(1j * np.radians(angle))
    moved = points.copy()
    moved[hole] = np.stack([((points @ [1, 1j]) * turn).real, ((points @ [1, 1j]) * turn).imag], axis=1)[hole]
    for name, place in ((clean, points), (bad, moved)):
        meshio.Mesh(np.insert(place, 2, 0.0, axis=1), [("triangle", triangles)]).write(name)
    run("untangle", "--slide", "flat", "--reference", clean, bad, good)
    back = (points_of(good)[:, :2] @ [1, 1j]) / turn
    rim = hole & np.isin(np.arange(len(points)), triangles)
    largest = np.maximum(np.abs(back.real), np.abs(back.imag))
    assert np.abs(largest[rim] - 1).max() < 1e-12  # on the square


@pytest.mark.parametrize("slides", [True, False])
def test_interfaces_slide_unless_they_are_told_not_to(tmp_path: Path, slides: bool) -> None:
    clean, bad, good = tangled(tmp_path, regions=True)
    option = "--slide-interfaces" if slides else "--no-slide-interfaces"
    run("untangle", "--slide", "flat", option, "--reference", clean, bad, good, code=0 if slides else 3)
    before, between, after = points_of(clean), points_of(bad), points_of(good)
    interface = np.abs(before[:, 0] - 0.6) < 1e-9
    assert np.array_equal(after[interface, 0], before[interface, 0])
    assert (after[interface] != between[interface]).any() == slides


def test_what_fix_holds_does_not_slide(tmp_path: Path) -> None:
    clean, bad, good = tangled(tmp_path, hold=True)
    run("untangle", "--slide", "flat", "--fix", "hold", "--reference", clean, bad, good, code=3)
    before, between, after = points_of(clean), points_of(bad), points_of(good)
    low, high = before[:, 2] == 0, before[:, 2] == 1
    assert np.array_equal(after[low], between[low])
    assert (after[high] != between[high]).any()


def test_the_report_tells_what_sliding_would_gain(tmp_path: Path) -> None:
    said = " ".join(run("quality", SAMPLES / "bracket.vtk").stdout.decode().split())
    assert (
        "note: with untangle --slide flat 1,263 instead of 861 vertices could move, and the ceiling would be 22.214°"
        in said
    )
    done = run("untangle", "--slide", "flat", SAMPLES / "bracket_tangled.vtk", tmp_path / "out.vtk")
    said = " ".join(done.stdout.decode().split())
    assert "with --slide" not in said
    assert "1,263 free (38 along lines, 364 in planes)" in said


def test_a_batch_slides(tmp_path: Path) -> None:
    out = tmp_path / "out"
    run("batch", "--slide", "flat", "--smooth", "best", SAMPLES / "bracket_tangled.vtk", "--output-dir", out)
    report = json.loads(run("quality", "--json", out / "bracket_tangled.vtk").stdout)
    assert report["min_angle"] > 20  # held, 17.3 is the ceiling


def written(path: Path, mesh: Mesh) -> Path:
    meshio.Mesh(mesh.points, [("tetra", mesh.topology.simplices)]).write(path)
    return path


def spheres(path: Path) -> tuple[Path, Path]:
    """The space between two spheres in a file, and the same with its boundary tangled on these."""
    valid = Mesh.build(*shell())
    bad, _ = perturb(sliding_on_curves(valid), 25, valid.mean_edge_length())
    return written(path / "clean.vtk", valid), written(path / "bad.vtk", bad)


def test_a_boundary_tangled_on_its_surfaces_comes_back(tmp_path: Path) -> None:
    (clean, bad), good = spheres(tmp_path), tmp_path / "good.vtk"
    report = json.loads(run("untangle", "--slide", "curved", "--reference", clean, "--json", bad, good).stdout)
    assert report["sliding"] == {"lines": 0, "planes": 0, "curves": 0, "surfaces": 324}
    assert report["shape"]["folds"] == 0
    assert report["shape"]["hausdorff"] == pytest.approx(0, abs=1e-6)
    assert np.abs(points_of(good) - points_of(clean)).max() < 1e-3
    done = run("untangle", "--slide", "curved", "--sweeps", "3", "--smooth", "0", bad, good, code=3)
    said = " ".join(done.stdout.decode().split())
    assert "is its own reference: vertices there stay" in said


def test_a_boundary_that_has_left_the_reference_is_not_taken_back(tmp_path: Path) -> None:
    (clean, _), moved = spheres(tmp_path), tmp_path / "moved.vtk"
    mesh = Mesh.build(*shell())
    outer = np.linalg.norm(mesh.points, axis=1) > 0.99
    pushed = written(tmp_path / "pushed.vtk", mesh.with_points(np.where(outer[:, None], 0.6, 1.0) * mesh.points))
    run("untangle", "--slide", "curved", "--reference", clean, pushed, moved)
    assert np.array_equal(points_of(moved)[outer], points_of(pushed)[outer])


def test_a_surface_that_has_moved_is_held_where_it_crosses_the_reference_too(tmp_path: Path) -> None:
    """A sphere that has moved aside still lies on the old one along a circle."""
    (clean, _), good = spheres(tmp_path), tmp_path / "good.vtk"
    mesh = Mesh.build(*shell())
    radius = np.linalg.norm(mesh.points, axis=1)
    inner = radius < radius.min() + 1e-9
    aside = written(tmp_path / "aside.vtk", mesh.with_points(mesh.points + 0.1 * inner[:, None] * [1, 0, 0]))
    run("untangle", "--slide", "curved", "--reference", clean, aside, good)
    assert np.array_equal(points_of(good)[inner], points_of(aside)[inner])
    assert not np.array_equal(points_of(good), points_of(aside))


def test_the_shape_is_kept_as_well_as_it_is_asked_for(tmp_path: Path) -> None:
    out, far = tmp_path / "out.vtk", {}
    for bound in ("0.01h", "0.1h"):
        options = "--slide", "curved", "--max-deviation", bound, "--smooth", "best", "--json"
        report = json.loads(run("untangle", *options, SAMPLES / "bracket_tangled.vtk", out).stdout)
        assert report["sliding"] == {"lines": 38, "planes": 364, "curves": 150, "surfaces": 438}
        assert report["min_angle"] > 23  # 22.214 is the ceiling of what is flat
        assert abs(report["shape"]["size"]) < 5e-3
        far[bound] = report["shape"]["hausdorff"]
    assert 0 < far["0.01h"] < far["0.1h"]
    said = " ".join(run("untangle", "--slide", "curved", SAMPLES / "plate_tangled.vtk", out).stdout.decode().split())
    assert "(52 along lines, 28 along curves)" in said
    assert "note: the boundary is within 0.0" in said
    smaller = "--slide", "curved", "--feature-angle", "5"
    report = json.loads(run("untangle", *smaller, "--json", SAMPLES / "plate_tangled.vtk", out).stdout)
    assert report["sliding"] == {"lines": 52, "planes": 0}


def test_both_ceilings_are_shown_where_the_boundary_slides(tmp_path: Path) -> None:
    """That without sliding is that of the input."""
    out, bracket = tmp_path / "out.vtk", SAMPLES / "bracket_tangled.vtk"
    held = json.loads(run("quality", "--json", bracket, code=3).stdout)["ceiling"]
    for slide in ("flat", "curved"):
        options = "--slide", slide
        report = json.loads(run("untangle", *options, "--json", bracket, out).stdout)
        assert report["ceiling_without_sliding"] == held
        shown = "none" if report["ceiling"] is None else f"{report['ceiling']:.3f}"
        assert shown == "none" if slide == "curved" else report["ceiling"] > held + 4
        said = run("untangle", *options, bracket, out).stdout.decode().splitlines()
        (with_it,) = (line for line in said if "ceiling set by" in line)
        (without,) = (line for line in said if "if nothing slid" in line)
        assert shown in with_it
        assert f"{held:.3f}" in without


def test_the_deviation_that_is_allowed_does_not_grow_with_the_tangle_inside(tmp_path: Path) -> None:
    """A mean edge of the whole mesh does."""
    bounds = []
    for percent in (1, 80):
        bad = tmp_path / "bad.vtk"
        run("perturb", "--percent", percent, "--dist", "2h", SAMPLES / "bracket.vtk", bad)
        done = run("untangle", "--slide", "curved", "--dry-run", "--json", bad)
        bounds.append(json.loads(done.stdout)["shape"]["bound"])
    assert bounds[0] == bounds[1] > 0


def test_boundaries_are_tangled_on_their_surfaces_too(tmp_path: Path) -> None:
    clean, bad, same = spheres(tmp_path)[0], tmp_path / "tangled.vtk", tmp_path / "same.vtk"
    tangling = "perturb", "--percent", "50", "--dist", "1h"
    run(*tangling, "--slide", "curved", clean, bad)
    before, after = points_of(clean), points_of(bad)
    outside, h = Mesh.build(*shell()).topology.boundary, Mesh.build(*shell()).mean_edge_length()
    assert (before[outside] != after[outside]).any(axis=1).sum() > 100
    off = np.linalg.norm(after[outside], axis=1) - np.linalg.norm(before[outside], axis=1)
    assert np.abs(off).max() < 0.03 * h
    run("untangle", "--slide", "curved", "--reference", clean, bad, same)
    bracket = SAMPLES / "bracket.vtk"
    run(*tangling, "--boundary", bracket, bad)
    run(*tangling, "--slide", "flat", bracket, same)
    assert bad.read_bytes() == same.read_bytes()
