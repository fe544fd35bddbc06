"""Files of Comsol: the order of points, entities and selections, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elements import MESHES
from files_comsol import FILES, file, mesh, selection
from files_medit import material
from second_order import element, reference
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.comsol import parse
from meshfix_cli.meshfile.groups import groups_of

POINTS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
CELLS = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
ENTITIES = np.array([1, 1, 2, 2])
SQUARE = file(mesh(POINTS, [("tri", CELLS, ENTITIES), ("edg", CELLS[:, :2], np.array([0, 0, 5, 7]))]))


def test_domains_boundaries_and_selections(tmp_path: Path) -> None:
    source = parse(SQUARE.encode())
    assert [run.type for run in source.cells] == ["triangle", "line"]
    assert source.regions == ("comsol:entity",)
    assert [labels.tolist() for labels in source.arrays.cell["comsol:entity"]] == [[1, 1, 2, 2], [0, 0, 5, 7]]
    assert {name: one.counts for name, one in groups_of(source).items()} == {
        "boundary 0": {1: 2}, "boundary 5": {1: 1}, "boundary 7": {1: 1}
    }  # fmt: skip
    FILES["solid.mphtxt"](tmp_path / "in.mphtxt")
    document = read(tmp_path / "in.mphtxt")
    labels = document.source.arrays.cell["comsol:entity"][1]
    np.testing.assert_array_equal(labels, material(*block()))
    held = document.mesh.topology.interface(labels)
    assert held.any()
    assert not document.mesh.movable[held].any()
    groups = document.groups()
    assert list(groups) == ["boundary 0", "boundary 1", "boundary 2", "a # core", "wall"]
    assert groups_of(document.source)["a # core"].counts == {3: int((labels == 2).sum())}


@pytest.mark.parametrize("dimension", [2, 3])
def test_points_run_along_the_axes_of_an_element(dimension: int, tmp_path: Path) -> None:
    points, blocks = MESHES["quads and triangles" if dimension == 2 else "every solid"]()
    names = {"triangle": "tri", "quad": "quad", "tetra": "tet", "pyramid": "pyr", "wedge": "prism", "hexahedron": "hex"}
    along = {"quad": [0, 1, 3, 2], "pyramid": [0, 1, 3, 2, 4], "hexahedron": [0, 1, 3, 2, 4, 5, 7, 6]}
    text = mesh(
        points.round(6), [(names[key], some[:, along.get(key, ...)].astype(np.int64), None) for key, some in blocks]
    )
    (tmp_path / "in.mphtxt").write_text(file(text))
    document = read(tmp_path / "in.mphtxt")
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.check()[0] == 0
    assert not document.source.regions
    for run, (key, some) in zip(document.source.cells, blocks, strict=True):
        assert run.type == key
        np.testing.assert_array_equal(run.vertices, some)


@pytest.mark.parametrize("key", ["line3", "triangle6", "quad9", "tetra10", "hexahedron27"])
def test_points_of_second_order_run_along_the_axes_behind_the_corners(key: str) -> None:
    nodes, corners = element(key), ELEMENTS[key].shape.corners
    rank = np.lexsort(reference(key).T)  # by z, then y, then x
    order = [*rank[rank < corners], *rank[rank >= corners]]
    name = {"line": "edg", "triangle": "tri", "quad": "quad", "tetra": "tet", "hexahedron": "hex"}[
        key.rstrip("0123456789")
    ]
    source = parse(file(mesh(nodes[np.array(order)], [(f"{name}2", np.arange(len(nodes))[None], None)])).encode())
    assert source.cells[0].type == key
    np.testing.assert_allclose(source.points[source.cells[0].vertices[0]], nodes, atol=1e-6)


def test_second_order_of_which_little_is_known_is_held(tmp_path: Path) -> None:
    more = ("quad2", np.array([[0, 1, 4, 2, 3, 4, 1, 0]]), None)
    (tmp_path / "in.mphtxt").write_text(file(mesh(POINTS, [("tri", CELLS, ENTITIES), more])))
    assert read(tmp_path / "in.mphtxt").not_judged == {"quad_of_8": 1}


def test_other_objects_are_told() -> None:
    source = parse(file(mesh(POINTS, [("tri", CELLS, ENTITIES)]), "0 0 1\n5 Geom2 # class\n1 2 3\n").encode())
    assert source.untold == ("comments", "object Geom2")
    with pytest.raises(ReadError, match="holds no mesh, but object Geom2, which is not read"):
        parse(file("0 0 1\n5 Geom2 # class\n1 2 3\n").encode())


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("5 # number of mesh", "6 # number of mesh", "line 32: 'tri' is not an integer"),
        ("5 # number of mesh", "999999999999 # number", "is truncated: 999,999,999,999 rows are announced"),
        ("4 # number of elements", "3 # number of elements", "line 43: there is no text with its length before it"),
        ("4 # number of elements", "99999999 # number of elements", "is truncated: 299,999,997 numbers are announced"),
        ("4 # number of geom", "3 # number of geom", "4 elements have 3 numbers of entities"),
        ("3 tri", "3 qua", "elements of the type 'qua' with 3 points are not known"),
        ("3 # number of vertices per", "999999999 # number of vertices per", "'tri' with 999999999 points are not"),
        ("3 tri", "tri", "there is no text with its length before it"),
        ("2 # sdim", "1 # sdim", "holds a mesh in 1 dimensions"),
        ("3 0 4 \n", "3 0 5 \n", "the cell 3 names the point 5, and there is none"),
        ("3 0 4 \n", "3 x 4 \n", "line 41: 'x' is not an integer"),
        ("0.500000 0.500000", "0.5 y", "line 26: 'y' is not a number"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    text = SQUARE.replace("3 0 4\n", "3 0 4 \n")
    assert before in text
    with pytest.raises(ReadError, match=words):
        parse(text.replace(before, after, 1).encode())


def test_one_mesh_is_read() -> None:
    one = mesh(POINTS, [("tri", CELLS, ENTITIES)])
    with pytest.raises(ReadError, match="holds several meshes"):
        parse(file(one, one).encode())
    with pytest.raises(ReadError, match="is truncated"):
        parse(file(one, selection("x", 2, [1, 2])).encode()[:-8])
