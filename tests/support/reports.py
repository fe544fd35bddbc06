"""Reports on meshes of elements of every type, as the commands make them of files."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from elements import MESHES, tangles
from places import SAMPLES

from meshfix_cli import read
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.meshfile.document import Document
from meshfix_cli.repair.judge import Judge
from meshfix_cli.report.facts import Report

FIRST = 1000  # the file's number of the first element


@cache
def built(name: str) -> Mesh:
    """A mesh of `elements.MESHES`."""
    return Mesh.build(*MESHES[name]())


@cache
def tangled(name: str, way: str = "P=25 D=2h") -> Mesh:
    """The same with many inverted elements."""
    mesh = built(name)
    return mesh.with_points(tangles(name, mesh.points, mesh.movable, mesh.mean_edge_length())[way])


def document_of(mesh: Mesh) -> Document:
    """A document that holds a mesh."""
    document = read(SAMPLES / ("plate.vtk" if mesh.dimension == 2 else "bracket.vtk"))
    return replace(
        document, name="mesh", mesh=mesh, ids=FIRST + np.arange(mesh.topology.m), holds={}, notes=(), basis=None,
        source=replace(document.source, points=mesh.points),
    )  # fmt: skip


def report_on(*meshes: Mesh, command: str = "quality", judge: Judge | None = None) -> Report:
    """A report whose stages are the same mesh at several positions."""
    stages = {"mesh": meshes[0]} if len(meshes) == 1 else dict(zip(("before", "smoothed"), meshes, strict=True))
    return (judge or Judge()).report(command, document_of(meshes[0]), stages)
