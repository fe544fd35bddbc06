"""What is special about .msh files; that all else of them stays is told by test_splice.py."""

from __future__ import annotations

import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import files_gmsh
import numpy as np
import pytest
from programs import gmsh_session

from meshfix_cli import read
from meshfix_cli.errors import ReadError
from meshfix_cli.meshfile import formats, gmsh
from meshfix_cli.meshfile.gmsh.cells import TYPES
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.meshfile.solved import turned
from meshfix_cli.meshfile.source import Source

SQUARE = "1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 .5 .5 0\n"
FAN = "1 2 2 7 1 1 2 5\n2 2 2 7 1 2 3 5\n3 2 2 8 1 3 4 5\n4 2 2 8 1 4 1 5\n"
FAN_1 = "1 2 7 1 3 1 2 5\n2 2 7 1 3 2 3 5\n3 2 8 1 3 3 4 5\n4 2 8 1 3 4 1 5\n"


def text_2(nodes: str = SQUARE, elements: str = FAN, rest: str = "", version: str = "2.2") -> bytes:
    counts = nodes.count("\n"), elements.count("\n")
    return (
        f"$MeshFormat\n{version} 0 8\n$EndMeshFormat\n$Nodes\n{counts[0]}\n{nodes}$EndNodes\n"
        f"$Elements\n{counts[1]}\n{elements}$EndElements\n{rest}"
    ).encode()


def text_1(elements: str = FAN_1) -> bytes:
    count = elements.count("\n")
    return f"$NOD\n5\n{SQUARE}$ENDNOD\n$ELM\n{count}\n{elements}$ENDELM\n".encode()


def text_4(
    kind: int = 2, elements: str = "1 1 2 5\n2 2 3 5\n3 3 4 5\n4 4 1 5\n", entity: str = "1 0 0 0 1 1 0 0 0"
) -> bytes:
    count = elements.count("\n")
    return (
        f"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 1 0\n{entity}\n$EndEntities\n"
        "$Nodes\n2 5 1 5\n2 1 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 1 1 1\n5\n.5 .5 0 .25 .75\n$EndNodes\n"
        f"$Elements\n1 {count} 1 {count}\n2 1 {kind} {count}\n{elements}$EndElements\n"
    ).encode()


def parsed(data: bytes) -> Source:
    source = gmsh.parse(data)
    assert source is not None
    return source


def of_variant(variant: str, folder: Path) -> Source:
    files_gmsh.FILES[variant](folder / variant)
    return parsed((folder / variant).read_bytes())


def tables(source: Source) -> dict[str, Any]:
    """All that a source holds, but for where it stands in the file."""
    return {
        "points": source.points,
        "cells": [(run.type, run.vertices, run.ids) for run in source.cells],
        "arrays": vars(source.arrays),
        "regions": source.regions,
    }


def test_version_1_holds_the_same_as_version_2() -> None:
    first, second = tables(parsed(text_1())), tables(parsed(text_2()))
    assert (first.pop("regions"), second.pop("regions")) == (("gmsh:physical", "gmsh:geometrical"), ("gmsh:physical",))
    np.testing.assert_equal(first, second)


def test_elements_of_version_1_are_those_of_its_types() -> None:
    mixed = FAN_1.replace("3 2 8 1 3 3 4 5", "3 3 8 2 4 3 4 5 1") + "9 1 4 1 2 1 2\n"
    source = parsed(text_1(mixed))
    assert [(run.type, run.vertices.tolist()) for run in source.cells[1:]] == [
        ("quad", [[2, 3, 4, 0]]), ("line", [[0, 1]]),
    ]  # fmt: skip
    assert [runs.tolist() for runs in source.arrays.cell["gmsh:geometrical"]] == [[1, 1, 1], [2], [1]]
    assert [(run.ids if run.ids is None else run.ids.tolist()) for run in source.cells] == [[1, 2, 4], [3], [9]]


def test_a_file_without_a_version_is_of_the_first() -> None:
    data = text_1().replace(b"NOD", b"Nodes").replace(b"ELM", b"Elements").replace(b"END", b"End")
    np.testing.assert_equal(tables(parsed(data)), tables(parsed(text_1())))
    assert formats.sniff(data) == formats.sniff(text_1()) == Format("gmsh1", False)


def test_names_of_groups_stand_before_version_1_too(tmp_path: Path) -> None:
    data = b'$PARA\n3 4\n$ENDPARA\n$PhysicalNames\n1\n2 7 "steel"\n$EndPhysicalNames\n' + text_1()
    assert {name: pair.tolist() for name, pair in parsed(data).arrays.groups.items()} == {"steel": [7, 2]}
    assert formats.sniff(data) == formats.sniff(data[data.index(b"$Phys") :]) == Format("gmsh1", False)


def test_line_breaks_behind_binary_numbers_may_be_missing(tmp_path: Path) -> None:
    source = of_variant("without_line_breaks_2.msh", tmp_path)
    files_gmsh.packed_2(tmp_path / "with", together=40)
    np.testing.assert_equal(tables(source), tables(parsed((tmp_path / "with").read_bytes())))


@pytest.mark.parametrize("model", ["groups", "partitioned", "views"])
@pytest.mark.parametrize("version", [2, 4])
def test_text_and_binary_files_hold_the_same(model: str, version: int, tmp_path: Path) -> None:
    text, binary = (of_variant(f"{model}_{kind}_{version}.msh", tmp_path) for kind in ("text", "binary"))
    np.testing.assert_equal(tables(binary), tables(text))


@pytest.mark.parametrize(("maker", "count"), [(files_gmsh.packed_2, 2), (files_gmsh.packed_4, 1)])
def test_both_byte_orders_hold_the_same(maker: Callable[..., None], count: int, tmp_path: Path) -> None:
    maker(tmp_path / "little", order="<")
    maker(tmp_path / "big", order=">")
    little, big = (parsed((tmp_path / name).read_bytes()) for name in ("little", "big"))
    np.testing.assert_equal(tables(big), tables(little))
    assert len(big.cells) == count
    assert big.points.dtype == np.float64
    assert big.points.dtype.isnative


@pytest.mark.parametrize(
    "variant",
    ["all_text_1.msh", "groups_text_2.msh", "groups_binary_4.msh", "sparse_text_2.msh", "sparse_binary_4.msh"],
)
def test_points_and_elements_are_those_that_gmsh_reads(variant: str, tmp_path: Path) -> None:
    source = of_variant(variant, tmp_path)
    points, others = files_gmsh.read_independently(tmp_path / variant)
    place = {tag: tuple(point) for tag, point in zip(others["tags"].tolist(), points.tolist(), strict=True)}
    found = {}
    for types, numbers, nodes in others["elements"].values():
        for kind, ids, corners in zip(types, numbers, nodes, strict=True):
            for element, row in zip(ids.tolist(), corners.reshape(len(ids), -1).tolist(), strict=True):
                found[element] = (TYPES[kind][0], [place[tag] for tag in row])
    mine = {}
    for run in source.cells:
        assert run.ids is not None
        for element, row in zip(run.ids.tolist(), run.vertices, strict=True):
            mine[element] = (run.type, [tuple(point) for point in source.points[row].tolist()])
    assert {element: mine[element] for element in found} == found


def test_an_entity_in_several_groups_is_told_from_others_by_their_set(tmp_path: Path) -> None:
    source = of_variant("groups_text_4.msh", tmp_path)
    assert source.regions == ("gmsh:physical_set",)
    arrays = source.arrays
    by_type = {run.type: i for i, run in enumerate(source.cells)}
    assert [set(runs.tolist()) for runs in arrays.cell["gmsh:physical"]] == [{5}, {10}, {11}]
    assert [set(runs.tolist()) for runs in arrays.cell["gmsh:geometrical"]] == [{1}, {1}, {2}]
    sets = [set(runs.tolist()) for runs in arrays.cell["gmsh:physical_set"]]
    assert len(set.union(*sets)) == 3
    assert by_type == {"triangle": 0, "tetra": 2}
    names = {name: tuple(pair) for name, pair in arrays.groups.items()}
    assert names == {"wall": (5, 2), "steel": (10, 3), "copper": (11, 3), "all of it": (12, 3)}


def test_both_versions_hold_the_interface_of_materials(tmp_path: Path) -> None:
    held = []
    for variant in ("groups_text_2.msh", "groups_binary_4.msh"):
        of_variant(variant, tmp_path)
        document = read(tmp_path / variant)
        fixed = ~document.mesh.movable & ~document.mesh.topology.boundary
        held.append(document.mesh.points[fixed])
    assert len(held[0]) > 5
    np.testing.assert_array_equal(held[0][:, 0], 1.0)  # where the two boxes meet
    first, second = (points[np.lexsort(points.T)] for points in held)
    np.testing.assert_array_equal(first, second)


def test_elements_of_version_2_stand_once_for_each_of_their_groups(tmp_path: Path) -> None:
    source = of_variant("groups_binary_2.msh", tmp_path)
    run = next(i for i, cells in enumerate(source.cells) if cells.type == "tetra")
    rows = source.cells[run].vertices
    assert len(np.unique(np.sort(rows, axis=1), axis=0)) == len(rows) // 2
    assert set(source.arrays.cell["gmsh:physical"][run].tolist()) == {10, 11, 12}
    assert "gmsh:physical_set" not in source.arrays.cell


def test_elements_without_a_group(tmp_path: Path) -> None:
    """Mesh.SaveAll writes them; meshio does not read such files."""
    source = of_variant("all_text_4.msh", tmp_path)
    triangles = [i for i, run in enumerate(source.cells) if run.type == "triangle"]
    assert [set(source.arrays.cell["gmsh:physical"][i].tolist()) for i in triangles] == [{3}, {0}]
    assert source.regions == ("gmsh:physical",)


@pytest.mark.parametrize(("group", "regions"), [("1 3", ("gmsh:physical",)), ("1 -3", ("gmsh:physical",)), ("0", ())])
def test_groups_of_version_4_are_those_of_the_entity(group: str, regions: tuple[str, ...]) -> None:
    source = parsed(text_4(entity=f"1 0 0 0 1 1 0 {group} 0"))
    assert source.regions == regions
    labels = source.arrays.cell.get("gmsh:physical", [np.zeros(4)])
    assert labels[0].tolist() == [3 if regions else 0] * 4  # a sign is an orientation


def test_groups_of_lines_alone_are_no_regions() -> None:
    source = parsed(text_2(elements=FAN.replace(" 7 1", " 0 1").replace(" 8 1", " 0 1") + "5 1 2 9 1 1 2\n"))
    assert source.regions == ()
    assert [runs.tolist() for runs in source.arrays.cell["gmsh:physical"]] == [[0] * 4, [9]]


def test_entities_of_partitions_have_groups_too(tmp_path: Path) -> None:
    """What is held is the interface of the materials, not that of the partitions."""
    fixed = []
    for variant in ("groups_binary_4.msh", "partitioned_binary_4.msh", "partitioned_text_2.msh"):
        of_variant(variant, tmp_path)
        fixed.append(sum(read(tmp_path / variant).fixed.values()))
    assert fixed[0] == fixed[1] == fixed[2]


def test_names_of_groups_hold_any_text() -> None:
    names = '$PhysicalNames\r\n2\r\n2 7 "Blech \u00bd \\"A\\""\r\n 1  12 ""\r\n$EndPhysicalNames\r\n'
    groups = parsed(text_2(rest=names)).arrays.groups
    assert {name: pair.tolist() for name, pair in groups.items()} == {'Blech \u00bd \\"A\\"': [7, 2], "": [12, 1]}


def test_views_are_arrays(tmp_path: Path) -> None:
    source = of_variant("views_binary_4.msh", tmp_path)
    _, others = files_gmsh.read_independently(tmp_path / "views_binary_4.msh")
    arrays = source.arrays
    assert set(arrays.point) == {"about NodeData", "about NodeData step 1"}
    values = arrays.point["about NodeData"]
    assert len(values) == len(source.points)
    assert 0 < np.isnan(values).sum() < len(values)
    tags, numbers = others["values"][0][0][1:3]
    np.testing.assert_array_equal(np.sort(values[~np.isnan(values)]), np.sort(np.concatenate(numbers)))
    assert len(tags) == (~np.isnan(values)).sum()
    ids = np.concatenate([run.ids for run in source.cells if run.ids is not None])
    values = np.concatenate(arrays.cell["about ElementData"])
    told = ~np.isnan(values[:, 0])
    assert told.sum() == 50
    np.testing.assert_array_equal(values[told], np.column_stack([ids[told] / 4, np.zeros(50), -np.ones(50)]))
    assert source.untold == ("section $Entities", "section $InterpolationScheme", "section $ElementNodeData")


def test_values_belong_to_the_nodes_and_elements_of_their_numbers() -> None:
    view = '1\n"heat"\n1\n0.5\n3\n0\n1\n2\n'
    rest = f"$NodeData\n{view}4 40\n2 20\n$EndNodeData\n$ElementData\n{view}3 30\n99 1\n$EndElementData\n"
    arrays = parsed(text_2(rest=rest)).arrays
    np.testing.assert_array_equal(arrays.point["heat"], [np.nan, 20, np.nan, 40, np.nan])
    np.testing.assert_array_equal(arrays.cell["heat"], [[np.nan, np.nan, 30, np.nan]])


@pytest.mark.parametrize(
    "broken",
    [
        "",
        "x\n",
        "1\n",
        '1\n"a"\n0\n0\n',
        '1\n"a"\n0\n3\n0\n1\n9999\n1 1\n',
        '1\n"a"\n0\n3\n0\n-1\n1\n1 1\n',
        '1\n"a"\n0\n3\n0\n1\n1\n1 x\n',
    ],
)
def test_views_that_cannot_be_read_are_left_out(broken: str) -> None:
    good = '$NodeData\n1\n"good"\n0\n3\n0\n1\n1\n2 0.5\n$EndNodeData\n'
    source = parsed(text_2(rest=f"$NodeData\n{broken}$EndNodeData\n{good}"))
    assert set(source.arrays.point) == {"good"}


def test_numbers_of_nodes_may_have_any_gaps() -> None:
    """No table of all numbers is made."""
    names = {"1": "9000000000000000000", "2": "17", "3": "40000000000", "4": "3", "5": "1"}
    nodes = "".join(f"{names[line[0]]}{line[1:]}\n" for line in SQUARE.splitlines())
    elements = "".join(
        " ".join([*line.split()[:5], *(names[word] for word in line.split()[5:])]) + "\n" for line in FAN.splitlines()
    )
    tracemalloc.start()
    source = parsed(text_2(nodes, elements))
    assert tracemalloc.get_traced_memory()[1] < 2**18
    tracemalloc.stop()
    np.testing.assert_equal(tables(source), tables(parsed(text_2())))


def test_labels_may_be_none_or_many() -> None:
    elements = "1 2 0 1 2 5\n2 2 1 7 2 3 5\n3 2 6 8 4 3 1 2 -3 3 4 5\n4 2 2 9 5 4 1 5\n"
    source = parsed(text_2(elements=elements))
    np.testing.assert_array_equal(source.cells[0].vertices, [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    assert source.arrays.cell["gmsh:physical"][0].tolist() == [0, 7, 8, 9]
    assert source.arrays.cell["gmsh:geometrical"][0].tolist() == [0, 0, 4, 5]
    assert source.untold == ("partitions",)


def test_types_may_alternate() -> None:
    lines = "".join(f"{10 * i} 1 2 {i} 1 1 {i}\n{10 * i + 1} 2 2 {i} 1 1 {i} 5\n" for i in (2, 3, 4))
    source = parsed(text_2(elements=lines))
    line, triangle = source.cells
    assert (line.type, triangle.type) == ("line", "triangle")
    assert line.ids is not None
    assert triangle.ids is not None
    assert (line.ids.tolist(), triangle.ids.tolist()) == ([20, 30, 40], [21, 31, 41])
    np.testing.assert_array_equal(triangle.vertices, [[0, 1, 4], [0, 2, 4], [0, 3, 4]])
    np.testing.assert_array_equal(line.vertices, [[0, 1], [0, 2], [0, 3]])


def test_sections_come_in_any_order() -> None:
    data = text_2()
    head, nodes, elements = data.partition(b"$Nodes")[0], data.index(b"$Nodes"), data.index(b"$Elements")
    turned = head + data[elements:] + data[nodes:elements]
    np.testing.assert_equal(tables(parsed(turned)), tables(parsed(data)))


def test_nodes_and_elements_may_come_in_several_sections() -> None:
    extra = "$Nodes\n1\n9 2 0 0\n$EndNodes\n$Elements\n1\n5 2 2 8 1 2 9 3\n$EndElements\n"
    source = parsed(text_2(rest=extra))
    assert source.points[5].tolist() == [2, 0, 0]
    assert [run.vertices.tolist() for run in source.cells][1] == [[1, 5, 2]]


def test_names_of_sections_in_comments_and_numbers_are_no_sections() -> None:
    bad = struct.unpack("<3d", b"\n$EndNodes\n$Elements\n\0\0\0")
    nodes = b"".join(struct.pack("<i3d", i + 1, *point) for i, point in enumerate([(0, 0, 0), (1, 0, 0), bad]))
    elements = struct.pack("<8i", 2, 1, 2, 1, 7, 1, 1, 2) + struct.pack("<i", 3)
    data = (
        b"$Comments\n$MeshFormat\n1 0 8\n$Elements\n$EndComments\n$MeshFormat\n2.2 1 8\n\1\0\0\0\n$EndMeshFormat\n"
        b"$Nodes\n3\n" + nodes + b"\n$EndNodes\n$Elements\n1\n" + elements + b"\n$EndElements\n"
    )
    source = parsed(data)
    np.testing.assert_array_equal(source.points[2], bad)
    assert source.cells[0].vertices.tolist() == [[0, 1, 2]]
    assert source.untold == ("comments",)


def test_sizes_of_four_bytes() -> None:
    nodes = struct.pack("<4I3iI3I9d", 1, 3, 1, 3, 2, 1, 0, 3, 1, 2, 3, 0, 0, 0, 1, 0, 0, 0, 1, 0)
    elements = struct.pack("<4I3iI4I", 1, 1, 1, 1, 2, 1, 2, 1, 1, 1, 2, 3)
    data = (
        b"$MeshFormat\n4.1 1 4\n\1\0\0\0\n$EndMeshFormat\n$Nodes\n" + nodes + b"\n$EndNodes\n"
        b"$Elements\n" + elements + b"\n$EndElements\n"
    )
    source = parsed(data)
    assert source.points.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert source.cells[0].vertices.tolist() == [[0, 1, 2]]


def test_parameters_of_nodes_are_not_their_coordinates() -> None:
    source = parsed(text_4())
    assert source.points[4].tolist() == [0.5, 0.5, 0]
    moved = source.points.copy()
    moved[4, 0] = 0.75
    assert source.layout is not None
    assert source.layout.rewritten(source.points, moved, {}) == text_4().replace(b".5 .5 0 .25", b"0.75 .5 0 .25")


@pytest.mark.parametrize(
    "variant", ["groups_text_2.msh", "big_endian_2.msh", "windows_2.msh", "windows_4.msh", "groups_binary_4.msh"]
)
def test_corners_are_exchanged_in_the_file(variant: str, tmp_path: Path) -> None:
    source = of_variant(variant, tmp_path)
    assert source.layout is not None
    chosen = {i: np.array([0, 3]) for i, run in enumerate(source.cells) if run.type in ("triangle", "tetra")}
    data = source.layout.rewritten(source.points, source.points, turned(source.cells, chosen))
    expected = [run.vertices.copy() for run in source.cells]
    for run, rows in chosen.items():
        expected[run][rows, :2] = expected[run][rows, 1::-1]
    assert [run.vertices.tolist() for run in parsed(data).cells] == [rows.tolist() for rows in expected]
    assert len(data) == len((tmp_path / variant).read_bytes())


def test_types_are_those_of_gmsh_and_meshio() -> None:
    from meshio._common import num_nodes_per_cell
    from meshio.gmsh.common import _gmsh_to_meshio_type

    assert {kind: TYPES[kind] for kind in _gmsh_to_meshio_type} == {
        kind: (name, num_nodes_per_cell[name]) for kind, name in _gmsh_to_meshio_type.items()
    }
    assert len({name for name, _ in TYPES.values()}) == len(TYPES)
    with gmsh_session() as module:
        for kind in {*range(1, 34), 92, 93}:
            family, _, _, size, *_ = module.model.mesh.getElementProperties(kind)
            assert TYPES[kind][1] == size
            assert TYPES[kind][0].startswith(family.split()[0].lower()[:3].replace("poi", "ver").replace("pri", "wed"))


CUBE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
SIDES = [[0, 1], [1, 2], [2, 3], [3, 0]]
EDGES = {  # between which corners VTK has the other nodes
    "tetra10": [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]],
    "hexahedron20": [*SIDES, [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]],
    "wedge15": [[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]],
    "pyramid13": [*SIDES, [0, 4], [1, 4], [2, 4], [3, 4]],
}
FACES = [[0, 4, 7, 3], [1, 5, 6, 2], [0, 1, 5, 4], [3, 2, 6, 7], [0, 1, 2, 3], [4, 5, 6, 7]]
EDGES["hexahedron27"] = [*EDGES["hexahedron20"], *FACES, [*range(8)]]


@pytest.mark.parametrize(
    ("name", "kind", "corners"),
    [
        ("tetra10", 4, [0, 1, 3, 4]),
        ("hexahedron20", 5, range(8)),
        ("hexahedron27", 5, range(8)),
        ("wedge15", 6, [0, 1, 3, 4, 5, 7]),
        ("pyramid13", 7, [0, 1, 2, 3, 4]),
    ],
)
def test_nodes_of_curved_cells_come_in_the_order_of_vtk(
    name: str, kind: int, corners: list[int], tmp_path: Path
) -> None:
    """gmsh makes them of straight cells: each lies in the middle of some corners."""
    with gmsh_session(SecondOrderIncomplete=name != "hexahedron27", MshFileVersion=4.1) as module:
        module.model.addDiscreteEntity(3, 1)
        module.model.mesh.addNodes(3, 1, np.arange(1, len(corners) + 1), np.array(CUBE)[corners].ravel())
        module.model.mesh.addElementsByType(1, kind, [1], np.arange(1, len(corners) + 1))
        module.model.mesh.setOrder(2)
        module.write(str(tmp_path / "curved.msh"))
    source = parsed((tmp_path / "curved.msh").read_bytes())
    (run,) = source.cells
    assert run.type == name
    points = source.points[run.vertices[0]]
    np.testing.assert_array_equal(points[len(corners) :], [points[between].mean(axis=0) for between in EDGES[name]])


@pytest.mark.parametrize("data", [text_2(elements=FAN + "5 34 2 1 1 4 1 2 3 4\n"), text_4(kind=35), text_4(kind=999)])
def test_types_that_are_not_known(data: bytes) -> None:
    with pytest.raises(ReadError, match="elements of the type"):
        gmsh.parse(data)


@pytest.mark.parametrize("line", FAN.splitlines())
def test_an_element_with_too_few_numbers(line: str) -> None:
    with pytest.raises(ReadError):
        gmsh.parse(text_2(elements=FAN.replace(line, line[:-2])))


@pytest.mark.parametrize("version", ["1", "3", "4.0", "5.0"])
def test_versions_that_are_not_read(version: str) -> None:
    with pytest.raises(ReadError, match=f"version {version}, which is not read: save it as 2.2 or 4.1"):
        gmsh.parse(text_2(version=version))


@pytest.mark.parametrize("version", ["2", "2.0", "2.1", "2.2"])
def test_versions(version: str) -> None:
    np.testing.assert_equal(tables(parsed(text_2(version=version))), tables(parsed(text_2())))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (text_1()[: text_1().index(b"$ELM")], r"there are no \$Elements in it"),
        (text_1().replace(b"$ELM\n4", b"$ELM\n5"), "announces 5 elements and holds 4"),
        (text_1().replace(b"$ELM\n4", b"$ELM\n3"), "announces 3 elements and holds more"),
        (text_1().replace(b"2 2 7 1 3 2 3 5", b"2 2 7 1 2 3 5"), "the element 2 has not 3 nodes"),
        (text_1().replace(b"2 2 7 1 3 2", b"2 2 7 1 -3 2"), "announces 4 elements and holds 1"),
        (text_1().replace(b"$NOD\n5", b"$NOD\n6"), "line 8: '.ENDNOD' is not an integer"),
        (b"(0 a mesh of another program)\n", "has no .MeshFormat"),
        (text_2().replace(b"2.2 0", b"two 0"), "does not tell a version"),
        (text_2().replace(b"2.2 0", b"2.2 1"), "does not tell the order of the bytes"),
        (text_2()[: text_2().index(b"$Elements")], r"there are no \$Elements in it"),
        (text_2().replace(b"$Nodes", b"$Knots").replace(b"$EndNodes", b"$EndKnots"), r"there are no \$Nodes in it"),
        (text_2().replace(b"Nodes\n5", b"ParametricNodes\n99"), "99 numbers are announced|not a line of numbers"),
        (text_2(elements=""), r"there are no \$Elements in it"),
        (text_2(nodes=SQUARE.replace("5 .5", "4 .5")), "the node 4 stands twice in it"),
        (text_2(elements=FAN.replace("4 1 5", "4 1 6")), r"the element 4 has the node 6, which is not in \$Nodes"),
        (text_2().replace(b"$Nodes\n5", b"$Nodes\n4"), r"\$EndNodes does not stand behind what \$Nodes announces"),
        (text_2().replace(b"$Nodes\n5", b"$Nodes\n6"), "line 11: '.EndNodes' is not an integer"),
        (text_2().replace(b"$Nodes\n5", b"$Nodes\n-5"), "-15|-20 numbers are announced"),
        (text_2().replace(b"$Nodes\n5", b"$Nodes\nfive"), "line 5: there is no number of what follows"),
        (text_2().replace(b"1 1 0\n4", b"1 l 0\n4"), "line 8: 'l' is not a number"),
        (text_2().replace(b"$Elements\n4", b"$Elements\n3"), "announces 3 elements and holds more"),
        (text_2().replace(b"$Elements\n4", b"$Elements\n99"), "announces 99 elements and holds 4"),
        (text_2().replace(b"$Elements\n4", b"$Elements\n99999999999999"), "announces 99,999,999,999,999 elements"),
        (text_2(elements=FAN.replace("1 2 2 7", "1 2 -2 7")), "announces 4 elements and holds 0"),
        (text_2(rest="$NodeData\n1\n"), r"the section \$NodeData does not end"),
        (text_2(rest="$Per"), r"the section \$Per does not end"),
        (text_4().replace(b"2 1 1 1\n5\n", b"2 1 7 1\n5\n"), r"a block of \$Nodes has no header"),
        (text_4().replace(b"\n0 0 1 0\n", b"\n0 0 9 0\n"), "line 6|is not an integer|announced"),
    ],
)
def test_damaged_files(data: bytes, message: str) -> None:
    with pytest.raises(ReadError, match=message):
        gmsh.parse(data)


@pytest.mark.parametrize(
    "variant",
    [
        "groups_text_1.msh",
        "groups_text_2.msh",
        "partitioned_binary_2.msh",
        "one_by_one_2.msh",
        "windows_2.msh",
        "groups_binary_4.msh",
        "partitioned_text_4.msh",
        "parametric_text_4.msh",
        "big_endian_4.msh",
    ],
)
def test_truncated_files(variant: str, tmp_path: Path) -> None:
    of_variant(variant, tmp_path)
    data = (tmp_path / variant).read_bytes()
    last = b"$ENDELM" if variant.endswith("_1.msh") else b"$EndElements"
    end = data.index(last) + len(last) - 1
    for cut in {*np.linspace(0, end, 80).astype(int).tolist(), *range(end - 20, end + 1), *range(0, 120, 7)}:
        with pytest.raises(ReadError):
            gmsh.parse(data[:cut])
