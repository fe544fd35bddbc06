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
from files_pvtu import slabs, split
from geometries import GEOMETRIES
from numpy.typing import NDArray
from programs import TILTED
from refined import COMPLETE, SERENDIPITY, middles, refined
from splicing import WORD, repaired
from written import SOLIDS, by_vtk

from meshfix_cli import Mesh, read, untangle, write
from meshfix_cli.mesh.elements import ELEMENTS
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


@pytest.mark.parametrize("types", [SERENDIPITY, COMPLETE], ids=["serendipity", "complete"])
@pytest.mark.parametrize("file", ["text.vtk", "binary.vtk", "text.vtu"])
def test_elements_are_renumbered_with_all_their_nodes(file: str, types: dict[str, str], tmp_path: Path) -> None:
    points, cells = refined(*made("every solid"), types)
    turned = [(key, rows.copy()) for key, rows in cells]
    for key, rows in turned:
        rows[::5] = rows[::5][:, list(ELEMENTS[key].mirrored)]
    SOLIDS[file](tmp_path / file, points, turned)
    assert read(tmp_path / file).mesh.topology.misnumbered.sum() == sum(len(rows[::5]) for _, rows in cells)
    document = read(tmp_path / file, fix_orientation=True)
    assert not document.mesh.topology.flipped.any()
    found = {run.type: run.vertices for run in document.source.cells}
    assert all((found[key] == rows).all() for key, rows in cells)


def test_collapsed_elements_are_solved_as_what_is_left_of_them(tmp_path: Path) -> None:
    """Hexahedra of 20 nodes that are wedges, as Ansys has them: a node of a lost edge is that of its corners."""
    points, cells = refined(*made("wedge plate"), SERENDIPITY)
    wedges = cells[0][1]
    corners, between = wedges[:, [0, 1, 2, 2, 3, 4, 5, 5]], wedges[:, 6:]
    below, above = (between[:, [k, k + 1]] for k in (0, 3))
    sides = between[:, [6, 7, 8, 8]]
    lost = [wedges[:, [2]], wedges[:, [5]]]
    middles_of = [below, lost[0], between[:, [2]], above, lost[1], between[:, [5]], sides]
    box = np.column_stack([corners, *middles_of]).astype(np.int32)
    by_vtk(tmp_path / "in.vtk", points, [("hexahedron20", box)])
    document = read(tmp_path / "in.vtk")
    assert {part.key for part in document.parts} == {"wedge"}
    assert document.higher_order == {}
    assert document.ties is not None
    assert document.ties.nodes.sum() == len(middles(cells))
    by_vtk(tmp_path / "in.vtk", refined(tangled("wedge plate", "P=25 D=2h"), made("wedge plate")[1], SERENDIPITY)[0],
           [("hexahedron20", box)])  # fmt: skip
    _, after = repaired(tmp_path / "in.vtk", tmp_path / "out.vtk")
    assert_in_the_middle(after, cells, read(tmp_path / "in.vtk").source.points)
    assert read(tmp_path / "out.vtk").mesh.topology.m == len(wedges)


def test_points_that_are_joined_take_the_nodes_of_all_elements_along(tmp_path: Path) -> None:
    """Two halves that share no node: corners at one place are joined, nodes between them follow each for itself."""
    linear, tets = tangled("block", "P=25 D=2h"), made("block")[1][0][1]
    half = linear[tets].mean(axis=1)[:, 0] < np.median(linear[tets].mean(axis=1)[:, 0])
    parts = []
    for chosen in (half, ~half):
        used, rows = np.unique(tets[chosen], return_inverse=True)
        parts.append(refined(linear[used], [("tetra", rows.reshape(-1, 4).astype(np.int32))], SERENDIPITY))
    (one, cells), (other, more) = parts
    both = [("tetra10", cells[0][1]), ("tetra10", more[0][1] + len(one))]
    by_vtk(tmp_path / "in.vtk", np.concatenate([one, other]), both)
    document, points = repaired(tmp_path / "in.vtk", tmp_path / "out.vtk", join_points=True)
    by_vtk(tmp_path / "whole.vtk", *refined(linear, [("tetra", tets)], SERENDIPITY))
    assert document.mesh.movable.sum() == read(tmp_path / "whole.vtk").mesh.movable.sum()
    assert_in_the_middle(points, both, document.source.points)


@pytest.mark.parametrize("ghosts", [False, True])
@pytest.mark.parametrize("ids", [False, True])
def test_pieces_of_a_mesh_agree_about_nodes_between_corners(ids: bool, ghosts: bool, tmp_path: Path) -> None:
    points, cells = refined(tangled("block", "P=25 D=2h"), made("block")[1], SERENDIPITY)
    rows = cells[0][1].astype(np.int64)
    split(tmp_path / "in.pvtu", points, rows, slabs(points, rows, 3), ids=ids, ghosts=ghosts)
    by_vtk(tmp_path / "whole.vtk", points, cells)
    document, _ = repaired(tmp_path / "in.pvtu", tmp_path / "out.pvtu")
    assert document.higher_order == {"tetra10": len(rows)}
    assert document.mesh.movable.sum() == read(tmp_path / "whole.vtk").mesh.movable.sum()
    found: dict[tuple[float, ...], list[float]] = {}
    for i in range(3):
        before, after = (meshio.read(tmp_path / f"{name}_{i}.vtu") for name in ("in", "out"))
        places = list(map(tuple, before.points.tolist()))
        for place, point in zip(places, after.points.tolist(), strict=True):
            assert found.setdefault(place, point) == point
    assert read(tmp_path / "out.pvtu").mesh.check()[0] == 0
