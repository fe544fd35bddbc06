"""Makes the sample meshes: `python sample_meshes/generate.py` writes every file beside this script again.

The geometries are functions of a mesh size, which the tests and the benchmarks use too.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from building import Blocks, box, inner_vertices, quads, scattered, stacked
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.solve.perturb import perturb

Points = NDArray[np.float64]
Simplices = NDArray[np.int32]

PLATE = (3.0, 2.0)
HOLES = ((0.8, 1.25, 0.35), (2.1, 0.8, 0.45))  # x, y, radius


def plate(h: float, relaxations: int = 1, seed: int = 9) -> tuple[Points, Simplices]:
    """Return a Delaunay mesh (n, 2), (m, 3) of a plate with two round holes, of edges near `h`."""
    boundary = _plate_boundary(h)
    interior = _hexagonal_grid(h, seed)
    fixed = len(boundary)
    interior = interior[_signed_distance(interior) > 0.6 * h]
    for _ in range(relaxations):
        points = np.concatenate([boundary, interior])
        triangles = _triangulate(points)
        interior = _neighbour_means(points, triangles)[fixed:]
    points = np.concatenate([boundary, interior])
    return points, _triangulate(points)


def bracket(h: float, layers: int, angle: float = 1.2) -> tuple[Points, Simplices]:
    """Return a tetrahedral mesh (n, 3), (m, 4): the plate made thick in layers and bent round by `angle`."""
    points, tets = extruded(*plate(h), np.linspace(0.0, layers * h * 0.8, layers + 1))
    return bent(points, angle), tets


def extruded(plane: Points, triangles: Simplices, heights: NDArray[np.float64]) -> tuple[Points, Simplices]:
    """Return the tetrahedra between copies of a triangle mesh at some heights."""
    points, wedges = stacked(plane, triangles, heights)
    return points, split_wedges(wedges)


def bent(points: Points, angle: float) -> Points:
    """Bend a plate upon z = 0 round the y axis."""
    if angle == 0.0:
        return points
    radius = PLATE[0] / angle
    turn, r = points[:, 0] / radius, radius + points[:, 2]
    return np.column_stack([r * np.sin(turn), points[:, 1], r * np.cos(turn) - radius])


def split_wedges(wedges: Simplices) -> Simplices:
    """Cut each wedge into three tetrahedra; diagonals start at the lower number, so neighbours agree."""
    order = np.argsort(wedges[:, :3], axis=1)
    a, b, c = np.take_along_axis(wedges[:, :3], order, axis=1).T
    d, e, f = np.take_along_axis(wedges[:, 3:], order, axis=1).T
    tets = np.concatenate([np.stack(t, axis=1) for t in ((a, b, c, f), (a, b, f, e), (a, e, f, d))])
    odd = np.tile((order[:, 0] + 1) % 3 != order[:, 1], 3)
    tets[odd] = tets[odd][:, [1, 0, 2, 3]]
    return tets.astype(np.int32)


def _plate_boundary(h: float) -> Points:
    length, width = PLATE
    nx, ny = round(length / h), round(width / h)
    x, y = np.arange(nx) * length / nx, np.arange(ny) * width / ny
    sides = [
        np.column_stack([x, np.zeros(nx)]),
        np.column_stack([np.full(ny, length), y]),
        np.column_stack([length - x, np.full(nx, width)]),
        np.column_stack([np.zeros(ny), width - y]),
    ]
    for cx, cy, radius in HOLES:
        turn = np.linspace(0.0, 2 * np.pi, max(8, round(2 * np.pi * radius / h)), endpoint=False)
        sides.append(np.column_stack([cx + radius * np.cos(turn), cy + radius * np.sin(turn)]))
    return np.concatenate(sides)


def _hexagonal_grid(h: float, seed: int) -> Points:
    length, width = PLATE
    rows, columns = np.mgrid[0 : round(width / (h * 0.866)) + 1, 0 : round(length / h) + 1]
    grid = np.column_stack([((columns + rows % 2 * 0.5) * h).ravel(), (rows * h * 0.866).ravel()])
    return grid + np.random.default_rng(seed).uniform(-0.3 * h, 0.3 * h, grid.shape)


def _signed_distance(points: Points) -> NDArray[np.float64]:
    """Distance to the boundary of the plate, positive inside."""
    length, width = PLATE
    x, y = points.T
    walls = [x, length - x, y, width - y]
    holes = [np.hypot(x - cx, y - cy) - radius for cx, cy, radius in HOLES]
    return np.min(walls + holes, axis=0)


def _triangulate(points: Points) -> Simplices:
    triangles = Delaunay(points).simplices
    triangles = triangles[_signed_distance(points[triangles].mean(axis=1)) > 0.0]
    a, b, c = (points[triangles[:, k]] for k in range(3))
    negative = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    triangles[negative] = triangles[negative][:, ::-1]
    return triangles.astype(np.int32)


def _neighbour_means(points: Points, triangles: Simplices) -> Points:
    sums, counts = np.zeros_like(points), np.zeros(len(points))
    for i in range(3):
        for j in range(3):
            if i != j:
                np.add.at(sums, triangles[:, i], points[triangles[:, j]])
                np.add.at(counts, triangles[:, i], 1)
    return sums / counts[:, None]


def _write_vtk(path: Path, points: Points, cells: Blocks, title: str) -> None:
    spatial = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
    lines = ["# vtk DataFile Version 2.0", title, "ASCII", "DATASET UNSTRUCTURED_GRID"]
    lines += [f"POINTS {len(points)} double", *_rows(spatial)]
    rows = [f"{elements.shape[1]} {row}" for _, elements in cells for row in _rows(elements)]
    lines += [f"CELLS {len(rows)} {sum(elements.size for _, elements in cells) + len(rows)}", *rows]
    lines += [f"CELL_TYPES {len(rows)}", *[str(ELEMENTS[key].vtk) for key, elements in cells for _ in elements]]
    path.write_text("\n".join(lines) + "\n")


def _write_msh(
    path: Path, points: Points, cells: Blocks, groups: NDArray[np.int64], names: list[str], title: str
) -> None:
    """gmsh 2.2 ASCII, with a physical group of each element (groups count from 1)."""
    lines = ["$Comments", title, "$EndComments", "$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    lines += ["$PhysicalNames", str(len(names))]
    lines += [f'3 {k + 1} "{name}"' for k, name in enumerate(names)]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(points))]
    lines += [f"{k + 1} {row}" for k, row in enumerate(_rows(points))]
    rows = [(ELEMENTS[key].gmsh, row) for key, elements in cells for row in _rows(elements + 1)]
    lines += ["$EndNodes", "$Elements", str(len(rows))]
    lines += [f"{k + 1} {kind} 2 {groups[k]} {groups[k]} {row}" for k, (kind, row) in enumerate(rows)]
    path.write_text("\n".join([*lines, "$EndElements"]) + "\n")


def _write_inp(path: Path, points: Points, hexahedra: Simplices, name: str, title: str) -> None:
    lines = ["*HEADING", title, "*NODE", *[f"{k + 1}, {row}" for k, row in enumerate(_rows(points, ", "))]]
    lines += [f"*ELEMENT, TYPE=C3D8, ELSET={name}"]
    lines += [f"{k + 1}, {row}" for k, row in enumerate(_rows(hexahedra + 1, ", "))]
    path.write_text("\n".join(lines) + "\n")


def _write_obj(path: Path, points: Points, triangles: Simplices, title: str) -> None:
    flat = " 0" if points.shape[1] == 2 else ""
    lines = [f"# {title}", "o plate", *[f"v {row}{flat}" for row in _rows(points)]]
    lines += [f"f {row}" for row in _rows(triangles + 1)]
    path.write_text("\n".join(lines) + "\n")


def _rows(array: NDArray[np.generic], between: str = " ") -> list[str]:
    return [between.join(map(str, row)) for row in array.tolist()]


def _tangled(points: Points, cells: Simplices, percent: float, distance: float) -> Points:
    mesh = Mesh.build(points, cells)
    return perturb(mesh, percent, distance * mesh.mean_edge_length(), seed=1)[0].points


def _scattered(points: Points, cells: Blocks, percent: float, distance: float) -> Points:
    return scattered(points, inner_vertices(len(points), cells), percent, distance, seed=1).round(6)


def main() -> None:
    """Write every sample."""
    folder = Path(__file__).parent
    points, triangles = plate(0.18)
    points = points.round(6)
    _write_vtk(folder / "plate.vtk", points, [("triangle", triangles)], "plate with two holes, by generate.py")
    tangled, title = _tangled(points, triangles, 25, 2), "plate.vtk with 25 percent moved by 2h, by generate.py"
    _write_vtk(
        folder / "plate_tangled.vtk",
        tangled.round(6),
        [("triangle", triangles)],
        title,
    )
    _write_obj(
        folder / "plate_tangled.obj",
        tangled.round(6),
        triangles,
        title,
    )
    points, tets = bracket(0.18, 8)
    points = points.round(6)
    _write_vtk(folder / "bracket.vtk", points, [("tetra", tets)], "bent bracket with two holes, by generate.py")
    tangled, title = _tangled(points, tets, 10, 1), "bracket.vtk with 10 percent moved by h, by generate.py"
    _write_vtk(folder / "bracket_tangled.vtk", tangled.round(6), [("tetra", tets)], title)
    points, tets = bracket(0.25, 6, angle=0.0)
    groups = 1 + (points[tets].mean(axis=1)[:, 2] > points[:, 2].max() / 2).astype(np.int64)
    tangled = _tangled(points.round(6), tets, 10, 1)
    interface = np.isin(np.arange(len(points)), tets[groups == 1]) & np.isin(np.arange(len(points)), tets[groups == 2])
    tangled = np.where(interface[:, None], points, tangled)
    title = "flat plate of two materials, by generate.py, 10 percent moved by h but for the interface"
    _write_msh(folder / "two_materials.msh", tangled.round(6), [("tetra", tets)], groups, ["steel", "copper"], title)
    _write_shell(folder)
    _write_other_elements(folder)


def lifted(points: Points) -> Points:
    """Return points of the plane on a shell over it that is bent both ways."""
    x, y = points.T
    return np.column_stack([points, 0.4 * np.cos(x) * np.cos(1.5 * y)])


def _write_shell(folder: Path) -> None:
    """Write a shell with two holes, and the same tangled along its surface."""
    points, triangles = plate(0.2)
    _write_obj(folder / "shell.obj", lifted(points).round(6), triangles, "shell with two holes, by generate.py")
    tangled = _tangled(points, triangles, 25, 1.5)
    title = "shell.obj with 25 percent moved along it by 1.5h, by generate.py"
    _write_obj(folder / "shell_tangled.obj", lifted(tangled).round(6), triangles, title)


def _write_other_elements(folder: Path) -> None:
    """Write samples of quads, of hexahedra, and of hexahedra, pyramids and tetrahedra."""
    points, cells = quads(*plate(0.25))
    tangled = _scattered(points, [("quad", cells)], 25, 0.3)
    title = "plate of quads with two holes, by generate.py, 25 percent moved by 0.3"
    _write_vtk(folder / "quads_tangled.vtk", tangled, [("quad", cells)], title)
    points, cells = stacked(*quads(*plate(0.4)), np.linspace(0.0, 0.8, 5))
    points = bent(points, 1.2)
    tangled = _scattered(points, [("hexahedron", cells)], 10, 0.3)
    title = "bent bracket of hexahedra with two holes, by generate.py, 10 percent moved by 0.3"
    _write_inp(folder / "hexes_tangled.inp", tangled, cells, "BRACKET", title)
    kinds = np.full((6, 4, 5), "hexahedron")
    kinds[:, :, 2], kinds[:, :, 3:] = "pyramid", "tetra"
    points, blocks = box(kinds, *(np.linspace(0.0, 0.5 * count, count + 1) for count in kinds.shape))
    points = bent(points, 1.2)
    tangled = _scattered(points, blocks, 10, 1.0)
    groups = np.ones(sum(len(rows) for _, rows in blocks), dtype=np.int64)
    title = "bent block of hexahedra, pyramids and tetrahedra, by generate.py, 10 percent moved by 1"
    _write_msh(folder / "mixed_tangled.msh", tangled, blocks, groups, ["block"], title)


if __name__ == "__main__":
    main()
