"""Nodes that a file of gmsh pairs with others, as where a mesh is periodic: they are held."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from programs import gmsh_session

from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import gmsh
from meshfix_cli.meshfile.reading import read
from meshfix_cli.meshfile.sliding import slid

FAN = b"""$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
5
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
5 .5 .5 0
$EndNodes
$Elements
4
1 2 2 7 1 1 2 5
2 2 2 7 1 2 3 5
3 2 2 8 1 3 4 5
4 2 2 8 1 4 1 5
$EndElements
"""


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("version", [2.2, 4.1])
def test_periodic_nodes_do_not_slide(version: float, binary: bool, tmp_path: Path) -> None:
    path, across = tmp_path / "periodic.msh", [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
    with gmsh_session(MshFileVersion=version, Binary=binary, MeshSizeMax=0.3) as session:
        session.model.occ.addBox(0, 0, 0, 1, 1, 1)
        session.model.occ.synchronize()
        session.model.mesh.setPeriodic(2, [2], [1], across)  # x = 1 is a copy of x = 0
        session.model.mesh.generate(3)
        session.write(str(path))
        _, copies, originals, _ = session.model.mesh.getPeriodicNodes(2, 2, True)
    document = read(str(path))
    points = document.mesh.points
    held = np.isin(points[:, 0], (0.0, 1.0))
    assert held.sum() == len(copies) + len(originals)
    assert document.source.held is not None
    assert np.array_equal(document.source.held, held)
    sliding = slid(document).mesh
    assert not (sliding.movable & held).any()
    assert (sliding.movable & ~document.mesh.movable).any()


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("1\n1 2 1\n9\n2 1\n", "truncated"),
        ("1\n1 2 1\nAffine 1 0 0\n1\n2 one\n", "not an integer"),
        ("7000000\n1 2 1\n1\n2 1\n", "truncated|not an integer"),
    ],
)
def test_damaged_pairs_of_nodes_are_told(section: str, message: str) -> None:
    with pytest.raises(ReadError, match=message):
        gmsh.parse(FAN + f"$Periodic\n{section}$EndPeriodic\n".encode())


def test_pairs_may_name_nodes_that_were_not_saved() -> None:
    source = gmsh.parse(FAN + b"$Periodic\n1\n1 2 1\n2\n2 1\n77 4\n$EndPeriodic\n")
    assert source is not None
    assert source.held is not None
    assert source.held.tolist() == [True, True, False, True, False]
