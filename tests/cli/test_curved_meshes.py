"""Curved meshes through the commands: judged, repaired, reported, and written back with nothing else changed."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import curved_bodies
import meshio
import numpy as np
import pytest
from commands import MESHFIX, error_line, run
from geometries import grid
from numpy.typing import NDArray
from places import MPIEXEC, needs_mpi
from programs import gmsh_session
from refined import SERENDIPITY, refined
from written import by_vtk

from meshfix_cli import read
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.judged import VALID
from meshfix_cli.quality.formulas import evaluate
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
    source, target = box(tmp_path / "in.vtu", size=0.02), tmp_path / "out.vtu"
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


def test_sweeps_are_limited(tmp_path: Path) -> None:
    """Those of straight elements, where corners are tangled, and each step of curved ones; not what smooths."""
    nodes, corners = box(tmp_path / "nodes.vtu"), box(tmp_path / "corners.vtu")
    mesh = meshio.read(corners)
    inside = np.asarray(((mesh.points > 1e-9) & (mesh.points < 1 - 1e-9)).all(axis=1))[: len(POINTS)]
    mesh.points[: len(POINTS)][inside] += np.random.default_rng(1).uniform(-0.4, 0.4, (int(inside.sum()), 3))
    mesh.write(corners)
    for source in (nodes, corners):
        words = ["untangle", "--allow-inverted", "--curving", "relax", source, tmp_path / "out.vtu"]
        needed = [one for one in report(*words)["sweeps"] if one["sweep"] and "smoothing" not in one["phase"]]  # type: ignore[attr-defined]
        for most in (0, 1, len(needed)):
            found = report(*words, "--sweeps", most)
            done = [one for one in found["sweeps"] if one["sweep"] and "smoothing" not in one["phase"]]  # type: ignore[attr-defined]
            assert len(done) <= most
            assert found["inverted"] <= found["sweeps"][0]["inverted"]  # type: ignore[index]
            if most == 0 and source == nodes:
                assert (tmp_path / "out.vtu").read_bytes() == source.read_bytes()


def test_perturbed_and_mended(tmp_path: Path) -> None:
    source = box(tmp_path / "in.vtu", bend=0.05, size=0.05)
    run("perturb", "--percent", "20", "--dist", "1h", source, tmp_path / "bad.vtu")
    assert report("quality", tmp_path / "bad.vtu", code=3)["inverted"]
    run("untangle", tmp_path / "bad.vtu", tmp_path / "good.vtu")


def test_what_does_not_slide_is_told(tmp_path: Path) -> None:
    source = box(tmp_path / "in.vtu")
    told = "--slide {} has no effect: the boundary of curved elements does not slide"
    for slide in ("flat", "curved"):
        found = report("untangle", "--allow-inverted", "--slide", slide, source, tmp_path / f"{slide}.vtu")
        assert told.format(slide) in found["notes"]  # type: ignore[operator]
    run("untangle", source, tmp_path / "none.vtu")
    assert (tmp_path / "none.vtu").read_bytes() == (tmp_path / "flat.vtu").read_bytes()
    assert not any("--slide" in note for note in report("untangle", source, tmp_path / "none.vtu")["notes"])  # type: ignore[attr-defined]
    for words, slide in ((["--boundary"], "flat"), (["--slide", "curved"], "curved")):
        tangle = ["perturb", "--percent", "10", "--dist", "0.1h", *words]
        found = report(*tangle, source, tmp_path / "moved.vtu")
        assert told.format(slide) in found["notes"]  # type: ignore[operator]


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
    assert "1 of 1 element is curved (pyramids of 13 nodes)" in line


@pytest.mark.parametrize("kind", ["tetra", "hexahedron"])
def test_scaled_jacobians_are_those_of_the_curved_elements(tmp_path: Path, kind: str) -> None:
    """In requirements, in files of cells and for programs, beside those of straight elements that are well."""
    source, corners = tmp_path / "in.vtu", POINTS
    rows = TETRA if kind == "tetra" else hexahedra(4)
    points, blocks = refined(corners, [(kind, rows)], ON_TOP)
    inside = np.asarray(((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1))
    inside[: len(corners)] = False
    points[inside] += np.random.default_rng(0).uniform(-0.1, 0.1, points[inside].shape)
    meshio.Mesh(points, blocks).write(source)
    found = report("quality", source, "--metric", "scaled_jacobian", "--metric", "shape", "--all", code=3)
    mesh = read(source).mesh
    assert mesh.quadratic is not None
    judged = mesh.quadratic.judge(mesh.points, 1)
    smallest, straight = judged.scaled_jacobians.min(), evaluate("scaled_jacobian", replace(mesh, quadratic=None))
    assert smallest < straight.min() - 0.1
    told = found["quality"]["mesh"]  # type: ignore[index]
    assert told["metrics"]["scaled_jacobian"] == {
        "worst": pytest.approx(smallest), "mean": pytest.approx(judged.scaled_jacobians.mean()),
    }  # fmt: skip
    if kind == "hexahedron":
        assert told["scaled_jacobian"]["smallest"] == pytest.approx(smallest)
    first = {one["id"]: one for one in found["first_inverted"]}  # type: ignore[attr-defined]
    inverted = np.flatnonzero(judged.verdicts != VALID)
    assert list(first) == inverted.tolist()
    for row in inverted.tolist():
        assert first[row]["scaled_jacobian"] == pytest.approx(judged.scaled_jacobians[row])
        assert first[row]["smallest_coefficient"] == pytest.approx(judged.smallest[row])
    run("quality", "--cells", tmp_path / "cells.vtu", source, code=3)
    cells = meshio.read(tmp_path / "cells.vtu").cell_data["scaled_jacobian"][0]
    np.testing.assert_allclose(cells, judged.scaled_jacobians)
    target = tmp_path / "out.vtu"
    run("untangle", source, target)
    reached = read(target).mesh
    assert reached.quadratic is not None
    value = reached.quadratic.judge(reached.points, 1).scaled_jacobians.min()
    for share, code in ((0.99, 0), (1.01, 3)):
        run("quality", "--require", f"scaled_jacobian >= {share * value}", target, code=code)


def hexahedra(n: int) -> NDArray[np.int32]:
    """The hexahedra of a grid of n points along each axis."""
    first = np.arange(n**3, dtype=np.int32).reshape(n, n, n)[:-1, :-1, :-1].ravel()
    base = np.array([0, n * n, n * n + n, n], dtype=np.int32)
    return np.column_stack([first[:, None] + base, first[:, None] + base + 1])


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
    """Each element that is left is named, and is valid where the boundary gives way a little."""
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
                left = mesh.quadratic.rows[mesh.quadratic.judge(outcome.after.points, 1).verdicts != VALID]
                assert np.isin(left, [*outcome.obstacles.inverted, *outcome.obstacles.exclusive]).all(), name
                relaxed = Method(curving="relax").solve(mesh, float("inf"), 1)
                assert relaxed.valid, name
                moved = np.linalg.norm(relaxed.after.points - mesh.points, axis=1)[~mesh.quadratic.free & ~mesh.movable]
                assert moved.max() < 0.2 * mesh.mean_edge_length(), name
    assert sum(before > 0 for _, before, _ in seen) >= 2, seen


@pytest.mark.parametrize(("h", "width"), [(0.1, 0.03), (0.15, 0.03), (0.2, 0.03)])
def test_coefficients_are_not_raised_by_making_elements_thin(tmp_path: Path, h: float, width: float) -> None:
    """Relative to the straight element they rise there as well, as around a slit that few elements resolve."""
    with gmsh_session(ElementOrder=2, MeshSizeMin=h, MeshSizeMax=h) as gmsh:
        occ = gmsh.model.occ
        occ.fragment([(2, occ.addRectangle(-0.5, -0.5, 0, 1, 1))], [(2, occ.addDisk(0, 0, 0, 0.2, width))])
        occ.synchronize()
        gmsh.model.mesh.generate(2)
        gmsh.write(str(tmp_path / "slit.msh"))
    mesh = read(tmp_path / "slit.msh").mesh
    assert mesh.quadratic is not None
    after = [Method(smooth=smooth).solve(mesh, float("inf"), 1).after.points for smooth in (0, "auto", "best")]
    left, usual, best = (mesh.quadratic.judge(points, 1) for points in after)
    assert (left.verdicts == VALID).all()
    assert usual.smallest.min() > left.smallest.min()
    assert left.scaled_jacobians.min() <= usual.scaled_jacobians.min() < best.scaled_jacobians.min()


SQUARE, TRIANGLES = grid(*[np.linspace(0, 1, 5)] * 2)


def plate(path: Path, kinds: tuple[str, ...] = ("triangle",), seam: bool = False, height: float = 0.0) -> Path:
    """Write a square of second order, of linear triangles beyond the middle if asked, whose inner nodes are moved."""
    left = SQUARE[TRIANGLES].mean(axis=1)[:, 0] < 0.5
    points, blocks = refined(SQUARE, [("triangle", TRIANGLES if len(kinds) == 1 else TRIANGLES[left])], ON_TOP)
    inside = np.asarray(((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1))
    inside[: len(SQUARE)] = False
    inside &= ~np.isclose(points[:, 0], 0.5)
    points = np.column_stack([points, np.zeros(len(points))])
    points[inside, :2] += np.random.default_rng(4).uniform(-0.25, 0.25, (int(inside.sum()), 2))
    points[inside, 2] += height
    if len(kinds) > 1:
        blocks.append(("triangle", TRIANGLES[~left]))
    if seam:  # each element has nodes of its own between corners
        rows = blocks[0][1]
        own = len(SQUARE) + np.arange(3 * len(rows)).reshape(-1, 3)
        points = np.concatenate([points[: len(SQUARE)], points[rows[:, 3:]].reshape(-1, 3)])
        blocks = [("triangle6", np.column_stack([rows[:, :3], own]))]
    meshio.Mesh(points, blocks).write(path)
    return path


def moved(source: Path, target: Path) -> NDArray[np.float64]:
    return np.linalg.norm(meshio.read(target).points - meshio.read(source).points, axis=1)


def test_nodes_alone_are_mended_by_nodes_alone(tmp_path: Path) -> None:
    """Corners that are well stay, unless for the shapes."""
    source = plate(tmp_path / "in.vtu")
    assert report("quality", source, code=3)["inverted"]
    run("untangle", "--smooth", "0", source, tmp_path / "out.vtu")
    assert not moved(source, tmp_path / "out.vtu")[: len(SQUARE)].any()


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("bend", [0.02, 0.4])
def test_linear_elements_beside_curved_ones_are_untangled(tmp_path: Path, d: int, bend: float) -> None:
    """Also where all that is curved is valid; nodes between both kinds stay in the middle of their edges."""
    corners, simplices = grid(*[np.linspace(0, 1, 5)] * d)
    kind, left = ("triangle", "tetra")[d - 2], corners[simplices].mean(axis=1)[:, 0] < 0.5
    points, blocks = refined(corners, [(kind, simplices[left])], ON_TOP)
    blocks.append((kind, simplices[~left]))
    inside, random = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1), np.random.default_rng(2)
    node = np.arange(len(points)) >= len(corners)
    size = np.where(node, bend / 3, 0.5) * inside * ((points[:, 0] < 0.5 - 1e-9) == node) * (points[:, 0] != 0.5)
    points = points + size[:, None] * random.uniform(-1, 1, points.shape)
    points = np.column_stack([points, np.zeros((len(points), 3 - d))])
    meshio.Mesh(points, blocks).write(tmp_path / "in.vtu")
    mesh = read(tmp_path / "in.vtu").mesh
    assert mesh.quadratic is not None
    assert mesh.check()[0] > (mesh.quadratic.judge(mesh.points, 1).verdicts != VALID).sum()
    run("untangle", tmp_path / "in.vtu", tmp_path / "out.vtu")
    assert report("quality", tmp_path / "out.vtu")["valid"]
    after, rows = meshio.read(tmp_path / "out.vtu").points, blocks[0][1]
    ends = [np.flatnonzero(weights) for weights in ELEMENTS[blocks[0][0]].weights]
    for place, (a, b) in enumerate(ends, d + 1):
        between = np.isclose(points[rows[:, [a, b]], 0], 0.5).all(axis=1)
        middles = after[rows[between][:, [a, b]]].mean(axis=1)
        np.testing.assert_allclose(after[rows[between, place]], middles, atol=1e-12)


def test_what_fixed_nodes_make_impossible_is_named(tmp_path: Path) -> None:
    """A curved element at one corner of a square, without a free node there, and a linear one at another."""
    source = plate(tmp_path / "in.vtu", kinds=("triangle6", "triangle"))
    mesh = meshio.read(source)
    curved, linear = (cells.data for cells in mesh.cells)
    outside, expected = ((SQUARE == 0) | (SQUARE == 1)).all(axis=1), []
    for row, nodes in enumerate([*curved, *linear]):
        (alone,) = [v for v in nodes[:3] if outside[v] and (v == TRIANGLES).sum() == 1] or [None]
        if alone is None:
            continue
        expected.append(row)
        if row < len(curved):  # its edges turn past each other
            place = int(np.flatnonzero(nodes == alone)[0])
            ends = nodes[[3 + place, 3 + (place + 2) % 3]]
            mesh.points[ends] += 1.2 * (mesh.points[ends] - mesh.points[alone])[::-1]
        else:
            mesh.points[alone] += 1.1 * (mesh.points[nodes].sum(axis=0) - 3 * mesh.points[alone])
    assert len(expected) == 2
    mesh.write(source)
    found = report("quality", source, code=3)
    assert found["obstacles"]["inverted"] == expected  # type: ignore[index]
    which = ", ".join(map(str, expected))
    named = f"IMPOSSIBLE: 2 of them wherever free nodes go: the fixed ones are wrong (elements {which})"
    assert named in " ".join(run("quality", source, code=3).stdout.decode().split())


def test_held_nodes_stay_where_corners_are_tangled(tmp_path: Path) -> None:
    source = plate(tmp_path / "in.vtu")
    mesh = meshio.read(source)
    held = np.arange(len(mesh.points)) == len(SQUARE) + 20
    free = ((SQUARE > 0) & (SQUARE < 1)).all(axis=1)
    mesh.points[: len(SQUARE)][free, :2] += np.random.default_rng(5).uniform(-0.3, 0.3, (int(free.sum()), 2))
    mesh.point_data["hold"] = held.astype(np.int32)
    mesh.write(source)
    run("untangle", "--allow-inverted", "--fix", "hold", source, tmp_path / "out.vtu")
    assert not moved(source, tmp_path / "out.vtu")[held].any()
    assert moved(source, tmp_path / "out.vtu").any()


def test_elements_do_not_part(tmp_path: Path) -> None:
    """Nodes on two sides of a seam stay, and those on edges of elements that do not have them."""
    source = plate(tmp_path / "seam.vtu", seam=True)
    run("untangle", "--allow-inverted", source, tmp_path / "out.vtu")
    assert not moved(source, tmp_path / "out.vtu")[len(SQUARE) :].any()
    source = plate(tmp_path / "mixed.vtu", kinds=("triangle6", "triangle"))
    run("untangle", "--allow-inverted", source, tmp_path / "out.vtu")
    points = meshio.read(source).points
    between = np.isclose(points[:, 0], 0.5)
    assert between.sum() > 5
    assert not moved(source, tmp_path / "out.vtu")[between].any()


def test_nodes_off_the_plane_and_repetitions_are_refused(tmp_path: Path) -> None:
    line = error_line("quality", plate(tmp_path / "in.vtu", height=0.1))
    assert "between corners are not in their plane" in line
    source = plate(tmp_path / "in.vtu")
    mesh = meshio.read(source)
    rows = mesh.cells[0].data
    other = rows[:1].copy()
    other[0, 3:] = rows[5, 3:]
    meshio.Mesh(mesh.points, [("triangle6", np.concatenate([rows, other]))]).write(source)
    assert "some are repeated" in error_line("quality", source)


def test_straight_parts_that_overlap_are_named_beside_curved_ones(tmp_path: Path) -> None:
    corners = np.array([[0, 0], [4, 0], [0, 4], [0.5, 0.5], [1, 0.5], [0.5, 1]], dtype=float)
    points, blocks = refined(corners, [("triangle", np.arange(6, dtype=np.int32).reshape(2, 3))], ON_TOP)
    points = np.column_stack([points, np.zeros(len(points))])
    points[6, 1] -= 0.1
    meshio.Mesh(points, blocks).write(tmp_path / "in.vtu")
    assert report("quality", tmp_path / "in.vtu", code=3)["obstacles"]["overlapping"]  # type: ignore[index]


def test_what_gives_way_keeps_to_how_far_it_may_go(tmp_path: Path) -> None:
    source = plate(tmp_path / "in.vtu")
    mesh = meshio.read(source)
    left = np.isclose(mesh.points[:, 0], 0) & (np.arange(len(mesh.points)) >= len(SQUARE))
    mesh.points[left, 0] += 1.5
    mesh.write(source)
    run("untangle", "--allow-inverted", "--curving", "relax", "--max-move", "0.05", source, tmp_path / "near.vtu")
    assert moved(source, tmp_path / "near.vtu").max() <= 0.05
    run("untangle", "--curving", "relax", source, tmp_path / "out.vtu")
    assert 0.05 < moved(source, tmp_path / "out.vtu")[left].max() < 1.5
