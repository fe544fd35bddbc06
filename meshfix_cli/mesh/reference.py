"""The mesh as it was before its boundary moved: where its vertices were."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.mesh.mesh import Mesh


def reference_points(mesh: Mesh, reference: Mesh, threads: int = 1) -> NDArray[np.float64]:
    """Return the positions of a valid mesh that has the same elements with the same numbers.

    Returns
    -------
    (k, d) float64
        In the order of the connectivity of `mesh`.

    Raises
    ------
    InvalidMeshError
        The numbers of points or elements differ, an element has other vertices, or one of the reference is inverted.
    """
    shape = mesh.topology.element.shape
    ours, theirs = _counts(mesh), _counts(reference)
    if ours != theirs:
        raise InvalidMeshError(f"it has {theirs}, and the mesh {ours}")
    same = np.sort(mesh.topology.simplices, axis=1) == np.sort(reference.topology.simplices, axis=1)
    if not same.all():
        row = int(np.argmin(same.all(axis=1)))
        here, there = (sorted(one.topology.simplices[row].tolist()) for one in (mesh, reference))
        raise InvalidMeshError(f"its {shape.name} {row} has the vertices {there}, and that of the mesh {here}")
    inverted = reference.check(threads)[0]
    if inverted:
        raise InvalidMeshError(f"{counted(inverted, f'{shape.name} of it is', f'{shape.plural} of it are')} inverted")
    return mesh.along_curve(reference.points)


def _counts(mesh: Mesh) -> str:
    shape = mesh.topology.element.shape
    return f"{counted(len(mesh.points), 'point', 'points')} and {counted(mesh.topology.m, shape.name, shape.plural)}"
