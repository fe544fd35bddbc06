"""Meshes for the tests, made by the project's own generator, and what their programs need."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from importlib.util import find_spec
from pathlib import Path

import generate
import numpy as np
import pytest
from numpy.typing import NDArray

from meshfix_cli.mesh import Mesh
from meshfix_cli.perturb import perturb

# A shell starts what runs in the background with SIGINT ignored, which the programs that the tests start would inherit.
signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).parents[1]
SAMPLES = ROOT / "sample_meshes"

# Where programs of this environment and of the system are.
BINARIES = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
MPIEXEC = shutil.which("mpiexec", path=BINARIES)
needs_mpi = pytest.mark.skipif(
    MPIEXEC is None or find_spec("mpi4py") is None, reason="there is no MPI: pip install 'meshfix-cli[mpi]' mpich"
)


@pytest.fixture(scope="session")
def plate() -> Mesh:
    """332 triangles, valid."""
    return Mesh.build(*generate.plate(0.18))


@pytest.fixture(scope="session")
def bracket() -> Mesh:
    """7,968 tetrahedra, valid; two blocks."""
    return Mesh.build(*generate.bracket(0.18, 8))


@pytest.fixture(scope="session")
def fine() -> Mesh:
    """About 75,000 tetrahedra in many blocks and several colours, valid."""
    return Mesh.build(*generate.bracket(0.06, 10))


@pytest.fixture(params=["plate", "bracket"])
def mesh(request: pytest.FixtureRequest) -> Mesh:
    """A valid mesh of each dimension."""
    value: Mesh = request.getfixturevalue(request.param)
    return value


def tangle(mesh: Mesh, percent: float = 25, distance: float = 2, seed: int = 0) -> Mesh:
    """The paper's protocol; the distance in mean edge lengths."""
    return perturb(mesh, percent, distance * mesh.mean_edge_length(), seed)[0]


def star_rows(mesh: Mesh, vertex: int) -> tuple[NDArray[np.int32], NDArray[np.uint16], NDArray[np.int32]]:
    """Neighbours (k,), faces (n, d) as positions among them, and simplices (n,) of a vertex."""
    stars, d = mesh.topology.stars(), mesh.dimension
    here = int(np.flatnonzero(stars.vertices == vertex)[0])
    first, last = stars.offsets[here], stars.offsets[here + 1]
    row = stars.neighbours[stars.neighbour_offsets[here] : stars.neighbour_offsets[here + 1]]
    faces = np.ascontiguousarray(stars.faces.reshape(-1, d)[first:last])
    return stars.vertices[row], faces, stars.rows[stars.corners[first:last] // (d + 1)]


def star_of(mesh: Mesh, vertex: int) -> tuple[NDArray[np.float64], NDArray[np.uint16]]:
    """Neighbours (k, d) around the origin and faces (n, d) of a vertex, as the kernels take them."""
    row, faces, _ = star_rows(mesh, vertex)
    points = mesh.points[row] - mesh.points[row].mean(axis=0)
    return points / np.abs(points).max(), faces


def random_star(
    random: np.random.Generator, d: int, spread: float = 0.3
) -> tuple[NDArray[np.float64], NDArray[np.uint16]]:
    """A closed star: the hull of points on a sphere, then moved; with a large spread it is tangled."""
    from scipy.spatial import ConvexHull

    directions = random.standard_normal((int(random.integers(d + 2, 16)), d))
    points = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    inward = np.linalg.det(points[faces]) < 0
    faces[inward] = faces[inward][:, [1, 0, *range(2, d)]]
    moved = points * random.uniform(1 - spread, 1 + spread, (len(points), 1))
    moved += spread * random.standard_normal(points.shape)
    return np.ascontiguousarray(moved / np.abs(moved).max()), faces.astype(np.uint16)


@pytest.fixture
def random() -> np.random.Generator:
    """The same numbers in every run."""
    return np.random.default_rng(20261122)
