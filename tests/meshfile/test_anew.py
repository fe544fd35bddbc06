"""Files that are made of a mesh of another format: what both hold arrives, and an independent reader finds it there."""

from __future__ import annotations

from pathlib import Path

import generate
import meshio
import numpy as np
import pytest

from meshfix_cli import read, write
from meshfix_cli.meshfile.anew.content import words_of


@pytest.fixture
def materials(tmp_path: Path) -> Path:
    """Tetrahedra of two materials and triangles of a wall, with names, in gmsh's 2.2."""
    points, tets = generate.bracket(0.5, 4)
    faces = np.concatenate([np.delete(tets, i, axis=1) for i in range(4)])
    _, first, times = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    facets = faces[first[times == 1]]
    labels = [(points[tets].mean(axis=1)[:, 0] > points[:, 0].mean()).astype(int) + 1, np.full(len(facets), 7)]
    mesh = meshio.Mesh(
        points, [("tetra", tets), ("triangle", facets)],
        cell_data={"gmsh:physical": labels, "gmsh:geometrical": labels},
        field_data={"steel": np.array([1, 3]), "copper": np.array([2, 3]), "hot wall": np.array([7, 2])},
    )  # fmt: skip
    meshio.write(tmp_path / "in.msh", mesh, "gmsh22", binary=False)
    return tmp_path / "in.msh"


def test_words_are_few_and_none_is_there_twice() -> None:
    names = ["inlet", "in let", "in+let", "in_let", "Inlet", "x" * 30, "x" * 31, ""]
    found = words_of(names, r"\w", 12, lower=True)
    assert list(found) == names
    assert len({word.lower() for word in found.values()}) == len(names)
    assert all(0 < len(word) <= 12 for word in found.values()) and found["inlet"] == "inlet"


def test_medit_has_the_numbers_of_materials(materials: Path, tmp_path: Path) -> None:
    document = read(materials)
    _, dropped = write(document, document.mesh, tmp_path / "out.mesh")
    assert sorted(dropped) == ["group copper", "group hot wall", "group steel"]
    found, given = meshio.read(tmp_path / "out.mesh"), meshio.read(materials)
    np.testing.assert_array_equal(found.points, given.points)
    for key in ("tetra", "triangle"):
        np.testing.assert_array_equal(found.cells_dict[key], given.cells_dict[key])
        labels = given.cell_data_dict["gmsh:physical"][key]
        np.testing.assert_array_equal(found.cell_data_dict["medit:ref"][key], labels)
    again = read(tmp_path / "out.mesh")
    assert again.mesh.check()[0] == 0 and "between regions of medit:ref" in again.fixed
