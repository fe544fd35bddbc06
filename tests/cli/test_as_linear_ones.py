"""Every command treats straight elements of second order as the linear ones of their corners: to the same bits."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from commands import MESHFIX, error_line, run
from geometries import grid
from numpy.typing import NDArray
from places import MPIEXEC, needs_mpi
from refined import SERENDIPITY, middles, refined, with_middles

from meshfix_cli import read
from meshfix_cli.meshfile.document import HALFWAY

EVERY = {**SERENDIPITY, "line": "line3"}
POINTS, TETRA = grid(*[np.linspace(0, 1, 5)] * 3)
CORNERS = len(POINTS)
INSIDE = np.asarray(((POINTS > 0) & (POINTS < 1)).all(axis=1))
# Triangles on one side, and an edge in it.
SIDE = np.array([face for row in TETRA for face in (np.delete(row, k) for k in range(4)) if not POINTS[face, 2].any()])
LINE = np.flatnonzero((POINTS[:, 2] == 0) & (POINTS[:, 1] == 0.5))


def boxes(folder: Path, tangle: bool = True, suffix: str = ".vtu") -> tuple[Path, Path]:
    """A box of two materials with cells on a side, of linear elements and of second order."""
    linear, second = folder / f"linear{suffix}", folder / f"second{suffix}"
    cells = [("tetra", TETRA), ("triangle", SIDE), ("line", np.stack([LINE[:-1], LINE[1:]], axis=1))]
    corners = POINTS.copy()
    if tangle:
        free = INSIDE & (POINTS[:, 0] != 0.75)  # which is between the materials
        corners[free] += np.random.default_rng(1).uniform(-0.25, 0.25, (int(free.sum()), 3))
    material = [(POINTS[rows].mean(axis=1)[:, 0] > 0.75).astype(np.int32) for _, rows in cells]
    for path, (points, blocks) in ((linear, (corners, cells)), (second, refined(corners, cells, EVERY))):
        meshio.Mesh(points, blocks, cell_data={"kind": material}).write(path)
    return linear, second


def halfway(cells: Any) -> tuple[int, NDArray[np.integer]]:
    """A node between two inner corners, and these."""
    return next((node, corners) for node, (corners, _) in middles(cells).items() if np.all(INSIDE[corners]))


def points_of(path: Path) -> NDArray[np.float64]:
    return np.asarray(meshio.read(path).points)


def assert_same(linear: Path, second: Path) -> None:
    """The corners have the same bits, and other nodes are in the middle."""
    one, other = points_of(linear), points_of(second)
    assert other[:CORNERS].tobytes() == one.tobytes()
    cells = [(block.type, block.data) for block in meshio.read(second).cells]
    assert with_middles(other, cells).tobytes() == other.tobytes()


OPTIONS = [
    [], ["--only-invalid"], ["--max-move", "1h"], ["--slide", "flat"], ["--slide", "curved"], ["--smooth", "best"],
    ["--threads", "2"], ["--regions", "kind"], ["--regions", "kind", "--slide", "flat"], ["--strategy", "FF"],
]  # fmt: skip


@pytest.mark.parametrize("options", OPTIONS, ids=" ".join)
def test_untangle_moves_corners_as_those_of_linear_elements(options: list[str], tmp_path: Path) -> None:
    reports = []
    for path in boxes(tmp_path):
        done = run("untangle", "--json", *options, path, tmp_path / f"out_{path.name}")
        reports.append(json.loads(done.stdout))
    assert_same(tmp_path / "out_linear.vtu", tmp_path / "out_second.vtu")
    linear, second = reports
    assert second.pop("higher_order") == {"tetra10": len(TETRA)}
    for name in ("vertices", "free_vertices", "fixed", "valid", "elements", "displacement", "quality", "obstacles"):
        assert second[name] == linear[name], name


def test_perturb_and_quality(tmp_path: Path) -> None:
    linear, second = boxes(tmp_path, tangle=False)
    outs = [path.with_name(f"bad_{path.name}") for path in (linear, second)]
    for path, out in zip((linear, second), outs, strict=True):
        run("perturb", "--percent", "60", "--dist", "1h", "--boundary", path, out)
    assert_same(*outs)
    one, other = (run("quality", out, code=3).stdout.decode().splitlines() for out in outs)
    assert "384 tetrahedra of 10 nodes, 125 vertices" in other[0]
    count = len(points_of(second)) - CORNERS
    notes = [line for line in other if line not in one[1:]]
    assert notes[1:] == [f"note: no element is curved: {count:,} nodes lie between corners and follow them"]
    cells = tmp_path / "cells.vtu"
    run("quality", "-q", "--cells", cells, outs[1], code=3)
    assert sum(meshio.read(cells).cell_data["inverted"][0]) > 10
    run("untangle", "-q", "--slide", "flat", "--reference", second, outs[1], tmp_path / "good.vtu")
    assert np.abs(points_of(tmp_path / "good.vtu") - points_of(second)).max() < 1e-2


def test_batch(tmp_path: Path) -> None:
    run("batch", "-q", *boxes(tmp_path), "--output-dir", tmp_path / "out")
    assert_same(tmp_path / "out" / "linear.vtu", tmp_path / "out" / "second.vtu")


@needs_mpi
def test_processes(tmp_path: Path) -> None:
    _, second = boxes(tmp_path)
    run("untangle", "-q", second, tmp_path / "alone.vtu")
    command = [MPIEXEC, "-n", "2", MESHFIX, "untangle", "--mpi", "-q", second, tmp_path / "both.vtu"]
    subprocess.run([str(one) for one in command], check=False, capture_output=True)
    assert (tmp_path / "both.vtu").read_bytes() == (tmp_path / "alone.vtu").read_bytes()


def test_a_node_that_is_held_holds_its_corners(tmp_path: Path) -> None:
    points, cells = refined(POINTS, [("tetra", TETRA)], EVERY)
    node, corners = halfway(cells)
    pin = (np.arange(len(points)) == node).astype(np.int32)
    meshio.Mesh(points, cells, {"pin": pin}).write(tmp_path / "in.vtu")
    held = read(tmp_path / "in.vtu", fix="pin").mesh.movable
    assert np.flatnonzero(INSIDE & ~held[:CORNERS]).tolist() == sorted(corners.tolist())


def test_a_cell_at_a_node_holds_its_corners(tmp_path: Path) -> None:
    points, cells = refined(POINTS, [("tetra", TETRA)], EVERY)
    node, corners = halfway(cells)
    held = document_with(tmp_path, points, [*cells, ("vertex", [[node]])]).mesh.movable
    assert np.flatnonzero(INSIDE & ~held[:CORNERS]).tolist() == sorted(corners.tolist())


def test_facets_beside_which_a_node_is_elsewhere_do_not_slide(tmp_path: Path) -> None:
    """A triangle of second order that is of no element's nodes may be curved: what it has stays."""
    from meshfix_cli.meshfile.sliding import slid

    points, cells = refined(POINTS, [("tetra", TETRA), ("triangle", SIDE)], EVERY)
    alike = slid(document_with(tmp_path, points, cells)).mesh.movable
    own = cells[1][1].copy()
    own[0, 3:] = len(points) + np.arange(3)
    points = np.concatenate([points, points[cells[1][1][0, 3:]]])
    other = slid(document_with(tmp_path, points, [cells[0], (cells[1][0], own)])).mesh.movable
    assert alike[SIDE].sum() > other[SIDE].sum() == 0


def document_with(folder: Path, points: NDArray[np.float64], cells: Any) -> Any:
    meshio.Mesh(points, cells).write(folder / "in.vtu")
    return read(folder / "in.vtu")


def test_elements_of_both_orders_in_one_file(tmp_path: Path) -> None:
    """Some of them are refined; a node halfway of an edge of others stays."""
    points, cells = refined(POINTS, [("tetra", TETRA[::2])], EVERY)
    linear = document_with(tmp_path, POINTS, [("tetra", TETRA)])
    document = document_with(tmp_path, points, [*cells, ("tetra", TETRA[1::2])])
    assert document.mesh.movable[:CORNERS].tolist() == linear.mesh.movable.tolist()
    assert document.higher_order == {"tetra10": len(TETRA[::2])}
    first = run("quality", tmp_path / "in.vtu").stdout.decode().splitlines()[0]
    assert "192 tetrahedra, 192 tetrahedra of 10 nodes, 125 vertices" in first
    # Triangles against the halves of an edge.
    flat = np.array([[0, 0], [2, 0], [1, 2], [1, 0], [0, -1.5], [2, -1.5], [1.5, 1], [0.5, 1]], dtype=float)
    blocks = [("triangle6", [[0, 1, 2, 3, 6, 7]]), ("triangle", [[0, 4, 3], [3, 5, 1], [3, 4, 5]])]
    document = document_with(tmp_path, np.insert(flat, 2, 0.0, axis=1), blocks)
    assert document.holds[HALFWAY][[0, 1, 3]].all()
    assert not document.mesh.movable.any()


@pytest.mark.parametrize("broken", ["missing", "nan"])
def test_what_cannot_be_followed_is_told_in_a_line(broken: str, tmp_path: Path) -> None:
    points, cells = refined(POINTS, [("tetra", TETRA)], EVERY)
    if broken == "missing":
        cells[0][1][7, 9] = len(points)
    else:
        points[CORNERS + 3] = np.nan
    meshio.Mesh(points, cells).write(tmp_path / "in.vtu", binary=False)
    line = error_line("untangle", tmp_path / "in.vtu", tmp_path / "out.vtu")
    expected = {
        "missing": "element 7 refers to vertices",
        "nan": f"vertex {CORNERS + 3} has a coordinate that is not finite",
    }
    assert expected[broken] in line
    assert not (tmp_path / "out.vtu").exists()
