"""Universal files: their data sets, groups and regions, gmsh's reader and theirs, and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elements import MESHES
from files_medit import material
from files_unv import FILES, data_set, elements, group, nodes
from programs import gmsh_session
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.meshfile.groups import groups_of
from meshfix_cli.meshfile.unv import parse

SQUARE = nodes(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]])) + data_set(
    2412, elements(np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]), np.array([3, 3, 4, 4]), 11)
)


def test_cells_have_their_numbers_properties_and_groups() -> None:
    text = SQUARE + data_set(2467, [*group(1, "left side", 8, [14]), *group(2, "", 7, [5, 77])])
    source = parse(text.encode())
    (run,) = source.cells
    assert run.ids is not None
    assert (run.type, run.ids.tolist(), run.vertices[0].tolist()) == ("triangle", [11, 12, 13, 14], [0, 1, 4])
    assert source.regions == ("unv:property", "unv:material", "unv:group")
    assert source.arrays.cell["unv:property"][0].tolist() == [3, 3, 4, 4]
    assert source.arrays.cell["unv:group"][0].tolist() == [0, 0, 0, 1]
    groups = groups_of(source)
    assert {name: one.counts for name, one in groups.items()} == {"left side": {2: 1}, "group 2": {0: 1}}
    assert groups["group 2"].points.tolist() == [4]


def test_solids_of_several_groups_are_regions(tmp_path: Path) -> None:
    FILES["salome.unv"](tmp_path / "in.unv")
    document = read(tmp_path / "in.unv")
    labels = document.source.arrays.cell["unv:group"]
    at = next(i for i, run in enumerate(document.source.cells) if run.type == "tetra")
    np.testing.assert_array_equal(labels[at], material(*block()) == 2)
    held = document.mesh.topology.interface(labels[at])
    assert held.any()
    assert not document.mesh.movable[held].any()
    assert document.groups().keys() == {"wall", "a core", "group 3"}


@pytest.mark.parametrize("name", ["triangle6", "quad8", "tetra10", "hexahedron20", "wedge15", "every solid"])
def test_nodes_have_the_order_that_gmsh_writes_and_reads(name: str, tmp_path: Path) -> None:
    """Elements of second order have their nodes around their edges."""
    first = {"triangle6": "triangle", "quad8": "quad", "tetra10": "tetra", "hexahedron20": "hexahedron",
             "wedge15": "wedge"}.get(name)  # fmt: skip
    points, blocks = MESHES["quads and triangles" if first in ("quad", "triangle") else "every solid"]()
    points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    blocks = [(key, rows) for key, rows in blocks if key != "pyramid" and first in (None, key)]
    with gmsh_session(SaveAll=1, SecondOrderIncomplete=1) as gmsh:
        d = ELEMENTS[blocks[0][0]].shape.dimension
        gmsh.model.addDiscreteEntity(d, 1)
        gmsh.model.mesh.addNodes(d, 1, np.arange(len(points)) + 1, points.ravel())
        for key, rows in blocks:
            gmsh.model.mesh.addElementsByType(1, ELEMENTS[key].gmsh, [], (rows + 1).ravel())
        if first:
            gmsh.model.mesh.setOrder(2)
        gmsh.write(str(tmp_path / "in.unv"))
    source = parse((tmp_path / "in.unv").read_bytes())
    assert {run.type for run in source.cells} == ({name} if first else {key for key, _ in blocks})
    for run in source.cells:
        places = source.points[run.vertices]
        expected = points[dict(blocks)[first or run.type]]
        np.testing.assert_allclose(places[:, : expected.shape[1]], expected, atol=1e-12)
        if first:
            np.testing.assert_allclose(places[:, expected.shape[1] :], middles(name, expected), atol=1e-12)


def middles(name: str, corners: np.ndarray) -> np.ndarray:
    """The middles (m, k, 3) of edges, in VTK's order."""
    edges = {
        "triangle6": "01 12 20", "quad8": "01 12 23 30", "tetra10": "01 12 20 03 13 23",
        "wedge15": "01 12 20 34 45 53 03 14 25", "hexahedron20": "01 12 23 30 45 56 67 74 04 15 26 37",
    }[name]  # fmt: skip
    pairs = np.array([[int(one) for one in edge] for edge in edges.split()])
    return corners[:, pairs].mean(axis=2)


def test_what_gmsh_reads_of_a_mended_file_is_what_is_in_it(tmp_path: Path) -> None:
    FILES["salome.unv"](tmp_path / "in.unv")
    points, cells = block()
    with gmsh_session() as gmsh:
        gmsh.open(str(tmp_path / "in.unv"))
        tags, places, _ = gmsh.model.mesh.getNodes()
        corners = gmsh.model.mesh.getElementsByType(4)[1].reshape(-1, 4)
    rows = np.searchsorted(np.sort(tags), corners)
    np.testing.assert_array_equal(places.reshape(-1, 3)[np.argsort(tags)], points)
    np.testing.assert_array_equal(rows, cells)


def test_what_is_no_element_holds_its_points(tmp_path: Path) -> None:
    spring = ["        90       136         1         1         7         2", "         5         1"]
    (tmp_path / "in.unv").write_text(SQUARE + data_set(2412, spring) + data_set(151, ["MODEL", "x"]))
    document = read(tmp_path / "in.unv")
    assert not document.mesh.movable.any()
    assert document.source.untold == ("data sets 151",)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("        11        91", "        11       999", "line 16: elements of the type 999 with 3 points"),
        ("         3         4         5", "         3         4         6", "the cell 13 names the point 6"),
        ("         3         4         5", "         3         4", "the elements do not add up"),
        ("         3         4         5", "         3         4         x", "line 21: 'x' is not an integer"),
        ("         2         1         1        11", "         1         1         1        11", "the point 1 is"),
        ("         2         1         1        11", "         2         2         1        11", "several coordinate"),
        ("         2         1         1        11", "         2         1         1", "there are not 7 numbers"),
        ("  5.0000000000000000E-01", "  5.0000000000000000X-01", "line 12: '5.*' is not a number"),
        ("  2412", "  2413\n", "no elements|no cells"),
        ("  2411", "    71", "it has no data set of points"),
        ("  2412", "    71", "has elements in the data set 71, which is not read"),
        ("  2412\n", "  2467\n", "line 16: a group does not begin with eight numbers"),
        ("  2412\n", "  2467\n 1 0 0 0 0 0 0 999999999\nx\n", "999,999,999 members of a group are announced"),
        ("         4         1         5\n    -1", "         4         1         5\n", "2412 does not end"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str, tmp_path: Path) -> None:
    assert before in SQUARE
    (tmp_path / "in.unv").write_text(SQUARE.replace(before, after, 1))
    with pytest.raises(ReadError, match=words):
        read(tmp_path / "in.unv")


def test_points_of_a_curved_system_are_refused() -> None:
    system = ["         1", "PART", "         1         1         8", "CS1", *["0. 0. 0."] * 4]
    with pytest.raises(ReadError, match=r"has its points in a cylindrical system \(1\), which meshfix does not read"):
        parse((data_set(2420, system) + SQUARE).encode())
