"""Straight elements of second order: solved by their corners, their other nodes follow, in files of other programs."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from building import Blocks, Points
from elements import MESHES, box_of_hexahedra, collapsed, tangles
from geometries import GEOMETRIES
from numpy.typing import NDArray
from programs import TILTED
from refined import COMPLETE, SERENDIPITY, middles, refined
from splicing import WORD, repaired
from written import SOLIDS, by_vtk

from meshfix_cli import Mesh, read, untangle, write
from meshfix_cli.meshfile.document import Document

FAMILIES = [
    ("block", SERENDIPITY), ("plate with holes", SERENDIPITY), ("quads and triangles", COMPLETE),
    ("quad plate", SERENDIPITY), ("hexes", SERENDIPITY), ("hexes", COMPLETE), ("wedge plate", SERENDIPITY),
    ("wedge plate", COMPLETE), ("every solid", SERENDIPITY), ("every solid", COMPLETE),
]  # fmt: skip


@cache
def made(name: str) -> tuple[Points, Blocks]:
    """Linear elements: simplices of one type, or of any."""
    if name == "hexes":
        return box_of_hexahedra(343)
    if name in MESHES:
        return MESHES[name]()
    points, cells = GEOMETRIES[name]()
    return points, [("tetra" if cells.shape[1] == 4 else "triangle", cells)]


def tangled(name: str, way: str) -> Points:
    """Points of the corners."""
    mesh = Mesh.build(*made(name))
    if way == "collapsed":
        return collapsed(mesh.points, mesh.movable)
    return tangles(name, mesh.points, mesh.movable, mesh.mean_edge_length())["P=25 D=2h"]


def in_space(points: NDArray[np.floating]) -> NDArray[np.floating]:
    return np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])


def tangled_file(path: Path, name: str, types: dict[str, str], way: str = "P=25 D=2h", turn: Any = None) -> Blocks:
    flat = in_space(tangled(name, way)).astype(np.float64)
    points, cells = refined(flat if turn is None else flat @ turn, made(name)[1], types)
    (by_vtk if path.suffix == ".vtu" and "text" not in path.stem else SOLIDS.get(path.name, by_vtk))(
        path, points, cells
    )
    return cells


def assert_in_the_middle(points: NDArray[np.floating], cells: Blocks, kept: NDArray[np.floating]) -> None:
    """Of corners that moved; whose corners have not, stays."""
    moved = (points != kept).any(axis=1)
    for node, (corners, weights) in middles(cells).items():
        if not moved[corners].any():
            assert not moved[node]
        elif len(corners) == 2:
            assert points[node].tolist() == points[corners].astype(float).mean(axis=0).astype(points.dtype).tolist()
        else:
            np.testing.assert_allclose(points[node], weights @ points[corners], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(("name", "types"), FAMILIES)
@pytest.mark.parametrize("way", ["P=25 D=2h", "collapsed", "turned"])
def test_all_become_valid_and_nodes_stay_in_the_middle(
    name: str, types: dict[str, str], way: str, tmp_path: Path
) -> None:
    cells = tangled_file(tmp_path / "text.vtk", name, types, way, TILTED if way == "turned" else None)
    before = read(tmp_path / "text.vtk")
    assert before.not_judged == {}
    assert before.higher_order == {key: len(rows) for key, rows in cells}
    document, points = repaired(tmp_path / "text.vtk", tmp_path / "out.vtk")
    assert_in_the_middle(points, cells, document.source.points)
    after = read(tmp_path / "out.vtk")
    assert after.source.points.tobytes() == points.tobytes()
    assert after.mesh.check()[0] == 0
    straight = Mesh.build(after.mesh.points, after.solved.blocks)
    assert straight.topology.m == sum(len(rows) for _, rows in cells)


FILES = ["text.vtk", "binary.vtk", "text.vtu", "text_2.msh", "binary_2.msh", "text_4.msh", "binary_4.msh"]


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("name", ["every solid", "quads and triangles"])
def test_all_bytes_but_those_of_coordinates_stay(name: str, file: str, tmp_path: Path) -> None:
    cells = tangled_file(tmp_path / file, name, SERENDIPITY)
    document, points = repaired(tmp_path / file, tmp_path / f"out_{file}")
    old, new = ((tmp_path / one).read_bytes() for one in (file, f"out_{file}"))
    original = document.source.points
    assert_in_the_middle(points, cells, original)
    if "binary" in file:
        order = ">" if file.endswith("vtk") else "<"
        held, there = (one.astype(f"{order}f8").tobytes() for one in (original, points))
        if held in old:  # else each has its number beside it
            assert new == old.replace(held, there)
        assert len(new) == len(old)
        return
    words = zip(WORD.split(old), WORD.split(new), strict=True)
    changed = sorted(float(after) for before, after in words if before != after)
    assert changed == sorted(points[points != original].tolist())


def test_single_precision_is_that_of_the_file(tmp_path: Path) -> None:
    points, cells = refined(tangled("block", "P=25 D=2h"), made("block")[1], SERENDIPITY)
    rows = [(key, values) for key, values in cells]
    meshio.Mesh(points.astype(np.float32), rows).write(tmp_path / "in.vtu")
    document, moved = repaired(tmp_path / "in.vtu", tmp_path / "out.vtu")
    assert document.source.points.dtype == moved.dtype == np.float32
    assert_in_the_middle(moved, cells, document.source.points)
    assert read(tmp_path / "out.vtu").higher_order == {"tetra10": len(cells[0][1])}


def test_a_file_of_few_digits_stays_straight(tmp_path: Path) -> None:
    """What has moved has all digits afterwards, and what has not the few that it had."""
    points, cells = refined(1000 + 100 * tangled("block", "P=25 D=2h"), made("block")[1], SERENDIPITY)
    short = np.array([float(f"{x:.6g}") for x in points.ravel()]).reshape(-1, 3)
    by_vtk(tmp_path / "in.vtk", short, cells)
    _, moved = repaired(tmp_path / "in.vtk", tmp_path / "out.vtk")
    assert_in_the_middle(moved, cells, short)
    after = read(tmp_path / "out.vtk")
    assert after.ties is not None
    assert after.ties.nodes.sum() == len(middles(cells))
    assert after.mesh.check()[0] == 0


CONVERSIONS = {
    "every solid": (".msh", ".vtk", ".vtu", ".med"), "hexes": (".bdf", ".inp", ".e"),
    "block": (".bdf", ".inp", ".xdmf", ".e"),
    "quads and triangles": (".msh", ".vtk", ".vtu", ".xdmf", ".inp", ".med"),
}  # fmt: skip


@pytest.mark.parametrize(("name", "suffix"), [(name, one) for name, some in CONVERSIONS.items() for one in some])
def test_a_converted_file_has_all_nodes(name: str, suffix: str, tmp_path: Path) -> None:
    cells = tangled_file(tmp_path / "text.vtk", name, SERENDIPITY)
    document, points = repaired_as(tmp_path / "text.vtk", tmp_path / f"out{suffix}")
    assert_in_the_middle(points, cells, document.source.points)
    after = read(tmp_path / f"out{suffix}")
    assert after.mesh.check()[0] == 0
    assert after.higher_order == {key: len(rows) for key, rows in cells}
    known = {run.type: in_space(after.source.points)[run.vertices] for run in after.source.cells}
    for key, rows in cells:
        np.testing.assert_allclose(np.sort(known[key], axis=0), np.sort(points[rows], axis=0), rtol=1e-9, atol=1e-9)


def repaired_as(path: Path, target: Path) -> tuple[Document, NDArray[np.floating]]:
    document = read(path)
    after = untangle(document.mesh).after
    write(document, after, target)
    return document, document.file_points(after)
