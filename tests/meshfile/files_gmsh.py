"""Tangled .msh files, most of them written by gmsh itself, and what gmsh reads in them."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from numpy.typing import NDArray
from programs import gmsh_session

from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.solve.perturb import perturb

TYPES = {2: 2, 3: 4}  # of gmsh's simplices


def boxes(gmsh: Any) -> None:
    """Two materials that share a face; all of it is in a third group, and a face is turned over."""
    occ, model = gmsh.model.occ, gmsh.model
    occ.addBox(0, 0, 0, 1, 1, 1, 1)
    occ.addBox(1, 0, 0, 1, 1, 1, 2)
    occ.fragment([(3, 1)], [(3, 2)])
    occ.synchronize()
    for groups in ((3, [1], 10, "steel"), (3, [2], 11, "copper"), (3, [1, 2], 12, "all of it"), (2, [-1], 5, "wall")):
        model.addPhysicalGroup(*groups)
    _mesh(gmsh, 3, 0.34)


def periodic_box(gmsh: Any) -> None:
    """A box whose left and right faces have the same mesh."""
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.model.mesh.setPeriodic(2, [2], [1], [1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
    _mesh(gmsh, 3, 0.25)


def plates(gmsh: Any) -> None:
    """Two rectangles with a common edge, of which only the first is in a group; nodes on edges have parameters."""
    geo = gmsh.model.geo
    corners = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1))]
    bottom, lower, right, upper, top, left = (geo.addLine(corners[i - 1], corners[i]) for i in (1, 2, 3, 4, 5, 0))
    middle = geo.addLine(corners[1], corners[4])
    for edges in ([bottom, middle, top, left], [lower, right, upper, -middle]):
        geo.addPlaneSurface([geo.addCurveLoop(edges)])
    geo.synchronize()
    gmsh.model.addPhysicalGroup(2, [1], 3, "left")
    gmsh.model.addPhysicalGroup(1, [middle], 4, "weld")
    _mesh(gmsh, 2, 0.15)


def _mesh(gmsh: Any, dimension: int, size: float) -> None:
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(dimension)
    tangle(gmsh, dimension)


def tangle(gmsh: Any, dimension: int) -> None:
    """Move nodes inside of volumes or surfaces by the length of an edge."""
    mesh = gmsh.model.mesh
    tags, points, _ = mesh.getNodes()
    order = np.argsort(tags)
    tags, points = tags[order].astype(np.int64), points.reshape(-1, 3)[order][:, :dimension]
    corners = mesh.getElementsByType(TYPES[dimension])[1].astype(np.int64).reshape(-1, dimension + 1)
    before = Mesh.build(points, np.searchsorted(tags, corners))
    before = before.with_fixed(~np.isin(tags, mesh.getNodes(dimension)[0]))
    after = perturb(before, 15, before.mean_edge_length(), seed=3)[0].points.round(6)
    for row in np.flatnonzero((after != points).any(axis=1)):
        mesh.setNode(tags[row], [*after[row], 0.0][:3], [])


def by_gmsh(model: Callable[[Any], None], path: Path, /, **options: float) -> None:
    """Let gmsh write a model of its own."""
    with gmsh_session(**options) as gmsh:
        model(gmsh)
        gmsh.write(str(path))


def partitioned(path: Path, /, **options: float) -> None:
    """Three partitions with ghost elements: in version 2 the elements have four labels or more."""
    with gmsh_session(PartitionCreateGhostCells=1, **options) as gmsh:
        boxes(gmsh)
        gmsh.model.mesh.partition(3)
        gmsh.write(str(path))


def with_views(path: Path, /, **options: float) -> None:
    """Values of some nodes at two times, of some elements, and of the nodes of elements."""
    with gmsh_session(**options) as gmsh:
        boxes(gmsh)
        gmsh.write(str(path))
        gmsh.option.setNumber("PostProcessing.SaveMesh", 0)
        nodes = gmsh.model.mesh.getNodes()[0][::2]
        elements = gmsh.model.mesh.getElementsByType(4)[0][:50]
        for kind, tags, rows in (
            ("NodeData", nodes, [[0.5 * tag] for tag in nodes]),
            ("ElementData", elements, [[tag / 4, 0.0, -1.0] for tag in elements]),
            ("ElementNodeData", elements, [[1.0, 2.0, 3.0, 0.1 * tag] for tag in elements]),
        ):
            view = gmsh.view.add(f"about {kind}")
            for step in range(1 + (kind == "NodeData")):
                gmsh.view.addModelData(view, step, gmsh.model.getCurrent(), kind, tags, rows, time=0.25 * step)
            gmsh.view.write(view, str(path), append=True)


def sparse(path: Path, /, **options: float) -> None:
    """Numbers with large gaps, of nodes that are not in their order."""
    points, cells = shapes.block()
    with gmsh_session(**options) as gmsh:
        gmsh.model.addDiscreteEntity(3, 7)
        tags = 1 + 1000 * np.random.default_rng(1).permutation(len(points))
        gmsh.model.mesh.addNodes(3, 7, tags, points.ravel())
        gmsh.model.mesh.addElementsByType(7, 4, 5_000_000 - 30 * np.arange(len(cells)), tags[cells].ravel())
        gmsh.write(str(path))


def windows_2(path: Path) -> None:
    """Written on Windows by hand, with blanks, comments in many places, and sections of other programs."""
    points, cells = shapes.plate()
    nodes = "".join(f"  {i}\t{x:.6f}   {y:+.6f} {z:E}  \n" for i, (x, y, z) in enumerate(points, 1))
    elements = "".join(
        f"{i} 2 {2 + 2 * (i % 2)} 1 9{' 1' * 2 * (i % 2)} {a} {b} {c}\n" for i, (a, b, c) in enumerate(cells + 1, 2)
    )
    text = (
        "$Comments\n$Nodes are told of below; they cost 5 $ each\n$EndComments\n$MeshFormat\n2.1 0 8\n$EndMeshFormat\n"
        f'$PhysicalNames\n1\n2 1 "Blech, 2 mm"\n$EndPhysicalNames\n\n$Nodes\n {len(points)} \n{nodes}$EndNodes\n'
        f"$Solver\n$EndSolver\n$Elements\n{len(cells) + 1}\n1 15 2 0 1 1\n{elements}$EndElements\n"
        '$NodeData\n1\n"heat"\n1\n0.0\n3\n0\n1\n2\n1 1e-3\n3 7\n$EndNodeData\n$Comments\nend\n$EndComments\n'
    )
    path.write_bytes(text.replace("\n", "\r\n").encode())


def windows_4(path: Path) -> None:
    """gmsh's own text, with the ends of lines of Windows, a comment in front and a section at the end."""
    by_gmsh(plates, path, MshFileVersion=4.1, Binary=0)
    text = b"$Comments\nof 2024\n$EndComments\n" + path.read_bytes() + b"$Extra\n1 2 3\n$EndExtra\n"
    path.write_bytes(text.replace(b"\n", b"\r\n"))


def packed_2(path: Path, order: str = "<", together: int = 1) -> None:
    """Binary, version 2; headers stand before one element, or before many with more or fewer labels."""
    points, cells = shapes.block()
    nodes = np.zeros(len(points), dtype=[("tag", f"{order}i4"), ("x", f"{order}f8", 3)])
    nodes["tag"], nodes["x"] = np.arange(1, len(points) + 1), points
    elements = struct.pack(f"{order}6i", 15, 1, 2, 1, 0, 1) + struct.pack(f"{order}i", 1)
    for begin in range(0, len(cells), together):
        rows, labels = cells[begin : begin + together] + 1, 2 + 2 * (begin // together % 2)
        columns = [np.arange(begin, begin + len(rows)) + 2, *np.ones((labels, len(rows))), *rows.T]
        elements += struct.pack(f"{order}3i", 4, len(rows), labels)
        elements += np.column_stack(columns).astype(f"{order}i4").tobytes()
    path.write_bytes(
        b"$MeshFormat\n2.2 1 8\n" + struct.pack(f"{order}i", 1) + b"\n$EndMeshFormat\n"
        + b"$Nodes\n%d\n" % len(points) + nodes.tobytes() + b"\n$EndNodes\n"
        + b"$Elements\n%d\n" % (len(cells) + 1) + elements + b"\n$EndElements\n"
        + b"$Comments\n$Nodes\n0\n$EndNodes\n$EndComments\n"
    )  # fmt: skip


def without_line_breaks(path: Path) -> None:
    """Binary, version 2, as PyMesh and libigl write it: the ends of sections follow the numbers."""
    packed_2(path, together=40)
    path.write_bytes(re.sub(rb"\n(?=\$End)", b"", path.read_bytes()))


def named_1(path: Path) -> None:
    """By hand, version 1: numbers with gaps, names of groups and a section that is not known behind the elements."""
    points, cells = shapes.plate()
    nodes = "".join(f"{i} {x:.6f} {y:.6f} {z:g}\n" for i, (x, y, z) in enumerate(points, 11))
    elements = "".join(f"{i} 2 1 4 3  {a} {b} {c}\n" for i, (a, b, c) in enumerate(cells + 11, 3))
    path.write_text(
        f"$NOD\n{len(points)}\n{nodes}$ENDNOD\n$ELM\n{len(cells) + 1}\n1 15 9 5 1 11\n{elements}$ENDELM\n"
        '$PhysicalNames\n1\n2 1 "Blech"\n$EndPhysicalNames\n$PARA\n3 4\n$ENDPARA\n'
    )


def packed_4(path: Path, order: str = ">") -> None:
    """Binary, version 4.1, nodes in two blocks, the second with parameters, and an entity in two groups."""
    points, cells = shapes.plate()
    half = len(points) // 2
    blocks = struct.pack(f"{order}4Q", 2, len(points), 1, len(points))
    for begin, end, parametric in ((0, half, 0), (half, len(points), 1)):
        rows = np.column_stack([points[begin:end], *np.full((2 * parametric, end - begin), 0.25)])
        blocks += struct.pack(f"{order}3iQ", 2, 4, parametric, end - begin)
        blocks += np.arange(begin + 1, end + 1).astype(f"{order}u8").tobytes() + rows.astype(f"{order}f8").tobytes()
    table = np.column_stack([np.arange(len(cells)) + 1, cells + 1])
    path.write_bytes(
        b"$MeshFormat\n4.1 1 8\n" + struct.pack(f"{order}i", 1) + b"\n$EndMeshFormat\n"
        + b"$Entities\n" + struct.pack(f"{order}4Q", 0, 0, 1, 0)
        + struct.pack(f"{order}i6dQ2iQ", 4, 0, 0, 0, 3, 3, 0, 2, 8, -6, 0) + b"\n$EndEntities\n"
        + b"$Nodes\n" + blocks + b"\n$EndNodes\n"
        + b"$Elements\n" + struct.pack(f"{order}4Q3iQ", 1, len(cells), 1, len(cells), 2, 4, 2, len(cells))
        + table.astype(f"{order}u8").tobytes() + b"\n$EndElements\n"
    )  # fmt: skip


TEXT_1 = {"MshFileVersion": 1, "Binary": 0}
TEXT_2, BINARY_2 = {"MshFileVersion": 2.2, "Binary": 0}, {"MshFileVersion": 2.2, "Binary": 1}
TEXT_4, BINARY_4 = {"MshFileVersion": 4.1, "Binary": 0}, {"MshFileVersion": 4.1, "Binary": 1}

FILES: dict[str, Callable[[Path], None]] = {
    "groups_text_1.msh": partial(by_gmsh, boxes, **TEXT_1),
    "all_text_1.msh": partial(by_gmsh, plates, SaveAll=1, **TEXT_1),
    "named_text_1.msh": named_1,
    "groups_text_2.msh": partial(by_gmsh, boxes, **TEXT_2),
    "groups_binary_2.msh": partial(by_gmsh, boxes, **BINARY_2),
    "groups_text_4.msh": partial(by_gmsh, boxes, **TEXT_4),
    "groups_binary_4.msh": partial(by_gmsh, boxes, **BINARY_4),
    "all_text_4.msh": partial(by_gmsh, plates, SaveAll=1, **TEXT_4),
    "all_binary_4.msh": partial(by_gmsh, boxes, SaveAll=1, **BINARY_4),
    "parametric_text_2.msh": partial(by_gmsh, plates, SaveParametric=1, **TEXT_2),
    "parametric_binary_2.msh": partial(by_gmsh, boxes, SaveParametric=1, **BINARY_2),
    "parametric_text_4.msh": partial(by_gmsh, plates, SaveParametric=1, **TEXT_4),
    "parametric_binary_4.msh": partial(by_gmsh, boxes, SaveParametric=1, **BINARY_4),
    "periodic_binary_2.msh": partial(by_gmsh, periodic_box, **BINARY_2),
    "periodic_text_4.msh": partial(by_gmsh, periodic_box, **TEXT_4),
    "periodic_binary_4.msh": partial(by_gmsh, periodic_box, **BINARY_4),
    "partitioned_text_2.msh": partial(partitioned, **TEXT_2),
    "partitioned_binary_2.msh": partial(partitioned, **BINARY_2),
    "partitioned_text_4.msh": partial(partitioned, **TEXT_4),
    "partitioned_binary_4.msh": partial(partitioned, **BINARY_4),
    "views_text_2.msh": partial(with_views, **TEXT_2),
    "views_binary_2.msh": partial(with_views, **BINARY_2),
    "views_text_4.msh": partial(with_views, **TEXT_4),
    "views_binary_4.msh": partial(with_views, **BINARY_4),
    "sparse_text_2.msh": partial(sparse, **TEXT_2),
    "sparse_binary_4.msh": partial(sparse, **BINARY_4),
    "windows_2.msh": windows_2,
    "windows_4.msh": windows_4,
    "one_by_one_2.msh": packed_2,
    "without_line_breaks_2.msh": without_line_breaks,
    "big_endian_2.msh": partial(packed_2, order=">", together=40),
    "big_endian_4.msh": packed_4,
}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """What gmsh reads: points, and everything else."""
    with gmsh_session() as gmsh:
        gmsh.open(str(path))
        model, mesh, view = gmsh.model, gmsh.model.mesh, gmsh.view
        tags, points, _ = mesh.getNodes()
        entities = [tuple(entity) for entity in model.getEntities()]
        ghosts = [entity for entity in entities if "Ghost" in model.getType(*entity)]
        groups = model.getPhysicalGroups()
        others = {
            "tags": tags,
            "parameters": [mesh.getNodes(*entity, returnParametricCoord=True)[2] for entity in entities],
            "nodes": {entity: mesh.getNodes(*entity)[0] for entity in entities},
            "elements": {entity: mesh.getElements(*entity) for entity in entities if entity not in ghosts},
            "boundaries": {entity: model.getBoundary([entity], combined=False) for entity in entities},
            "partitions": {entity: model.getPartitions(*entity) for entity in entities},
            "ghosts": {entity: sorted(_pairs(*mesh.getGhostElements(*entity))) for entity in ghosts},
            "periodic": {entity: _periodic(mesh, entity) for entity in entities},
            "groups": {group: model.getEntitiesForPhysicalGroup(*group) for group in groups},
            "names": {group: model.getPhysicalName(*group) for group in groups},
            "views": [view.option.getString(tag, "Name") for tag in view.getTags()],
            "values": [_values(view, tag) for tag in view.getTags()],
        }
    return points.reshape(-1, 3), others


def _periodic(mesh: Any, entity: tuple[int, int]) -> Any:
    """The entity that it copies, the nodes of both, which gmsh gives in any order, and the motion between them."""
    master, mine, others, motion = mesh.getPeriodicNodes(*entity)
    return master, sorted(_pairs(mine, others)), motion


def _pairs(first: Any, second: Any) -> list[tuple[int, int]]:
    return list(zip(first.tolist(), second.tolist(), strict=True))


def _values(view: Any, tag: int) -> list[Any]:
    steps = int(view.option.getNumber(tag, "NbTimeStep"))
    return [view.getModelData(tag, step) for step in range(steps)]
