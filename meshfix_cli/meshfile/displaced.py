"""A mesh whose boundary has moved, and the same before that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError, listed, naming
from meshfix_cli.mesh.reference import reference_points
from meshfix_cli.meshfile.document import Document
from meshfix_cli.meshfile.plane import is_level

OUT_OF_PLANE = 1e-6  # of a mean edge, by which points may leave the plane of a mesh


def displaced(document: Document, name: str) -> Document:
    """Return a document in which each point has moved by a vector of its own, an array of point data.

    Raises
    ------
    ReadError
        There is no such array, or it moves a plane mesh out of its plane.
    InvalidMeshError
        A coordinate is too large for the numbers of the file.
    """
    with naming(document.name):
        original, mesh = document.source.points, document.mesh
        vectors = _vectors(document, name)[:, : original.shape[1]]
        if not np.isfinite(vectors[mesh.used]).all():
            raise ReadError(f"{name} has vectors that are not finite")
        if document.basis is not None:
            out = (vectors - vectors @ document.basis.T @ document.basis)[mesh.used]
            if np.abs(out).max() > OUT_OF_PLANE * mesh.mean_edge_length():
                raise ReadError(f"{name} moves points out of the plane of the mesh")
        points = document.source.rounded((original + vectors).astype(original.dtype))
        return replace(document, mesh=document.in_plane(points.astype(np.float64), mesh), displaced=points)


def _vectors(document: Document, name: str) -> NDArray[np.float64]:
    """Return the vectors (n, 2 or 3) of an array; in a plane of constant z two components are enough."""
    arrays, original = document.source.arrays.point, document.source.points
    if name not in arrays:
        known = listed(sorted(key for key, values in arrays.items() if np.ndim(values) == 2)) or "none"
        raise ReadError(f"there is no point data named {name!r} (vectors: {known})")
    vectors = np.asarray(arrays[name])
    columns = vectors.shape[1] if vectors.ndim == 2 else 1
    least = 2 if document.basis is not None and is_level(document.basis) else original.shape[1]
    if not least <= columns <= 3 or vectors.dtype.kind not in "fiu" or len(vectors) != len(original):
        needed = f"{'2 or ' * (least == 2)}3 numbers for each point"
        raise ReadError(f"the point data {name!r} are no vectors, {needed}: there are {columns}")
    missing = np.zeros((len(vectors), max(original.shape[1] - columns, 0)))
    return np.column_stack([vectors, missing]).astype(np.float64)


def places_in(reference: Document, document: Document, threads: int = 1) -> NDArray[np.float64]:
    """Return where the vertices of a mesh were, (k, d) as `untangle.steps` takes them.

    Raises
    ------
    InvalidMeshError
        See `reference_points`.
    """
    places = reference.source.points.astype("f8") if document.mesh.surface is not None else None
    points = reference_points(document.mesh, reference.mesh, threads, places)
    alike = reference.seen_from(document)
    return points if alike is None else document.mesh.along_curve(alike)
