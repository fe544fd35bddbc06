"""Kratos's files: what the names of elements tell, parts in parts, and the order of nodes."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest
from elements import MESHES
from files_mdpa import FILES, cells, nodes
from files_medit import material, surface
from shapes import block, plate

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile.mdpa import parse

SMALL = b"""// of a mesher
Begin Properties 0
End Properties
Begin Nodes
 10 0 0 0
 20 2 0 0
 30 2 2 0
 40 0 2 0
 50 0.5 1 0
End Nodes
Begin Elements Element2D3N
 7 3 10 20 50
 9 4 50 40 10
End Elements
Begin Elements Element2D4N
 8 3 20 30 40 50
End Elements
Begin Conditions LineCondition2D2N
 7 0 10 20
 8 0 20 30
End Conditions
Begin SubModelPart Body
 Begin SubModelPartElements
  8
  9
 End SubModelPartElements
 Begin SubModelPart Wall // in it
  Begin SubModelPartNodes
   10 20
   30
  End SubModelPartNodes
  Begin SubModelPartConditions
   8
  End SubModelPartConditions
 End SubModelPart
End SubModelPart
"""


def test_elements_keep_their_places_numbers_and_properties() -> None:
    source = parse(SMALL)
    found = [(run.type, run.vertices.tolist(), run.ids.tolist()) for run in source.cells if run.ids is not None]
    assert found == [
        ("triangle", [[0, 1, 4], [4, 3, 0]], [7, 9]), ("quad", [[1, 2, 3, 4]], [8]),
        ("line", [[0, 1], [1, 2]], [7, 8]),
    ]  # fmt: skip
    assert [runs.tolist() for runs in source.arrays.cell["mdpa:properties"]] == [[3, 4], [3], [0, 0]]


def test_parts_are_sets_by_their_paths() -> None:
    arrays = parse(SMALL).arrays
    assert {name: rows.tolist() for name, rows in arrays.point_sets.items()} == {"Body.Wall": [0, 1, 2]}
    sets = {name: [rows.tolist() for rows in runs] for name, runs in arrays.cell_sets.items()}
    assert sets == {"Body": [[1], [0], []], "Body.Wall": [[], [], [1]]}


def test_properties_hold_the_interface_between_them(tmp_path: Path) -> None:
    (tmp_path / "in.mdpa").write_bytes(SMALL)
    document = read(tmp_path / "in.mdpa")
    assert document.fixed["between regions of mdpa:properties"] == 1
    assert sorted(document.ids.tolist()) == [7, 8, 9]


def test_what_stands_between_is_another_programs_mesh(tmp_path: Path) -> None:
    for name, (points, rows) in {"plane.mdpa": plate(), "solid.mdpa": block(), "geometries.mdpa": block()}.items():
        FILES[name](tmp_path / name)
        source = parse((tmp_path / name).read_bytes())
        np.testing.assert_array_equal(source.points, points)
        np.testing.assert_array_equal(source.cells[0].vertices, rows)
        facets = [run.vertices for run in source.cells[1:]]
        np.testing.assert_array_equal(*((np.concatenate(facets), surface(rows)) if facets else ((), ())))
    source = parse((tmp_path / "solid.mdpa").read_bytes())
    assert source.arrays.cell["mdpa:properties"][0].tolist() == material(*block()).tolist()
    assert [rows.tolist() for rows in source.arrays.cell_sets["Mesh 1"]] == [[0, 1], []]


def test_meshio_finds_the_same(tmp_path: Path) -> None:
    points, rows = block()
    meshio.Mesh(points, [("tetra", rows)]).write(tmp_path / "in.mdpa")
    source = parse((tmp_path / "in.mdpa").read_bytes())
    np.testing.assert_array_equal(source.points, points)
    np.testing.assert_array_equal(source.cells[0].vertices, rows)


NAMES = {
    "tetra": "UpdatedLagrangianElement3D4N", "pyramid": "TotalLagrangianElement3D5N", "wedge": "SolidShellElement3D6N",
    "hexahedron": "Element3D8N",
}  # fmt: skip


def test_elements_of_every_type(tmp_path: Path) -> None:
    points, blocks = MESHES["every solid"]()
    text, first = nodes(points.round(5)), 1
    for key, rows in blocks:
        text += cells("Elements", NAMES[key], rows.astype(np.int64), [1] * len(rows), first)
        first += len(rows)
    (tmp_path / "in.mdpa").write_text(text)
    document = read(tmp_path / "in.mdpa")
    found = {(part.key, tuple(row)) for part in document.parts for row in part.vertices.tolist()}
    assert found == {(key, tuple(row)) for key, rows in blocks for row in rows.tolist()}
    assert document.mesh.check()[0] == 0
    assert not document.mesh.topology.flipped.any()


@pytest.mark.parametrize(
    ("kind", "name", "columns", "key"),
    [
        ("Elements", "Element2D3N", 3, "triangle"),
        ("Elements", "VMS2D", 3, "triangle"),
        ("Elements", "VMS3D", 4, "tetra"),
        ("Elements", "ShellThickElementCorotational3D4N", 4, "quad"),
        ("Elements", "ShellThinElement3D3N", 3, "triangle"),
        ("Elements", "MembraneElement3D4N", 4, "quad"),
        ("Elements", "SolidShellElementSprism3D6N", 6, "wedge"),
        ("Elements", "CrLinearBeamElement3D2N", 2, "line"),
        ("Elements", "SphericParticle3D", 1, "vertex"),
        ("Elements", "TrussElement", 2, "line"),
        ("Elements", "Triangle3D6", 6, "triangle6"),
        ("Elements", "UPwSmallStrainInterfaceElement2D4N", 4, "quad_interface"),
        ("Elements", "Element3D10N", 10, "tetra10"),
        ("Elements", "SmallStrainLinearElement3D4N", 4, "tetra"),
        ("Conditions", "WallCondition2D3N", 3, "line3"),
        ("Conditions", "Triangle2D3", 3, "triangle"),
        ("Conditions", "LineLoadCondition2D3N", 3, "line3"),
        ("Conditions", "SurfaceLoadCondition3D4N", 4, "quad"),
        ("Conditions", "WallCondition3D", 3, "triangle"),
        ("Conditions", "PointLoadCondition2D1N", 1, "vertex"),
        ("Conditions", "LineLoadCondition3D2N", 2, "line"),
        ("Conditions", "Inlet", 3, "curve3"),
        ("Geometries", "Quadrilateral3D4", 4, "quad"),
        ("Geometries", "Hexahedra3D8", 8, "hexahedron"),
        ("Geometries", "Line2D3", 3, "line3"),
        ("Geometries", "Prism3D6", 6, "wedge"),
    ],
)
def test_names_tell_what_elements_are(kind: str, name: str, columns: int, key: str) -> None:
    points = np.random.default_rng(1).random((columns, 3))
    text = nodes(points) + cells(kind, name, np.arange(columns)[None], None if kind == "Geometries" else [1])
    source = parse(text.encode())
    assert [(run.type, run.vertices.shape) for run in source.cells] == [(key, (1, columns))]


# Where the nodes on edges stand between which corners, by hand from the drawings of Kratos's geometries.
EDGES = {
    "hexahedron20": (
        "Hexahedra3D20",
        [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 4)],
        [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)],
    ),
    "wedge15": (
        "Prism3D15",
        [(0, 1), (1, 2), (2, 0), (0, 3), (1, 4), (2, 5), (3, 4), (4, 5), (5, 3)],
        [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    ),
}


@pytest.mark.parametrize("key", EDGES)
def test_nodes_on_edges_stand_in_the_order_of_the_table_of_elements(key: str) -> None:
    name, kratos, table = EDGES[key]
    corners = np.random.default_rng(1).random((8 if key.startswith("hexa") else 6, 3))
    points = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in kratos]])
    source = parse((nodes(points) + cells("Geometries", name, np.arange(len(points))[None], None)).encode())
    (run,) = source.cells
    assert run.type == key
    expected = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in table]])
    np.testing.assert_allclose(source.points[run.vertices[0]], expected, atol=1e-6)


def test_the_faces_of_27_nodes_stand_in_the_order_of_vtk() -> None:
    square = [[0, 0], [2, 0], [2, 2], [0, 2]]
    box = np.array([[x, y, z] for z in (0.0, 2.0) for x, y in square])
    edges = [(box[a] + box[b]) / 2 for a, b in EDGES["hexahedron20"][1]]
    faces = [[1, 1, 0], [1, 0, 1], [2, 1, 1], [1, 2, 1], [0, 1, 1], [1, 1, 2], [1, 1, 1]]
    text = nodes(np.vstack([box, edges, faces])) + cells("Geometries", "Hexahedra3D27", np.arange(27)[None], None)
    source = parse(text.encode())
    vtk = pytest.importorskip("vtkmodules.vtkCommonDataModel").vtkTriQuadraticHexahedron()
    places = 2 * np.array(vtk.GetParametricCoords()).reshape(27, 3)
    np.testing.assert_allclose(source.points[source.cells[0].vertices[0]], places)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (b"End Nodes", b"", "is truncated: the block Nodes does not end"),
        (b"End SubModelPart\nEnd SubModelPart\n", b"End SubModelPart\n", "the block SubModelPart does not end"),
        (b"Begin Nodes", b"Begin Knots", "End Nodes stands where no block of that name ends"),
        (b"Element2D4N", b"Element9D9N", "has elements called Element9D9N, which are not known"),
        (b"Element2D4N", b"Thing", "has elements called Thing, which are not known"),
        (b"Element2D4N", b"Element2D7N", "has elements called Element2D7N, which are not known"),
        (b"7 3 10 20 50", b"7 3 10 20", "line 11: there are not 5 numbers in each row of the block Elements"),
        (b"7 3 10 20 50", b"7 3 10 20 60", "the cell 7 names the point 60"),
        (b"7 3 10 20 50", b"7 3 10 20 x", "line 12: 'x' is not an integer"),
        (b"50 0.5 1 0", b"50 0.5 1 y", "line 9: 'y' is not a number"),
        (b"50 0.5 1 0", b"40 0.5 1 0", "the point 40 is defined twice"),
        (b"  8\n  9\n", b"  8\n  nine\n", "line 25: 'nine' is not an integer"),
    ],
)
def test_what_is_wrong_is_named(before: bytes, after: bytes, words: str) -> None:
    assert before in SMALL
    with pytest.raises(ReadError, match=words):
        source = parse(SMALL.replace(before, after, 1))
        assert source.arrays


def test_two_meshes_in_a_file_are_refused() -> None:
    with pytest.raises(ReadError, match="the point 10 is defined twice"):
        parse(SMALL + SMALL)


@pytest.mark.parametrize("name", FILES)
def test_truncated(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    data = (tmp_path / name).read_bytes()
    first = data.index(b"End Nodes")
    last = data.rindex(b"End ")
    for cut in (*range(0, first, max(1, first // 20)), *range(first, last, max(1, (last - first) // 40))):
        try:
            source = parse(data[:cut])
        except ReadError:
            continue
        assert not data[:cut].rstrip().endswith(b"\n") and len(source.points) > 0  # between two blocks
