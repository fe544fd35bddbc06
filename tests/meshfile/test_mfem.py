"""MFEM's meshes: attributes and sets, the orders of its elements, and coordinates that are a grid function."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pytest
from bent import curved
from elements import MESHES
from files_medit import surface
from files_mfem import CORNERS, EVEN, FILES, LOBATTO, NUMBERS, nodes, of_order, text
from numpy.typing import NDArray
from shapes import block, plate

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import ReadError
from meshfix_cli.mesh.elements import ELEMENTS, element_of
from meshfix_cli.mesh.judged import VALID
from meshfix_cli.mesh.lagrange import lattice
from meshfix_cli.meshfile import formats
from meshfix_cli.meshfile.mfem import parse
from meshfix_cli.meshfile.mfem.nodes import own_nodes
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.repair import Method

SMALL = b"""MFEM mesh v1.3

dimension
2

elements
3
7 2 0 1 4
7 3 1 2 3 4
9 2 0 4 3

attribute_sets
2
"left" 1 9
"all of it" 2 7 9

boundary
2
1 1 0 1
4 1 1 2

bdr_attribute_sets
1
"wall" 2 4 5

vertices
5
2
0 0
2 0
2 2
0 2
0.5 1
"""
# The corners of each reference element, by hand from MFEM's list of its geometries.
REFERENCE = {
    "quad": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "hexahedron": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
    "wedge": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]],
    "pyramid": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1]],
    "tetra": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "triangle": [[0, 0], [1, 0], [0, 1]],
}


def test_elements_keep_their_places_attributes_and_sets() -> None:
    source = parse(SMALL)
    assert [(run.type, None if run.ids is None else run.ids.tolist()) for run in source.cells] == [
        ("triangle", [0]), ("quad", [1]), ("triangle", [2]), ("line", None),
    ]  # fmt: skip
    arrays = source.arrays
    assert [runs.tolist() for runs in arrays.cell["mfem:attribute"]] == [[7], [7], [9], [1, 4]]
    sets = {name: [rows.tolist() for rows in runs] for name, runs in arrays.cell_sets.items()}
    assert sets == {
        "left": [[], [], [0], []], "all of it": [[0], [0], [0], []], "boundary 1": [[], [], [], [0]],
        "boundary 4": [[], [], [], [1]], "wall": [[], [], [], [1]],
    }  # fmt: skip
    assert source.regions == ("mfem:attribute",)


def test_attributes_hold_the_interface_between_them(tmp_path: Path) -> None:
    (tmp_path / "in.mesh").write_bytes(SMALL)
    document = read(tmp_path / "in.mesh")
    assert document.format.name == "mfem"
    assert document.fixed["between regions of mfem:attribute"] == 1
    assert document.ids.tolist() == [0, 2, 1] or document.ids.tolist() == [0, 1, 2]


@pytest.mark.parametrize("key", REFERENCE)
def test_the_reference_elements_are_valid(key: str, tmp_path: Path) -> None:
    corners = REFERENCE[key]
    d = len(corners[0])
    rows = "\n".join(" ".join(map(str, row)) for row in corners)
    (tmp_path / "in.mesh").write_text(
        f"MFEM mesh v1.0\ndimension\n{d}\nelements\n1\n1 {NUMBERS[key]} {' '.join(map(str, range(len(corners))))}\n"
        f"boundary\n0\nvertices\n{len(corners)}\n{d}\n{rows}\n"
    )
    document = read(tmp_path / "in.mesh")
    assert [part.key for part in document.parts] == [key]
    assert not document.mesh.topology.flipped.any()
    assert document.mesh.check()[0] == 0


def test_elements_of_every_type(tmp_path: Path) -> None:
    points, cells = MESHES["every solid"]()
    rows = [f"1 {NUMBERS[key]} {' '.join(map(str, row))}" for key, some in cells for row in some.tolist()]
    (tmp_path / "in.mesh").write_text(
        f"MFEM mesh v1.0\ndimension\n3\nelements\n{len(rows)}\n{chr(10).join(rows)}\nboundary\n0\n"
        f"vertices\n{len(points)}\n3\n" + "".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in points.tolist())
    )
    document = read(tmp_path / "in.mesh")
    found = {(part.key, tuple(row)) for part in document.parts for row in part.vertices.tolist()}
    assert found == {(key, tuple(row)) for key, some in cells for row in some.tolist()}
    assert document.mesh.check()[0] == 0


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("collection", ["H1_3D_P1", "Linear", "H1Pos_3D_P1", "H1@G_3D_P1"])
def test_nodes_of_first_order_are_the_coordinates(order: int, collection: str) -> None:
    points, cells = block()
    source = parse(text(points, cells, nodes(points, order, collection)).encode())
    np.testing.assert_array_equal(source.points, points)
    np.testing.assert_array_equal(source.cells[0].vertices, cells)


SPACES = [
    (0, "H1_3D_P2", EVEN[2]), (1, "Quadratic", EVEN[2]), (1, "H1@U_2D_P2", EVEN[2]), (1, "H1_3D_P3", LOBATTO[3]),
    (0, "H1@G_3D_P4", LOBATTO[4]), (0, "H1@U_3D_P3", EVEN[3]), (1, "H1@U_3D_P4", EVEN[4]),
]  # fmt: skip


@pytest.mark.parametrize("name", ["quads and triangles", "hexes and wedges", "wedges and tets"])
@pytest.mark.parametrize(("ordering", "collection", "along"), SPACES)
def test_nodes_of_higher_order_are_those_of_the_elements(
    name: str, ordering: int, collection: str, along: list[float]
) -> None:
    points, blocks = MESHES[name]()
    source = parse(of_order(points, blocks, ordering, collection, along).encode())
    linear = {(key, tuple(row)) for key, rows in blocks for row in rows.tolist()}
    found = set()
    for run in source.cells:
        element = element_of(run.type)
        assert element is not None
        corners = source.points[run.vertices[:, : element.shape.corners]]
        middles = np.array(element.weights) @ corners
        np.testing.assert_allclose(source.points[run.vertices[:, element.shape.corners :]], middles, atol=3e-6)
        if run.ids is not None:
            assert element.straight is not None
            found |= {(element.straight.key, tuple(row)) for row in run.vertices[:, : corners.shape[1]].tolist()}
    assert found == linear
    assert len(np.unique(np.concatenate([run.vertices.ravel() for run in source.cells]))) == len(source.points)


@pytest.mark.parametrize(("kind", "along"), [("T1", LOBATTO[4]), ("T4", EVEN[3])])
def test_elements_have_nodes_of_higher_order_for_themselves(kind: str, along: list[float]) -> None:
    order = len(along) - 1
    for key in ("triangle", "quad", "tetra", "wedge", "hexahedron"):
        straight = ELEMENTS[key]
        corners = np.array(lattice(key, 1), dtype=float)
        rows = own(key, corners, along)
        d = corners.shape[1]
        values = "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
        source = parse(
            f"MFEM mesh v1.0\ndimension\n{d}\nelements\n1\n"
            f"1 {NUMBERS[key]} {' '.join(map(str, range(straight.nodes)))}\nboundary\n0\n"
            f"vertices\n{straight.nodes}\nnodes\nFiniteElementSpace\nFiniteElementCollection: "
            f"L2_{kind}_{d}D_P{order}\nVDim: {d}\nOrdering: 1\n{values}\n".encode()
        )
        element = element_of(source.cells[0].type)
        assert element is not None
        found = source.points[source.cells[0].vertices[0]][:, :d]
        np.testing.assert_allclose(found, np.concatenate([corners, np.array(element.weights) @ corners]), atol=1e-12)


def own(key: str, corners: NDArray[np.float64], along: list[float]) -> NDArray[np.float64]:
    """Return the nodes of an element, on its sides too, by loops: the first coordinate runs first."""
    g, p, d = along, len(along) - 1, corners.shape[1]
    found = []
    for steps in product(range(p + 1), repeat=d):
        place, simplex = steps[::-1], {"triangle": 2, "wedge": 2, "tetra": 3}.get(key, 0)
        if sum(place[:simplex]) > p:
            continue
        shares = [g[p - sum(place[:simplex])], *(g[i] for i in place[:simplex])] if simplex else [1.0]
        found.append([x / sum(shares) for x in shares[1:]] + [g[i] for i in place[simplex:]])
    return np.array(found)


def test_nodes_of_second_order_that_cannot_be_told() -> None:
    corners = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    square = of_order(corners, [("quad", np.arange(4)[None])], 1, "Quadratic", EVEN[2])
    source = parse(square.encode())
    assert source.cells[0].vertices.tolist() == [[*range(9)]]
    with pytest.raises(ReadError, match="has nodes of order 2, which are told apart by the order of its elements"):
        source.layout.rewritten(source.points, source.points, turned(source.cells, {0: np.array([0])}))  # type: ignore[union-attr]
    with pytest.raises(ReadError, match="a facet on its boundary that is none of an element"):
        parse(square.replace("1 1 0 1\n", "1 1 0 2\n").encode())
    pyramid = of_order(np.eye(5, 3), [("tetra", np.arange(4)[None])], 1, "Quadratic", EVEN[2]).replace(
        "1 4 0 1 2 3", "1 7 0 1 2 3 4"
    )
    with pytest.raises(ReadError, match="has pyramids with nodes of order 2"):
        parse(pyramid.encode())


@pytest.mark.parametrize("order", [0, 1])
def test_elements_with_nodes_of_their_own_are_solved_as_one_mesh_where_points_are_joined(
    order: int, tmp_path: Path
) -> None:
    """As in periodic meshes."""
    points, cells = plate()
    own = nodes(points[cells].reshape(-1, 3)[:, :2], order, "L2_T1_2D_P1")
    (tmp_path / "in.mesh").write_text(text(points, cells, own))
    (tmp_path / "plain.mesh").write_text(text(points, cells))
    document, plain = read(tmp_path / "in.mesh", join_points=True), read(tmp_path / "plain.mesh")
    assert document.mesh.check()[0] == plain.mesh.check()[0] > 0
    assert document.mesh.movable.sum() == plain.mesh.movable.sum()
    outcome = untangle(document.mesh)
    assert outcome.valid
    write(document, outcome.after, tmp_path / "out.mesh")
    assert read(tmp_path / "out.mesh").mesh.check()[0] == 0
    assert (tmp_path / "out.mesh").read_text().split("VDim")[0] == (tmp_path / "in.mesh").read_text().split("VDim")[0]
    with pytest.raises(ReadError, match="nodes of its own for each element"):
        document.source.layout.rewritten(  # type: ignore[union-attr]
            document.source.points,
            document.source.points,
            {0: (np.array([0]), (1, 0, 2))},  # type: ignore[dict-item]
        )


@pytest.mark.parametrize("straight", [False, True])
def test_elements_with_nodes_of_higher_order_for_themselves_are_solved_as_one_mesh(
    straight: bool, tmp_path: Path
) -> None:
    """Points that are joined stay together, and those on the boundary where they are."""
    quadratic, points, free = curved("quad16", 0.0 if straight else 0.3)
    if straight:
        tangled = points.copy()
        tangled[free & quadratic.corners] += np.random.default_rng(1).uniform(-0.4, 0.4, (4, 2))
        points = quadratic.straight(tangled)
    rows = quadratic.nodes.reshape(len(quadratic), -1)
    order = np.argsort(own_nodes("quad", 3))
    values = "\n".join(" ".join(map(repr, row)) for row in points[rows[:, order]].reshape(-1, 2).tolist())
    elements = "\n".join(f"1 3 {' '.join(map(str, row[:4]))}" for row in rows.tolist())
    (tmp_path / "in.mesh").write_text(
        f"MFEM mesh v1.0\ndimension\n2\nelements\n{len(rows)}\n{elements}\nboundary\n0\nvertices\n"
        f"{rows[:, :4].max() + 1}\nnodes\nFiniteElementSpace\nFiniteElementCollection: L2_T4_2D_P3\n"
        f"VDim: 2\nOrdering: 1\n{values}\n"
    )
    document = read(tmp_path / "in.mesh", join_points=True)
    assert (document.mesh.quadratic is None) == straight
    assert document.mesh.check()[0] == (quadratic.judge(points, 1).verdicts != VALID).sum() > 0
    outcome = Method().solve(document.mesh, float("inf"), 1)
    write(document, outcome.after, tmp_path / "out.mesh")
    again = read(tmp_path / "out.mesh", join_points=True)
    assert again.mesh.check()[0] == 0
    found = again.source.points.reshape(*rows.shape, -1)[:, own_nodes("quad", 3), :2]
    for node in range(len(points)):
        places = found[rows == node]
        assert (places == places[0]).all()
        assert free[node] or (places[0] == points[node]).all()


def test_nodes_of_quadrilaterals_and_hexahedra_run_by_coordinates() -> None:
    for kind, d, order in (("3", 2, [0, 1, 3, 2]), ("5", 3, [0, 1, 3, 2, 4, 5, 7, 6])):
        corners = [[i & 1, i >> 1 & 1, i >> 2][:d] for i in range(2**d)]
        values = "\n".join(" ".join(map(str, row)) for row in corners)
        source = parse(
            f"MFEM mesh v1.0\ndimension\n{d}\nelements\n1\n1 {kind} {' '.join(map(str, range(2**d)))}\nboundary\n0\n"
            f"vertices\n{2**d}\nnodes\nFiniteElementSpace\nFiniteElementCollection: L2_T1_{d}D_P1\nVDim: {d}\n"
            f"Ordering: 1\n{values}\n".encode()
        )
        assert source.cells[0].vertices.tolist() == [order]


def test_the_boundary_of_elements_with_nodes_of_their_own_is_held() -> None:
    points, cells = plate()
    source = parse(text(points, cells, nodes(points[cells].reshape(-1, 3)[:, :2], 1, "L2_T1_2D_P1")).encode())
    assert source.held is not None
    np.testing.assert_array_equal(source.held.reshape(-1, 3), np.isin(cells, surface(cells)))


ONE = b"""MFEM mesh v1.0
dimension
2
elements
%s
vertices
4
nodes
FiniteElementSpace
FiniteElementCollection: %s
VDim: 2
Ordering: 1
0 0
"""


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"MFEM NURBS mesh v1.0\n", "is a NURBS mesh of MFEM"),
        (b"MFEM NC mesh v1.0\n", r"is a nonconforming mesh \(NC\) of MFEM"),
        (b"MFEM mesh v1.1\n", r"is a nonconforming mesh \(NC\) of MFEM"),
        (b"MFEM INLINE mesh v1.0\n\ntype = quad\nnx = 4\n", r"is a mesh that is to be made \(INLINE\) of MFEM"),
        (SMALL.replace(b"v1.3", b"v1.4"), "is of MFEM's version 1.4"),
        (SMALL + b"\nvertex_parents\n0\n", r"is a nonconforming mesh \(NC\)"),
        (text(*block(), nodes(block()[0], 1, "H1_3D_P3")).encode(), "is truncated"),
        (text(*block(), nodes(block()[0], 1, "H1_3D_P11")).encode(), "has nodes of order 11"),
        (text(*block(), nodes(block()[0], 1, "Cubic")).encode(), "has nodes in the space Cubic"),
        (
            text(*block(), nodes(block()[0], 1, "Quadratic")).encode(),
            "numbers are announced, and the file is truncated",
        ),
        (text(*block(), nodes(block()[0], 1, "H1Pos_3D_P2")).encode(), "has nodes in the space H1Pos_3D_P2"),
        (text(*block(), nodes(block()[0], 1, "L2_T2_3D_P4")).encode(), "has nodes in the space L2_T2_3D_P4"),
        (text(*block(), nodes(block()[0], 1, "L2_3D_P1")).encode(), "has nodes in the space L2_3D_P1"),
        (text(*block(), nodes(block()[0][:-1], 1, "H1_3D_P1")).encode(), "is truncated"),
        (ONE % (b"1\n1 3 0 1 2 3", b"L2_T1_2D_P0"), "has nodes in the space L2_T1_2D_P0"),
        (ONE % (b"1\n1 3 0 1 2 3", b"H1_2D_P0"), "has nodes in the space H1_2D_P0"),
        (ONE % (b"1\n1 3 0 1 2 3", b"H1_2D_P2000"), "has nodes of order 2000"),
        (ONE % (b"1\n1 0 0", b"L2_T1_2D_P2"), "has nodes of its own for each vertex"),
        (ONE % (b"0", b"H1_2D_P2"), "has no elements"),
        (ONE.replace(b"elements", b"boundary") % (b"0", b"H1_2D_P2"), "nodes stand before the elements"),
    ],
)
def test_what_is_not_read_is_named(data: bytes, words: str) -> None:
    with pytest.raises(ReadError, match=words):
        parse(data)
    assert formats.sniff(data) == Format("mfem")


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        (b"elements\n3", b"elements\n9", "line 19: there are more numbers than announced"),
        (b"elements\n3", b"elements\n99999999999999999999", "is not an integer|announced"),
        (b"elements\n3", b"elements\n2", "line 10: there are more numbers than announced"),
        (b"7 3 1 2 3 4", b"7 8 1 2 3 4", "line 9: elements of the type 8 are not known"),
        (b"7 3 1 2 3 4", b"7 3 1 2 3", "line 9: there are not 6 numbers"),
        (b"7 3 1 2 3 4", b"7 3 1 2 3 5", "the cell 1 names the point 5"),
        (b"vertices\n5\n2", b"vertices\n5\n4", "vertices have 4 coordinates"),
        (b"vertices\n5\n2", b"vertices\n6\n2", "truncated"),
        (b"vertices\n5\n2", b"vertices\n4\n2", "the cell 0 names the point 4|more numbers than announced"),
        (b"0.5 1", b"0.5 x", "line 33: 'x' is not a number"),
        (b"attribute_sets\n2", b"attribute_sets\n3", "line 15: there are fewer sets of attributes"),
        (b"boundary\n2", b"borders\n2", "line 17: 'borders' is not known"),
    ],
)
def test_what_is_wrong_is_named(before: bytes, after: bytes, words: str) -> None:
    assert before in SMALL
    with pytest.raises(ReadError, match=words):
        parse(SMALL.replace(before, after, 1))


def test_an_output_of_the_same_extension_has_the_format_of_the_input(tmp_path: Path) -> None:
    FILES["plane.mesh"](tmp_path / "in.mesh")
    document = read(tmp_path / "in.mesh")
    write(document, document.mesh, tmp_path / "out.mesh")
    assert (tmp_path / "out.mesh").read_bytes() == (tmp_path / "in.mesh").read_bytes()
    write(document, document.mesh, tmp_path / "out.vtk")
    assert read(tmp_path / "out.vtk").mesh.check() == document.mesh.check()


@pytest.mark.parametrize("name", FILES)
def test_truncated(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    data = (tmp_path / name).read_bytes()
    end = data.rindex(b"\nmfem_") if b"\nmfem_" in data else len(data)
    for cut in range(0, data.rstrip().rindex(b"\n", 0, end - 2), max(1, end // 60)):
        with pytest.raises(ReadError):
            parse(data[:cut])


def test_corners_of_all_types() -> None:
    """The table of the tests' own reader is that of MFEM's numbers."""
    assert [len(REFERENCE[key]) for key in NUMBERS if key != "line"] == CORNERS[2:]
