"""What others make of a triangulated surface without changing its triangles: optional packages of PyPI, and CGAL.

Each takes a body and returns its points (n, 3), moved, and CPU seconds of the algorithm alone: of this process with all
its threads, or of the part of its own process that CGAL's algorithm takes. Ten iterations each; points on sharp edges
and boundaries are held where a program can.
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from exact_surfaces import Points
from surface_bodies import HELD, Body, Cells

ITERATIONS = 10
FEATURE_ANGLE = 40
RELAXATION = """
#include <CGAL/Polygon_mesh_processing/tangential_relaxation.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <ctime>
#include <fstream>
#include <iostream>

using Mesh = CGAL::Surface_mesh<CGAL::Simple_cartesian<double>::Point_3>;

int main(int, char** words) {
  Mesh mesh;
  if (!CGAL::IO::read_OFF(words[1], mesh)) return 1;
  auto held = mesh.add_property_map<Mesh::Vertex_index, bool>("v:held", false).first;
  std::ifstream rows(words[2]);
  for (unsigned row; rows >> row;) held[Mesh::Vertex_index(row)] = true;
  const auto given = CGAL::parameters::vertex_is_constrained_map(held).number_of_iterations(std::stoi(words[4]));
  const std::clock_t start = std::clock();
  CGAL::Polygon_mesh_processing::tangential_relaxation(vertices(mesh), mesh, given);
  std::cout << double(std::clock() - start) / CLOCKS_PER_SEC << std::endl;
  std::ofstream moved(words[3]);
  moved.precision(17);
  CGAL::IO::write_OFF(moved, mesh);
}
"""

Result = tuple[Points, float]


class MissingError(Exception):
    """A program is not installed."""


def write_off(path: Path, points: Points, cells: Cells) -> None:
    """Write triangles so that each coordinate is read as it was."""
    lines = ["OFF", f"{len(points)} {len(cells)} 0"]
    lines += [" ".join(map(repr, row)) for row in points.tolist()]
    lines += ["3 {} {} {}".format(*row) for row in cells.tolist()]
    path.write_text("\n".join(lines) + "\n")


def read_off(path: Path) -> Points:
    """Return the points (n, 3) of a file that `write_off` or a program made."""
    words = path.read_text().split()[1:]
    count = int(words[0])
    return np.array(words[3 : 3 + 3 * count], dtype=np.float64).reshape(-1, 3)


def timed(action: Callable[[], Any]) -> tuple[Any, float]:
    """Return what an action gives, and its CPU seconds."""
    start = time.process_time()
    return action(), time.process_time() - start


@cache
def relaxation() -> Path:
    """Compile CGAL's relaxation; its headers are those of Debian's libcgal-dev."""
    folder = Path(tempfile.mkdtemp())
    source, program = folder / "relaxation.cpp", folder / "relaxation"
    source.write_text(RELAXATION)
    words = ["g++", "-std=c++17", "-O2", "-DNDEBUG", str(source), "-o", str(program), "-lgmp", "-lmpfr"]
    try:
        done = subprocess.run(words, capture_output=True, check=False)
    except FileNotFoundError as error:
        raise MissingError("needs g++ and libcgal-dev") from error
    if done.returncode:
        raise MissingError("needs g++ and libcgal-dev")
    return program


def cgal(body: Body) -> Result:
    """Run CGAL's tangential relaxation, which packages of PyPI do not have."""
    program = relaxation()
    with tempfile.TemporaryDirectory() as folder:
        source, held, target = (Path(folder, name) for name in ("in.off", "held.txt", "out.off"))
        write_off(source, body.points, body.cells)
        held.write_text("\n".join(map(str, np.flatnonzero(body.of_points == HELD).tolist())))
        words = [program, source, held, target, str(ITERATIONS)]
        done = subprocess.run([*map(str, words)], capture_output=True, text=True, check=True)
        return read_off(target), float(done.stdout)


def meshlib(body: Body) -> Result:
    """Run MeshLib's relaxation towards equal areas, in tangent planes; in single precision."""
    from meshlib import mrmeshnumpy, mrmeshpy

    mesh = mrmeshnumpy.meshFromFacesVerts(body.cells.astype(np.int32), body.points)
    settings = mrmeshpy.MeshEqualizeTriAreasParams()
    settings.iterations, settings.noShrinkage = ITERATIONS, True
    free = mrmeshnumpy.vertBitSetFromBools(body.of_points != HELD)
    settings.region = free
    _, seconds = timed(lambda: mrmeshpy.equalizeTriAreas(mesh, settings))
    return mrmeshnumpy.getNumpyVerts(mesh).copy(), seconds


def meshlab(body: Body) -> Result:
    """Run MeshLab's isotropic remesher: it smooths and projects, and neither splits, collapses nor swaps."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(body.points, body.cells))

    def remesh() -> None:
        meshes.meshing_isotropic_explicit_remeshing(
            iterations=ITERATIONS, targetlen=pymeshlab.PureValue(body.h), featuredeg=FEATURE_ANGLE, splitflag=False,
            collapseflag=False, swapflag=False, smoothflag=True, reprojectflag=True,
        )  # fmt: skip

    _, seconds = timed(remesh)
    made = meshes.current_mesh()
    if made.vertex_number() != len(body.points) or (made.face_matrix() != body.cells).any():
        raise ValueError("the triangles are others")
    return made.vertex_matrix(), seconds


def trimesh(body: Body) -> Result:
    """Run trimesh's Laplacian."""
    from trimesh import Trimesh, smoothing

    mesh = Trimesh(body.points, body.cells, process=False)
    smooth: Any = smoothing.filter_laplacian
    keep = mesh.is_watertight  # the volume, by scaling
    _, seconds = timed(lambda: smooth(mesh, iterations=ITERATIONS, volume_constraint=keep))
    return np.asarray(mesh.vertices), seconds


def pyvista(body: Body) -> Result:
    """Run VTK's Laplacian, which finds sharp edges and boundaries."""
    import pyvista as pv

    mesh = pv.PolyData.from_regular_faces(body.points, body.cells)
    made, seconds = timed(
        lambda: mesh.smooth(
            n_iter=ITERATIONS, relaxation_factor=0.1, feature_angle=FEATURE_ANGLE, feature_smoothing=True,
            boundary_smoothing=False,
        )
    )  # fmt: skip
    return np.asarray(made.points, dtype=np.float64), seconds


PROGRAMS: dict[str, Callable[[Body], Result]] = {
    "CGAL, tangential": cgal,
    "MeshLib, equal areas": meshlib,
    "MeshLab, remesher": meshlab,
    "trimesh, Laplacian": trimesh,
    "VTK, Laplacian": pyvista,
}
