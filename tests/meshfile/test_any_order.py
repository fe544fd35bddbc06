"""Straight elements of more than second order are solved as linear ones, in files of gmsh and of VTK."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elements import MESHES, tangles
from programs import gmsh_session

from meshfix_cli import Mesh, read, untangle, write
from meshfix_cli.errors import WriteError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.recognise import Format


def of_order(path: Path, name: str, order: int) -> None:
    """Let gmsh make tangled elements of a higher order."""
    points, blocks = MESHES[name]()
    mesh = Mesh.build(points, blocks)
    flat = tangles(name, mesh.points, mesh.movable, mesh.mean_edge_length())["P=25 D=2h"]
    flat = np.column_stack([flat, np.zeros((len(flat), 3 - flat.shape[1]))])
    dimension = ELEMENTS[blocks[0][0]].shape.dimension
    with gmsh_session(SaveAll=1) as gmsh:
        gmsh.model.addDiscreteEntity(dimension, 1)
        gmsh.model.mesh.addNodes(dimension, 1, np.arange(len(flat)) + 1, flat.ravel())
        for key, rows in blocks:
            gmsh.model.mesh.addElementsByType(1, ELEMENTS[key].gmsh, [], (rows + 1).ravel())
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(path))


SHAPES = [("hexes and wedges", 3), ("wedges and tets", 4), ("quads and triangles", 4), ("every solid", 3)]


@pytest.mark.parametrize(("name", "order"), SHAPES)
def test_they_become_valid_and_stay_straight(name: str, order: int, tmp_path: Path) -> None:
    of_order(tmp_path / "in.msh", name, order)
    document = read(tmp_path / "in.msh")
    assert document.not_judged == {}
    assert sum(document.higher_order.values()) == document.mesh.topology.m
    assert document.mesh.check()[0] > 0
    outcome = untangle(document.mesh)
    assert outcome.valid
    pyramids = name == "every solid"  # which VTK has not
    for target in ("out.msh",) if pyramids else ("out.msh", "out.vtu", "out.vtk", "out_2.msh"):
        write(document, outcome.after, tmp_path / target, Format("gmsh22", False) if target == "out_2.msh" else None)
        again = read(tmp_path / target)
        assert again.mesh.check()[0] == 0
        assert again.higher_order == document.higher_order
    if pyramids:
        with pytest.raises(WriteError, match="that holds no pyramids of 30 nodes"):
            write(document, outcome.after, tmp_path / "out.vtu")


def test_curved_ones_are_told(tmp_path: Path) -> None:
    of_order(tmp_path / "in.msh", "quads and triangles", 3)
    text = (tmp_path / "in.msh").read_text()
    document = read(tmp_path / "in.msh")
    node = int(document.source.cells[0].vertices[0, -1])
    moved = document.source.points.copy()
    moved[node, 0] += 0.01
    assert document.source.layout is not None
    (tmp_path / "in.msh").write_bytes(document.source.layout.rewritten(document.source.points, moved, {}))
    assert (tmp_path / "in.msh").read_text() != text
    curved = read(tmp_path / "in.msh").mesh.quadratic
    assert document.mesh.quadratic is None
    assert curved is not None
    assert curved.bent(read(tmp_path / "in.msh").mesh.points).sum() == 1
