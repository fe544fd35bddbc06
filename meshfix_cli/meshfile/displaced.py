"""A mesh whose boundary has moved, and the same before that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.errors import ReadError, listed, naming
from meshfix_cli.mesh.reference import reference_points
from meshfix_cli.meshfile.document import Document

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
        arrays, original, mesh = document.source.arrays.point, document.source.points, document.mesh
        vectors = np.asarray(arrays.get(name, ()))
        fits = vectors.ndim == 2 and len(vectors) == len(original) and original.shape[1] <= vectors.shape[1] <= 3
        if not fits or vectors.dtype.kind not in "fiu":
            known = listed(sorted(key for key, values in arrays.items() if np.ndim(values) == 2)) or "none"
            raise ReadError(f"there is no vector for each point named {name!r} (found: {known})")
        vectors = vectors[:, : original.shape[1]].astype(np.float64)
        if not np.isfinite(vectors[mesh.used]).all():
            raise ReadError(f"{name} has vectors that are not finite")
        if document.basis is not None:
            out = (vectors - vectors @ document.basis.T @ document.basis)[mesh.used]
            if np.abs(out).max() > OUT_OF_PLANE * mesh.mean_edge_length():
                raise ReadError(f"{name} moves points out of the plane of the mesh")
        points = document.source.rounded((original + vectors).astype(original.dtype))
        return replace(document, mesh=document.in_plane(points.astype(np.float64), mesh), displaced=points)


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
