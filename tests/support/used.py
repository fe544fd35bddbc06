"""The files that the pages in docs/use/ are about, as the programs write them from which users come."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import files_openfoam
import generate
import layered
import meshio
import numpy as np
import pytest
from building import inner_vertices, quads, scattered, stacked
from programs import gmsh_session

from meshfix_cli import Mesh, perturb, read, write


def morph(folder: Path) -> None:
    """A bracket, and a displacement of its surface by which it twists; points inside are left behind."""
    mesh = Mesh.build(*generate.bracket(0.3, 4))
    x, y, z = mesh.points.T
    turn = 1.2 * x / x.max()
    middle = np.array([x, np.full_like(x, y.mean()), np.full_like(x, z.mean())]).T
    across = np.column_stack([np.zeros_like(x), z - z.mean(), y.mean() - y])
    there = middle + (mesh.points - middle) * np.cos(turn)[:, None] + across * np.sin(turn)[:, None]
    data = {"displacement": np.where(mesh.movable[:, None], 0.0, there - mesh.points)}
    meshio.Mesh(mesh.points, [("tetra", mesh.topology.simplices)], data).write(folder / "bracket.vtu")


def layers(folder: Path) -> None:
    """Thin layers around a cylinder, and the same after that has moved; as SU2 has them."""
    mesh = layered.layered()
    moved = layered.left_behind(mesh, layered.body_of(mesh) + np.array([0.03, 0.02]))
    for name, one in (("before", mesh), ("after", moved)):
        flat = np.column_stack([one.points, np.zeros(len(one.points))])
        meshio.Mesh(flat, [("triangle", mesh.topology.simplices)]).write(folder / "it.vtk")
        document = read(folder / "it.vtk")
        write(document, document.mesh, folder / f"{name}.su2")


def openfoam(folder: Path) -> None:
    """A case of hexahedra in two zones, of which points inside of these were moved."""
    points, cells = stacked(*quads(*generate.plate(0.5)), np.linspace(0.0, 0.8, 5))
    blocks = [("hexahedron", cells)]
    below = points[cells].mean(axis=1)[:, 2] < 0.4
    between = np.isin(np.arange(len(points)), cells[below]) & np.isin(np.arange(len(points)), cells[~below])
    tangled = scattered(points, inner_vertices(len(points), blocks) & ~between, 5, 0.25, seed=1)
    files_openfoam.write(folder / "case", tangled, blocks, rotor=np.flatnonzero(below))


def fenics(folder: Path) -> None:
    """A mesh with tags of its cells, in XDMF and HDF5 as dolfinx writes them."""
    h5py = pytest.importorskip("h5py")
    points, cells = generate.bracket(0.35, 4)
    tags = 1 + (np.arange(len(cells)) % (len(cells) // 3) >= len(cells) // 6)  # two layers each: cells come by thirds
    between = np.isin(np.arange(len(points)), cells[tags == 1]) & np.isin(np.arange(len(points)), cells[tags == 2])
    points = perturb(Mesh.build(points, cells, between), 10, "h", seed=1)[0].points
    with h5py.File(folder / "mesh.h5", "w") as file:
        file["Mesh/mesh/geometry"], file["Mesh/mesh/topology"] = points, cells
        file["MeshTags/cell_tags/topology"], file["MeshTags/cell_tags/Values"] = cells, tags[:, None]

    def item(name: str, width: int, count: int, kind: str = "") -> str:
        return f'<DataItem Dimensions="{count} {width}" {kind}Format="HDF">mesh.h5:/{name}</DataItem>'

    def topology(name: str) -> str:
        start = f'<Topology TopologyType="Tetrahedron" NumberOfElements="{len(cells)}" NodesPerElement="4">'
        return start + item(name, 4, len(cells), 'NumberType="Int" ') + "</Topology>"

    (folder / "mesh.xdmf").write_text(
        '<?xml version="1.0"?>\n<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>\n'
        '<Xdmf Version="3.0" xmlns:xi="https://www.w3.org/2001/XInclude">\n<Domain>\n'
        f'<Grid Name="mesh" GridType="Uniform">{topology("Mesh/mesh/topology")}\n'
        f'<Geometry GeometryType="XYZ">{item("Mesh/mesh/geometry", 3, len(points))}</Geometry></Grid>\n'
        '<Grid Name="cell_tags" GridType="Uniform"><xi:include xpointer="xpointer(/Xdmf/Domain/Grid/Geometry)" />\n'
        f'{topology("MeshTags/cell_tags/topology")}\n<Attribute Name="cell_tags" AttributeType="Scalar" Center="Cell">'
        f"{item('MeshTags/cell_tags/Values', 1, len(cells))}</Attribute></Grid>\n</Domain>\n</Xdmf>\n"
    )


def ring(path: Path, order: int) -> None:
    """A quarter of a ring, of which the bore has bulged and the rest was left behind; a regular mesh of gmsh."""
    with gmsh_session() as gmsh:
        geo = gmsh.model.geo
        middle, a, b, c, d = (geo.addPoint(*at, 0) for at in ((0, 0), (1, 0), (2, 0), (0, 2), (0, 1)))
        lines = geo.addLine(a, b), geo.addCircleArc(b, middle, c), geo.addLine(c, d), geo.addCircleArc(d, middle, a)
        face = geo.addPlaneSurface([geo.addCurveLoop(lines)])
        for line, count in zip(lines, (7, 11, 7, 11), strict=True):
            geo.mesh.setTransfiniteCurve(line, count)
        geo.mesh.setTransfiniteSurface(face)
        geo.synchronize()
        gmsh.model.addPhysicalGroup(2, [face], name="ring")
        gmsh.model.addPhysicalGroup(1, [lines[3]], name="bore")
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(order)
        tags, points, _ = gmsh.model.mesh.getNodes(1, lines[3])
        for tag, at in zip(tags, points.reshape(-1, 3), strict=True):
            gmsh.model.mesh.setNode(tag, at * (1 + 0.4 * np.sin(2 * np.arctan2(at[1], at[0]))), [])
        gmsh.write(str(path))


def pyvista(folder: Path) -> None:
    """A grid of voxels with data, of which some points were moved."""
    pv = pytest.importorskip("pyvista")
    grid = pv.ImageData(dimensions=(9, 7, 7)).cast_to_unstructured_grid()
    inside = ((grid.points > 0) & (grid.points < np.array([8, 6, 6]))).all(axis=1)
    grid.points = scattered(np.array(grid.points), inside, 20, 1.2, seed=1)
    grid["temperature"] = np.arange(grid.n_points) / 10
    grid.save(folder / "grid.vtu")


# By the names of the pages; others need the samples alone.
FILES: dict[str, Callable[[Path], None]] = {
    "morph": morph,
    "layers": layers,
    "openfoam": openfoam,
    "fenics": fenics,
    "gmsh": lambda folder: ring(folder / "ring.msh", 1),
    "second-order": lambda folder: ring(folder / "ring.msh", 2),
    "pyvista": pyvista,
}
