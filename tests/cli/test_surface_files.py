"""Surfaces from file to file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from click.testing import CliRunner
from surfaces import box, bumps, moebius, tangled, three_sheets, torus

from meshfix_cli import read
from meshfix_cli.cli import main

SUFFIXES = (".obj", ".off", ".ply", ".stl", ".vtk", ".vtu", ".msh", ".inp", ".mesh")


def run(*args: object) -> dict[str, Any]:
    """Run a command that ends well, or with elements left, and return its report."""
    result = CliRunner().invoke(main, [*map(str, args), "--json"], catch_exceptions=False)
    assert result.exit_code in (0, 3), result.output
    return dict(json.loads(result.stdout))


def save(path: Path, points: np.ndarray, rows: np.ndarray) -> Path:
    """Write a surface as meshio does."""
    key = "triangle" if rows.shape[1] == 3 else "quad"
    form = {".msh": "gmsh22", ".mesh": "medit"}.get(path.suffix)
    meshio.write(path, meshio.Mesh(points, [(key, rows)]), file_format=form)
    return path


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_of_surfaces_is_solved_and_written_back(suffix: str, tmp_path: Path) -> None:
    points, rows = torus(24, 12, jitter=0.35)
    before = save(tmp_path / f"in{suffix}", np.round(points, 6), rows)
    after = tmp_path / f"out{suffix}"
    report = run("untangle", before, after)
    stages = report["quality"]
    assert report["valid"] and report["surface"]
    assert stages["smoothed"]["percentile_1"] > stages["before"]["percentile_1"]
    here, there = read(before), read(after)
    np.testing.assert_array_equal(here.mesh.topology.simplices, there.mesh.topology.simplices)
    assert here.mesh.surface is not None and (here.mesh.points != there.mesh.points).any()
    unmoved = tmp_path / f"same{suffix}"
    run("untangle", "--smooth", "0", before, unmoved)
    assert unmoved.read_bytes() == before.read_bytes()


def test_features_stay_to_the_last_bit_and_slide_where_they_may(tmp_path: Path) -> None:
    points, rows = box(triangles=True)
    source = save(tmp_path / "in.vtk", tangled(points, rows), rows)
    reference = save(tmp_path / "before.vtk", points, rows)
    report = run("untangle", "--reference", reference, source, tmp_path / "out.vtk")
    assert report["valid"] and report["fixed"]["on features"] == 8 + 12 * 5
    after = read(tmp_path / "out.vtk").mesh.points
    on_sides = (points == 0) | (points == 6)
    edges = on_sides.sum(axis=1) > 1
    assert (after[on_sides] == points[on_sides]).all() and (after[edges] == points[edges]).all()
    sliding = run("untangle", "--slide", "flat", "--smooth", "best", reference, tmp_path / "slid.vtk")
    assert sliding["sliding"] == {"lines": 12 * 5, "planes": 6 * 25}


def test_perturb_moves_along_the_surface(tmp_path: Path) -> None:
    points, rows = box()
    source = save(tmp_path / "in.vtk", points, rows)
    report = run("perturb", "--percent", "50", "--dist", "1h", source, tmp_path / "out.vtk")
    after = read(tmp_path / "out.vtk").mesh.points
    on_sides = (points == 0) | (points == 6)
    assert report["moved"] == 109 and (after[on_sides] == points[on_sides]).all() and (after != points).any()


def test_fix_orientation_turns_outwards(tmp_path: Path) -> None:
    points, rows = torus()
    inside = rows[:, [0, 2, 1]].copy()
    inside[4] = rows[4]
    source = save(tmp_path / "in.off", points, inside)
    found = CliRunner().invoke(main, ["quality", str(source)])
    assert found.exit_code == 3 and "1 element is numbered against the rest of the mesh" in found.stdout
    run("untangle", "--fix-orientation", "--smooth", "0", source, tmp_path / "out.off")
    mesh = read(tmp_path / "out.off").mesh
    a, b, c = np.swapaxes(mesh.points[mesh.topology.simplices], 0, 1)
    assert not mesh.topology.flipped.any() and (np.cross(a, b) * c).sum() > 0


def test_sheets_and_bands_are_named(tmp_path: Path) -> None:
    sheets = run("quality", save(tmp_path / "sheets.vtk", *three_sheets()))
    assert sheets["valid"] and sheets["fixed"]["on edges of more than two elements"] == 5
    band = run("quality", save(tmp_path / "band.off", *moebius()))
    assert band["valid"] and any("no common orientation" in note for note in band["notes"])


def test_a_surface_that_crosses_itself_is_named_and_left(tmp_path: Path) -> None:
    points, rows = torus(24, 12)
    both = np.concatenate([points, np.array([1.5, 0.1, 0.2]) + points])
    source = save(tmp_path / "in.off", both, np.concatenate([rows, rows + len(points)]))
    report = run("quality", source)
    assert report["valid"] and any(note.startswith("the surface crosses itself, at ") for note in report["notes"])


def test_pages_and_cells_of_surfaces(tmp_path: Path) -> None:
    for quads in (False, True):
        source = save(tmp_path / "in.vtk", *torus(24, 12, quads=quads))
        page, cells = tmp_path / "page.html", tmp_path / "cells.vtu"
        run("untangle", "--report", page, "--cells", cells, source, tmp_path / "out.vtk")
        assert "Three-dimensional view" in page.read_text()
        name = "scaled_jacobian" if quads else "min_angle"
        assert len(meshio.read(cells).cell_data[name][0]) > 200


def test_a_plane_reference_lies_in_space_and_a_bent_one_is_none_of_a_plane(tmp_path: Path) -> None:
    points, rows = bumps()
    bent, flat = save(tmp_path / "bent.vtk", 0.01 * points * [100, 100, 1], rows), points * [1, 1, 0]
    plane = save(tmp_path / "plane.vtk", flat, rows)
    assert run("untangle", "--reference", plane, bent, tmp_path / "out.vtk")["valid"]
    found = CliRunner().invoke(main, ["untangle", "--reference", str(bent), str(plane), str(tmp_path / "out.vtk")])
    assert found.exit_code == 1 and "one lies in a plane and the other is a surface" in found.stderr


@pytest.mark.parametrize("suffix", [".stl", ".obj"])
def test_a_triangle_of_two_vertices_is_named_and_the_others_are_mended(suffix: str, tmp_path: Path) -> None:
    """As where a program has joined the ends of a short edge: what is beside it meets without it."""
    points, rows = torus(24, 12, jitter=0.35)
    start, end = rows[0, :2]
    rows = np.where(rows == end, start, rows)
    with np.errstate(invalid="ignore"):  # they have no normal
        before = save(tmp_path / f"in{suffix}", points, rows)
    report = run("untangle", before, tmp_path / f"out{suffix}")
    assert report["not_judged"] == {"collapsed_triangle": 2}
    assert not report["valid"]
    assert report["quality"]["smoothed"]["percentile_1"] > report["quality"]["before"]["percentile_1"]
