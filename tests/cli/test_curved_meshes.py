"""Curved meshes through the commands: judged, repaired, reported, and written back with nothing else changed."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import curved_bodies
import meshio
import numpy as np
import pytest
from commands import MESHFIX, error_line, run
from geometries import grid
from places import MPIEXEC, needs_mpi
from programs import gmsh_session
from refined import SERENDIPITY, refined
from written import by_vtk

from meshfix_cli import read
from meshfix_cli.repair import Method

POINTS, TETRA = grid(*[np.linspace(0, 1, 4)] * 3)
ON_TOP = {"triangle": "triangle6", **SERENDIPITY}


def box(path: Path, bend: float = 0.0, size: float = 0.35) -> Path:
    """Write a box of tetrahedra of second order whose inner nodes are moved at random, and whose top is bent."""
    points, blocks = refined(POINTS, [("tetra", TETRA)], ON_TOP)
    inside = np.asarray(((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1))
    inside[: len(POINTS)] = False
    points = points + size / 3 * np.random.default_rng(0).uniform(-1, 1, points.shape) * inside[:, None]
    top = points[:, 2] > 1 - 1e-9
    points[top, 2] += bend * np.sin(np.pi * points[top, 0]) * np.sin(np.pi * points[top, 1])
    form = {".msh": "gmsh"}.get(path.suffix)
    meshio.write(path, meshio.Mesh(points, blocks), form)
    return path


def report(*words: object, code: int = 0) -> dict[str, object]:
    done = run(*words, "--json", code=code)
    found: dict[str, object] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".msh", ".inp"])
def test_a_curved_mesh_becomes_valid_and_only_its_nodes_move(tmp_path: Path, suffix: str) -> None:
    source, target = box(tmp_path / f"in{suffix}"), tmp_path / f"out{suffix}"
    before = report("quality", source, code=3)
    assert before["inverted"]
    done = run("untangle", source, target)
    assert b"smallest coefficient" in done.stdout
    after = report("quality", target)
    assert (after["valid"], after["inverted"]) == (True, 0)
    curved = after["quality"]["mesh"]["curved"]  # type: ignore[index]
    assert curved["count"] == len(TETRA)
    assert curved["smallest"] > 0.2
    old, new = meshio.read(source), meshio.read(target)
    outside = ~((old.points > 1e-9) & (old.points < 1 - 1e-9)).all(axis=1)
    assert new.points[outside].tobytes() == old.points[outside].tobytes()
    assert all((a.data == b.data).all() for a, b in zip(old.cells, new.cells, strict=True))


def test_nothing_moves_where_all_is_well(tmp_path: Path) -> None:
    source, target = box(tmp_path / "in.vtu", size=0.05), tmp_path / "out.vtu"
    run("untangle", source, target)
    assert target.read_bytes() == source.read_bytes()


def test_ranks_and_threads_have_the_same_bytes(tmp_path: Path) -> None:
    source = box(tmp_path / "in.vtu")
    for threads in ("1", "3"):
        run("untangle", "--threads", threads, source, tmp_path / f"{threads}.vtu")
    assert (tmp_path / "1.vtu").read_bytes() == (tmp_path / "3.vtu").read_bytes()


@needs_mpi
def test_processes_give_the_same_file(tmp_path: Path) -> None:
    source = box(tmp_path / "in.vtk")
    run("untangle", source, tmp_path / "one.vtk")
    words = [MPIEXEC, "-n", "2", MESHFIX, "untangle", "--mpi", source, tmp_path / "two.vtk"]
    done = subprocess.run(list(map(str, words)), capture_output=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "one.vtk").read_bytes() == (tmp_path / "two.vtk").read_bytes()


def test_moves_are_bounded_and_only_what_is_invalid_moves(tmp_path: Path) -> None:
    source = box(tmp_path / "in.vtu")
    start = meshio.read(source).points
    run("untangle", "--allow-inverted", "--max-move", "0.02", source, tmp_path / "near.vtu")
    run("untangle", source, tmp_path / "all.vtu")
    run("untangle", "--only-invalid", source, tmp_path / "few.vtu")
    near, all_, few = (
        np.linalg.norm(meshio.read(tmp_path / f"{name}.vtu").points - start, axis=1) for name in ("near", "all", "few")
    )
    assert 0 < near.max() <= 0.02
    assert 0 < (few > 0).sum() < (all_ > 0).sum()
    assert report("quality", tmp_path / "few.vtu")["inverted"] == 0


def test_perturbed_and_mended(tmp_path: Path) -> None:
    source = box(tmp_path / "in.vtu", bend=0.05, size=0.05)
    run("perturb", "--percent", "20", "--dist", "1h", source, tmp_path / "bad.vtu")
    assert report("quality", tmp_path / "bad.vtu", code=3)["inverted"]
    run("untangle", tmp_path / "bad.vtu", tmp_path / "good.vtu")


def test_names_are_held_and_types_that_are_not_judged_are_named(tmp_path: Path) -> None:
    source = box(tmp_path / "in.vtu")
    mesh = meshio.read(source)
    held = np.random.default_rng(1).random(len(mesh.points)) < 0.3
    mesh.point_data["still"] = held.astype(np.int32)
    mesh.write(source)
    run("untangle", "--allow-inverted", "--fix", "still", source, tmp_path / "out.vtu")
    after = meshio.read(tmp_path / "out.vtu").points
    assert after[held].tobytes() == mesh.points[held].tobytes()
    assert (after != mesh.points).any()
    pyramid = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]], dtype=float)
    points, blocks = refined(pyramid, [("pyramid", np.arange(5, dtype=np.int32)[None])], SERENDIPITY)
    points[-1] += 0.1
    by_vtk(tmp_path / "pyramid.vtu", points, blocks)
    line = error_line("quality", tmp_path / "pyramid.vtu")
    assert "1 pyramid of 13 nodes of 1 element are curved, which are not judged" in line


SOME = (
    "plate, 3 holes of 0.05",
    "ring 0.95",
    "wing 0.05",
    "pipe 0.1",
    "ball 1.2",
    "cube, 1 bubbles of 0.1",
    "torus 0.4",
    "drilled 0.2",
)


def test_meshes_around_round_things_become_valid_or_that_is_impossible(tmp_path: Path) -> None:
    """What is left is valid where the boundary gives way a little."""
    seen = []
    with gmsh_session() as gmsh:
        for name in curved_bodies.made(gmsh, SOME):
            gmsh.write(str(tmp_path / "mesh.msh"))
            document = read(tmp_path / "mesh.msh")
            mesh = document.mesh
            if mesh.quadratic is None:
                continue
            outcome = Method().solve(mesh, float("inf"), 1)
            seen.append((name, outcome.records[0].inverted, outcome.records[-1].inverted))
            assert outcome.records[-1].inverted <= outcome.records[0].inverted, name
            if not outcome.valid:
                relaxed = Method(curving="relax").solve(mesh, float("inf"), 1)
                assert relaxed.valid, name
                moved = np.linalg.norm(relaxed.after.points - mesh.points, axis=1)[~mesh.quadratic.free & ~mesh.movable]
                assert moved.max() < 0.2 * mesh.mean_edge_length(), name
    assert sum(before > 0 for _, before, _ in seen) >= 2, seen
