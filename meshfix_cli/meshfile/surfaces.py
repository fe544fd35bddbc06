"""What of a file keeps the shape of a surface: which elements, lines and vertices end its patches."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.mesh import BETWEEN, ON_BOUNDARY
from meshfix_cli.mesh.sides import Kept
from meshfix_cli.mesh.surface import laid_out
from meshfix_cli.meshfile.document import CROWDED, ON_CELLS, Document
from meshfix_cli.meshfile.sliding import CellsBeside, joint, twins

if TYPE_CHECKING:
    from meshfix_cli.mesh.curved import Smooth
    from meshfix_cli.mesh.mesh import Mesh

ON_FEATURES = "on features"


def on_surface(
    document: Document,
    smooth: Smooth,
    slide: Literal["none", "flat", "curved"] = "none",
    interfaces: bool = True,
    reference: NDArray[np.float64] | None = None,
    threads: int = 1,
    with_shape: bool = True,
) -> Document:
    """Return a document of a surface whose vertices slide on it; see `surface.laid_out`.

    Parameters
    ----------
    document : Document
    smooth : Smooth
        See `surface.Kept`.
    slide : {"none", "flat", "curved"}
        As well.
    interfaces : bool
        Whether that holds for the curves between regions as well.
    reference : (k, d) float64, optional
    threads : int
    with_shape : bool
        See `laid_out`.
    """
    mesh, topology = document.mesh, document.mesh.topology
    labels = joint(topology.m, *document.regions) if document.regions else np.zeros(topology.m, dtype=np.int64)
    cells = CellsBeside(document, np.empty((0, 2), dtype=np.int32))
    held = cells.held | twins(document)
    for reason, mask in document.holds.items():
        if reason in (ON_BOUNDARY, CROWDED, ON_CELLS) or (interfaces and reason.startswith(BETWEEN)):
            continue
        held |= mask
    kept = Kept(labels[topology.connectivity.rows], cells.lines, mesh.along_curve(held), smooth, slide)
    return laid_as(document, laid_out(mesh, kept, reference, threads, with_shape=with_shape))


def laid_as(document: Document, mesh: Mesh) -> Document:
    """Return a document whose vertices slide as they do in a mesh of the same surface."""
    laid = replace(document.mesh, freedom=mesh.freedom, movable=mesh.movable, surface=mesh.surface)
    on_features = mesh.topology.used & ~mesh.movable
    return replace(document, mesh=laid, holds={**document.holds, ON_FEATURES: on_features})
