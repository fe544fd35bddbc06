"""What no motion can mend: it is named, and is no success."""

from __future__ import annotations

import json
from pathlib import Path

import meshio
import numpy as np
from commands import VALID, run

from meshfix_cli import read


def test_elements_that_nothing_can_mend_are_counted(tmp_path: Path) -> None:
    mesh = meshio.read(VALID)
    document = read(VALID)
    simplices = document.mesh.topology.simplices
    a, b, c = simplices[~document.mesh.movable[simplices].any(axis=1)][0]
    mesh.points[a] = mesh.points[b] + mesh.points[c] - mesh.points[a]
    mesh.write(tmp_path / "in.vtk")
    text = run("untangle", tmp_path / "in.vtk", tmp_path / "out.vtk", code=3).stdout.decode()
    stuck = json.loads(run("quality", "--json", tmp_path / "in.vtk", code=3).stdout)["obstacles"]["inverted"]
    assert f"IMPOSSIBLE: {len(stuck)} of them without a free vertex" in text
    assert str(stuck[0]) in text
    run("untangle", "--allow-inverted", tmp_path / "in.vtk", tmp_path / "out.vtk")


def test_what_an_interface_makes_impossible_is_told(tmp_path: Path) -> None:
    """The outer half of a square has moved over the corner of the inner one, which its material holds."""
    points = np.array([[0.0, 0], [2, 0], [2, 2], [0, 2], [0.5, 0.5], [1.5, 0.5], [1.5, 1.5], [0.5, 1.5], [1, 1]])
    inner = [[4, 5, 8], [5, 6, 8], [6, 7, 8], [7, 4, 8]]
    outer = [[0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]]
    points[4] = [-0.5, 1]
    mesh = meshio.Mesh(points, [("triangle", inner + outer)], cell_data={"material": [[1] * 4 + [2] * 8]})
    mesh.write(tmp_path / "in.vtu")
    text = run("untangle", tmp_path / "in.vtu", tmp_path / "out.vtu", code=3).stdout.decode()
    assert "among the fixed vertices are 4 between regions of material: --regions none lets them move" in text
    assert "--regions none" not in run("quality", "--regions", "none", tmp_path / "in.vtu", code=3).stdout.decode()
    run("untangle", "--regions", "none", tmp_path / "in.vtu", tmp_path / "out.vtu")


def test_a_boundary_that_crosses_itself_is_no_success(tmp_path: Path) -> None:
    """The left half of the plate moved onto the right one; what is left valid is not called valid."""
    mesh = meshio.read(VALID)
    held = ~read(VALID).mesh.movable
    hole = held & (np.linalg.norm(mesh.points[:, :2] - [0.8, 1.25], axis=1) < 0.4)
    mesh.points[hole, 1] += 0.6
    mesh.write(tmp_path / "in.vtk")
    for command in (["quality"], ["untangle", "--sweeps", "20"]):
        output = [tmp_path / "out.vtk"] if command[0] == "untangle" else []
        text = run(*command, tmp_path / "in.vtk", *output, code=3).stdout.decode()
        assert "IMPOSSIBLE: the fixed boundary crosses itself in " in text
        assert "valid: no element" not in text
        facts = json.loads(run(*command, "--json", tmp_path / "in.vtk", *output, code=3).stdout)
        assert not facts["valid"]
        assert len(facts["obstacles"]["crossing"]) >= 2
