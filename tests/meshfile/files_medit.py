"""MEDIT files as programs write them, and a reader of our own, token by token."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import shapes
from numpy.typing import NDArray
from programs import gmsh_session

from meshfix_cli.mesh.mesh import Mesh

COLUMNS = {"Edges": 3, "Triangles": 4, "Quadrilaterals": 5, "Tetrahedra": 5, "NormalAtVertices": 2, "Ridges": 1}


def rows(values: Iterable[Iterable[object]], between: str = " ", end: str = "\n") -> str:
    return "".join(between.join(map(str, row)) + end for row in values)


def surface(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Facets (k, d) that belong to one simplex only."""
    d = cells.shape[1]
    facets = np.concatenate([np.delete(cells, corner, axis=1) for corner in range(d)])
    _, first, count = np.unique(np.sort(facets, axis=1), axis=0, return_index=True, return_counts=True)
    return facets[np.sort(first[count == 1])]


def interior(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.flatnonzero(Mesh.build(points[:, : cells.shape[1] - 1], cells).movable)


def material(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """1, or 2 for cells that have no interior vertex: all of these are between cells of 1, and free."""
    return np.where(np.isin(cells, interior(points, cells)).any(axis=1), 1, 2)


def vertices(points: NDArray[np.float64], dimension: int, end: str = "\n") -> str:
    return rows(([f"{x:.6f}" for x in p[:dimension]] + [str(i % 3)] for i, p in enumerate(points)), end=end)


def cells_of(cells: NDArray[np.int64], points: NDArray[np.float64] | None = None, end: str = "\n") -> str:
    """Numbers from 1, and a reference: the material, or that of the first half or the second."""
    references = 1 + 2 * np.arange(len(cells)) // len(cells) if points is None else material(points, cells)
    return rows(([*(c + 1), reference] for c, reference in zip(cells, references, strict=True)), end=end)


def gmsh(path: Path) -> None:
    write_with_gmsh(path, *shapes.block())


def gmsh_plane(path: Path) -> None:
    write_with_gmsh(path, *shapes.plate())


def write_with_gmsh(path: Path, points: NDArray[np.float64], cells: NDArray[np.int64]) -> None:
    """Simplices and their boundary, as two entities, in any format that gmsh writes."""
    d = cells.shape[1] - 1
    with gmsh_session(SaveAll=1) as module:
        for dimension, simplices in ((d - 1, surface(cells)), (d, cells)):
            tag = module.model.addDiscreteEntity(dimension)
            if dimension == d - 1:
                module.model.mesh.addNodes(dimension, tag, np.arange(1, len(points) + 1), points.ravel())
            kind = {1: 1, 2: 2, 3: 4}[dimension]
            module.model.mesh.addElementsByType(tag, kind, [], (simplices + 1).ravel())
        module.write(str(path))


def meshio(path: Path) -> None:
    import meshio

    points, cells = shapes.block()
    blocks = [("triangle", surface(cells)), ("tetra", cells)]
    references = [np.arange(len(blocks[0][1])) // 50, material(points, cells)]
    meshio.Mesh(points, blocks, {"medit:ref": np.arange(len(points))}, {"medit:ref": references}).write(path)


def mmg3d(path: Path) -> None:
    points, cells = shapes.block()
    skin = surface(cells)
    held = interior(points, cells)[2] + 1  # the mesh can be mended with it held
    edges = np.unique(np.sort(skin[:20, :2], axis=1), axis=0)
    path.write_text(
        f"MeshVersionFormatted 2\n\n\nDimension 3\n\nVertices\n{len(points)}\n"
        + rows(([*(f"{x:.15g}" for x in p), i % 3] for i, p in enumerate(points)), end=" \n")
        + f"\nCorners\n4\n1 \n2 \n3 \n4 \n\nRequiredVertices\n2\n{held} \n5 \n"
        + f"\nTriangles\n{len(skin)}\n{cells_of(skin)}\nRequiredTriangles\n3\n1 \n2 \n3 \n"
        + f"\nEdges\n{len(edges)}\n{cells_of(edges)}\nRidges\n2\n1 \n2 \n\nRequiredEdges\n1\n1 \n"
        + "\nNormals\n2\n0.57735026918962573 0 -1e-3 \n0 0 1 \n\nNormalAtVertices\n2\n1 1 \n2 2 \n"
        + "\nTangents\n1\n1 0 0 \n\nTangentAtVertices\n1\n3 1 \n"
        + f"\nTetrahedra\n{len(cells)}\n{cells_of(cells, points)}\nRequiredTetrahedra\n1\n5 \n\nEnd\n"
    )


def mmg2d(path: Path) -> None:
    points, cells = shapes.plate()
    edges = surface(cells)
    path.write_text(
        f"MeshVersionFormatted 2\n\n\nDimension 2\n\n\nVertices\n{len(points)}\n{vertices(points, 2)}\n\nEdges\n"
        f"{len(edges)}\n{cells_of(edges)}\n\nRequiredEdges\n1\n2\n\n"
        f"Triangles\n{len(cells)}\n{cells_of(cells, points)}\n\nEnd\n"
    )


def freefem(path: Path) -> None:
    """All on a few lines, counts behind the words, and nothing behind End, not even the end of the line."""
    points, cells = shapes.plate()
    edges = surface(cells)
    path.write_text(
        f"MeshVersionFormatted 1 Dimension 2 Vertices {len(points)} {vertices(points, 2, end='  ')}"
        f"Edges {len(edges)} {cells_of(edges, None, '  ')}\nTriangles {len(cells)} {cells_of(cells, points, ' ')} End"
    )


def bamg(path: Path) -> None:
    points, cells = shapes.plate()
    path.write_text(
        'MeshVersionFormatted 0\nDimension\n2\nIdentifier\n"G=plate.msh; 1 Triangles # no comment"\nGeometry\n'
        f'"the Vertices of plate"\n\nMaximalAngleOfCorner 46\nVertices\n{len(points)}\n{vertices(points, 2)}\n'
        f"Triangles\n{len(cells)}\n{cells_of(cells, points)}\nSubDomain\n1\n3 1 1 0\n\n"
        "VertexOnGeometricVertex\n1\n1 1\n\nEnd\n"
    )


def commented(path: Path) -> None:
    """By hand: comments between numbers, ends of lines of Windows, and text behind End."""
    points, cells = shapes.block()
    lines = vertices(points, 3).splitlines()
    lines[3] += "   # the fourth: 1 2 3 Triangles"
    body = cells_of(cells, points).replace("\n", "\n# between two: 5 6 7 8\n", 2)
    text = (
        "# a block\n#\n MeshVersionFormatted\t2 # double\n Dimension # of space\n\t3\n\n Vertices # points\n"
        f"{len(points)} # of them\n"
        + "\n".join(lines)
        + f"\nTetrahedra\n\n   {len(cells)}\n{body}\n#last\nEnd\nwhatever # is here 1"
    )
    path.write_bytes(text.replace("\n", "\r\n").encode())


def single(path: Path) -> None:
    points, cells = shapes.block()
    skin = surface(cells)
    path.write_text(
        f"\nMeshVersionFormatted\n1\nDimension\n3\nTriangles\n{len(skin)}\n{cells_of(skin)}Vertices\n{len(points)}\n"
        f"{vertices(points, 3)}Tetrahedra\n{len(cells)}\n{cells_of(cells, points)}End\n"
    )


FILES: dict[str, Callable[[Path], None]] = {
    "gmsh.mesh": gmsh,
    "gmsh_plane.mesh": gmsh_plane,
    "meshio.mesh": meshio,
    "mmg3d.mesh": mmg3d,
    "mmg2d.mesh": mmg2d,
    "freefem.mesh": freefem,
    "bamg.mesh": bamg,
    "commented.mesh": commented,
    "single.mesh": single,
}


def read_independently(path: Path) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Points (n, 3), the words of each section but for the coordinates, and the comments."""
    text = path.read_bytes().decode()
    texts = re.findall(r'#[^\r\n]*|"[^"]*"', text)
    words = re.sub(r'#[^\r\n]*|"[^"]*"', "", text).split()
    rest: dict[str, Any] = {"texts": texts}
    i, points, name = 0, np.empty((0, 3)), ""
    while i < len(words):
        if words[i][0].isalpha():
            name = words[i]
            rest[name] = []
        else:
            rest[name].append(words[i])
        i += 1
    dimension = int(rest["Dimension"][0])
    table = np.array(rest["Vertices"][1:]).reshape(int(rest["Vertices"][0]), dimension + 1)
    points = np.zeros((len(table), 3), dtype=np.float32 if rest["MeshVersionFormatted"] == ["1"] else np.float64)
    points[:, :dimension] = table[:, :dimension].astype(points.dtype)
    rest["Vertices"] = table[:, dimension].tolist()
    for section, columns in COLUMNS.items():
        assert len(rest.get(section, ["0"])) == 1 + columns * int(rest.get(section, ["0"])[0])
    return points, rest
