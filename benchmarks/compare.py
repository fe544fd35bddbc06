"""Against gmsh's UntangleMeshGeometry: `make compare`, or `python benchmarks/compare.py [MESH | --tets N]`.

No other program that PyPI has untangles tetrahedra without changing their connectivity or boundary.

Both get the same arrays in one process. gmsh is given the mesh as it is and scaled to unit edges, with the topology
that it makes itself; with --tets a box with cylindrical holes is meshed, P=10, D=h. It numbers the nodes anew, so its
result is read with its own elements and measured by meshfix: elements inverted, interior facets folded, smallest, 1st
percentile and mean of the elements' smallest angles, CPU seconds of the algorithm alone, and the vertices on the
boundary that are not where one of the boundary was.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import gmsh
import numpy as np
from box import box_with_holes
from geometries import GEOMETRIES
from rich.console import Console
from rich.table import Table
from scipy.spatial import cKDTree

from meshfix_cli import Mesh, perturb, read, summarise, untangle

GEOMETRY_NAMES = ("plate with holes", "annulus", "box with pipes", "graded cube")
CASES = ((25, 1), (100, 2), (100, 8))  # percent, multiples of h
LARGE = ((10, 1),)
ELEMENT_TYPE = {2: 2, 3: 4}  # gmsh's numbers of triangles and tetrahedra


def tangled(name: str, mesh: Mesh, cases: tuple[tuple[int, int], ...] = CASES) -> Iterator[tuple[str, Mesh]]:
    """Yield cases of a valid mesh."""
    for percent, distance in cases:
        yield f"{name}, P={percent} D={distance}h", perturb(mesh, percent, distance * mesh.mean_edge_length(), 0)[0]
    if cases is LARGE:
        return
    points = mesh.points.copy()
    points[mesh.movable] = points[mesh.movable].mean(axis=0)
    yield f"{name}, collapsed", mesh.with_points(points)


def with_meshfix(mesh: Mesh) -> Mesh:
    """Run the default strategy."""
    return untangle(mesh).after


def with_meshfix_best(mesh: Mesh) -> Mesh:
    """Run it with `--smooth best`."""
    return untangle(mesh, smooth="best").after


def with_gmsh(mesh: Mesh) -> Mesh:
    """Run gmsh on the mesh as it is."""
    d, simplices = mesh.dimension, mesh.topology.simplices
    tags = np.flatnonzero(mesh.topology.used) + 1
    points = np.zeros((len(tags), 3))
    points[:, :d] = mesh.points[tags - 1]
    gmsh.model.add("tangled")
    try:
        gmsh.model.addDiscreteEntity(d, 1)
        gmsh.model.mesh.addNodes(d, 1, tags, points.ravel())
        gmsh.model.mesh.addElementsByType(1, ELEMENT_TYPE[d], [], (simplices + 1).ravel())
        gmsh.model.mesh.createTopology()
        gmsh.model.mesh.optimize("UntangleMeshGeometry")
        found, coordinates, _ = gmsh.model.mesh.getNodes()
        elements = gmsh.model.mesh.getElementsByType(ELEMENT_TYPE[d])[1]
    finally:
        gmsh.model.remove()
    result = np.zeros((int(found.max()), d))
    result[found.astype(np.int64) - 1] = coordinates.reshape(-1, 3)[:, :d]
    return Mesh.build(result, elements.reshape(-1, d + 1).astype(np.int64) - 1)


def with_gmsh_scaled(mesh: Mesh) -> Mesh:
    """Run gmsh on the mesh in its mean edge lengths."""
    h = mesh.mean_edge_length()
    result = with_gmsh(mesh.with_points(mesh.points / h))
    return result.with_points(h * result.points)


PROGRAMS: dict[str, Callable[[Mesh], Mesh]] = {
    "meshfix": with_meshfix, "meshfix, best": with_meshfix_best,
    "gmsh": with_gmsh, "gmsh, unit edges": with_gmsh_scaled,
}  # fmt: skip


def add_rows(table: Table, name: str, mesh: Mesh) -> None:
    """Run every program on a case."""
    times: dict[str, float] = {}
    for program, run in PROGRAMS.items():
        start = time.process_time()
        try:
            result = run(mesh)
        except Exception as error:  # gmsh raises Exception itself
            table.add_row(name, program, f"error: {error}")
            continue
        times[program] = time.process_time() - start
        summary = summarise(result)
        rim = cKDTree(mesh.points[mesh.topology.boundary])
        far = rim.query(result.points[result.topology.boundary])[0]
        table.add_row(
            name, program, f"{summary.inverted:,}", f"{summary.folded:,}", f"{summary.min_angle:.3f}",
            f"{summary.percentile_1:.2f}", f"{summary.mean_min_angle:.2f}", f"{times[program]:.3f}",
            f"{times[program] / times['meshfix']:.3g}", f"{(far > 1e-9 * mesh.mean_edge_length()).sum():,}",
            end_section=program == list(PROGRAMS)[-1],
        )  # fmt: skip


def main() -> None:
    """Compare on generated meshes, or on a valid mesh of the user's."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh", nargs="?", type=Path, help="a valid mesh; default: generated ones")
    parser.add_argument("--tets", type=int, metavar="N", help="instead, a box with holes of about N tetrahedra")
    options = parser.parse_args()
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Verbosity", 0)
    columns = ("case", "program", "inverted", "folded", "smallest", "1st", "mean", "CPU s", "ratio", "boundary moved")
    table = Table(*columns, title="angles in degrees; ratio: of the seconds to those of the first row")
    cases = LARGE if options.tets else CASES
    if options.tets:
        meshes = {"box with holes": box_with_holes(options.tets)}
    elif options.mesh is not None:
        meshes = {options.mesh.stem: read(str(options.mesh)).mesh}
    else:
        meshes = {name: Mesh.build(*GEOMETRIES[name]()) for name in GEOMETRY_NAMES}
    for name, mesh in meshes.items():
        for case, start in tangled(name, mesh, cases):
            add_rows(table, case, start)
    gmsh.finalize()
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
