"""Meshes for the tests, made by the project's own generator, and what their programs need."""

from __future__ import annotations

import signal

import generate
import numpy as np
import pytest

from meshfix_cli.mesh.mesh import Mesh

# Before they are imported: their assertions say what they compared.
pytest.register_assert_rewrite("commands", "meshes", "programs", "splicing")

# A shell starts what runs in the background with SIGINT ignored, and nohup with SIGHUP, which the programs that the
# tests start would inherit.
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


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


@pytest.fixture
def random() -> np.random.Generator:
    """The same numbers in every run."""
    return np.random.default_rng(20261122)
