"""FEBio's files: materials, sets, types of elements, dialects, and faults."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from elements import MESHES
from files_febio import FILES, elements, file, nodes
from files_medit import material, surface
from second_order import element
from shapes import block

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.febio import parse
from meshfix_cli.meshfile.groups import groups_of

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]])
CELLS = [[1, 2, 5], [2, 3, 5], [3, 4, 5], [4, 1, 5]]
SQUARE = file(nodes(POINTS), elements('type="tri3" name="sheet"', CELLS))
NAMES = {
    "tetra": "tet4",
    "pyramid": "pyra5",
    "wedge": "penta6",
    "hexahedron": "hex8",
    "triangle": "tri3",
    "quad": "quad4",
}


@pytest.mark.parametrize("variant", FILES)
def test_materials_are_regions_and_the_rest_are_sets(variant: str, tmp_path: Path) -> None:
    FILES[variant](tmp_path / variant)
    document = read(tmp_path / variant)
    points, cells = block()
    parts = np.sort(material(points, cells))
    np.testing.assert_array_equal(np.concatenate(document.source.arrays.cell["febio:material"])[: len(cells)], parts)
    held = document.mesh.topology.interface(parts)
    assert held.any()
    assert not document.mesh.movable[held].any()
    groups = groups_of(document.source)
    if variant == "older.feb":
        assert {name: len(group.points) for name, group in groups.items() if name == "tips"} == {"tips": 2}
        assert groups["part 2"].counts == {3: int((parts == 2).sum())}
        return
    assert groups["above"].counts == {3: int((parts == 2).sum())}
    assert groups["skin"].counts == {2: len(surface(cells))}
    assert groups["tips"].points.tolist() == [0, 1, 2]
    assert groups["some"].counts == {3: 2}


def test_parts_of_one_material_are_one_region() -> None:
    domains = '<SolidDomain name="a" mat="steel"/><ShellDomain mat="steel" name="b"/>'
    two = [elements(f'type="tri3" name="{name}"', CELLS[i : i + 2], i + 1) for i, name in ((0, "a"), (2, "b"))]
    source = parse(file(nodes(POINTS), *two, behind=domains).encode())
    assert [one.tolist() for one in source.arrays.cell["febio:material"]] == [[1, 1], [1, 1]]
    apart = parse(file(nodes(POINTS), *two).encode())
    assert [one.tolist() for one in apart.arrays.cell["febio:material"]] == [[1, 1], [2, 2]]


@pytest.mark.parametrize("old", [False, True])
@pytest.mark.parametrize("name", ["every solid", "quads and triangles"])
def test_all_linear_types(name: str, old: bool, tmp_path: Path) -> None:
    points, blocks = MESHES[name]()
    points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    sections, at = [nodes(points)], 1
    for key, rows in blocks:
        about, tag = ('mat="1"', NAMES[key]) if old else (f'type="{NAMES[key]}" mat="1"', "elem")
        sections.append(elements(about, (rows + 1).tolist(), at, tag))
        at += len(rows)
    text = file(*sections, version="1.2" if old else "3.0", mesh="Geometry" if old else "Mesh")
    (tmp_path / "in.feb").write_text(text)
    document = read(tmp_path / "in.feb")
    assert document.not_judged == {}
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.check()[0] == 0


def test_types_of_older_files_stand_among_one_another() -> None:
    section = '<Elements><tri3 id="7">1,2,5</tri3><quad4 id="8">1,2,3,4</quad4><tri3 id="9">3,4,5</tri3></Elements>'
    runs = parse(file(nodes(POINTS), section, mesh="Geometry").encode()).cells
    assert sorted((run.type, run.ids.tolist()) for run in runs if run.ids is not None) == [
        ("quad", [8]), ("triangle", [7]), ("triangle", [9]),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("tet10", "tetra10"), ("hex20", "hexahedron20"), ("penta15", "wedge15"), ("pyra13", "pyramid13"),
        ("tri6", "triangle6"), ("quad8", "quad8"), ("quad9", "quad9"), ("tri7", "triangle7"), ("hex27", "hexahedron27"),
    ],
)  # fmt: skip
def test_second_order(kind: str, expected: str) -> None:
    """Nodes are in the order of VTK, but for those in the faces of a hexahedron, which go around first."""
    points = element(expected)
    if kind == "hex27":
        points = points[[*range(20), 22, 21, 23, 20, 24, 25, 26]]
    text = file(nodes(points), elements(f'type="{kind}"', [[*range(1, len(points) + 1)]]))
    source = parse(text.encode())
    assert [run.type for run in source.cells] == [expected]
    np.testing.assert_array_equal(source.points[source.cells[0].vertices[0]], element(expected))


@pytest.mark.parametrize(
    ("kind", "count", "expected"),
    [
        ("tet15", 15, "tetra_of_15"),
        ("TET4G1", 4, "tetra"),
        ("q4eas", 4, "quad"),
        ("hex8", 6, "hexahedron_of_6"),
        ("x", 3, "unknown_of_3"),
    ],
)
def test_other_types(kind: str, count: int, expected: str) -> None:
    points = np.arange(3.0 * count).reshape(count, 3)
    text = file(nodes(points), elements(f'type="{kind}"', [[*range(1, count + 1)]]))
    assert [run.type for run in parse(text.encode()).cells] == [expected]


def test_comments_and_further_attributes(tmp_path: Path) -> None:
    text = SQUARE.replace('<elem id="3">', '<!-- <elem id="9">1,2,3</elem> --><elem id="3">')
    text = text.replace("<elem id", "<elem part='a' id").replace('id="2"', 'id=" 2 "')
    assert parse(text.encode()).cells[0].ids is not None
    assert parse(text.encode()).cells[0].vertices.tolist() == [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("Nodes", "Knots", "has no nodes"),
        ("</Nodes>", "", "is truncated: a section Nodes does not end"),
        ('<elem id="4">4,1,5', '<elem id="4">4,1,6', "the cell 4 names the point 6"),
        ('<elem id="4">4,1,5', '<elem id="4">', "has no nodes"),
        ('<elem id="4">4,1,5', "<elem>4,1,5", "has the same attributes"),
        ('<elem id="4">4,1,5', '<elem id="x">4,1,5', "'x' is not a number"),
        ('<elem id="4">4,1,5', '<elem id="4.5">4,1,5', "is not an integer"),
        ('<elem id="4">4,1,5', '<elem id="4">4,a,5', "'a' is not an integer"),
        ('<elem id="4">4,1,5', '<elem id="4" 4,1,5', "is not well-formed"),
        ('<elem id="1">', 'x<elem id="1">', "has a text of its own"),
        ('<node id="5">0.5,0.5,0.0', '<node id="5">0.5,0.5', "has not three coordinates"),
        ('<node id="5">0.5,0.5,0.0', '<node id="5">0.5,0.x,0.0', "'0.x' is not a number"),
        ("<Mesh>", '<Mesh from="other.feb">', "includes other files"),
    ],
)
def test_what_is_wrong_is_named(before: str, after: str, words: str) -> None:
    assert before in SQUARE
    with pytest.raises(ReadError, match=words):
        parse(SQUARE.replace(before, after, 2 if before == "Nodes" else 1).encode())
