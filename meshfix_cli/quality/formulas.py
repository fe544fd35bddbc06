"""The values of the metrics: by the formulas of `simplices.py`, and of `corners.py` for all other types."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import Element
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality import corners, simplices
from meshfix_cli.quality.metrics import METRICS

Array = NDArray[np.float64]
AT_ONCE = 16384  # elements: what is computed of so many stays in the caches, and takes little memory


def evaluate(name: str, mesh: Mesh) -> Array:
    """Return the values of a metric for all elements.

    Parameters
    ----------
    name : str
        A key of `METRICS`.
    mesh : Mesh

    Returns
    -------
    (m,) float64
        See `evaluate_at`; nan for elements of types that do not have it. Those of surfaces are seen in planes.
    """
    if mesh.surface is not None:
        mesh = mesh.unfolded()
    values = np.full(mesh.topology.m, np.nan)
    for block in mesh.topology.blocks:
        if block.element.key not in METRICS[name].elements:
            continue
        for start in range(0, len(block.rows), AT_ONCE):
            some = slice(start, start + AT_ONCE)
            values[block.rows[some]] = evaluate_at(name, block.element, mesh.points[block.vertices[some]])
    return values


def evaluate_at(name: str, element: Element, nodes: Array) -> Array:
    """Return the values of a metric for elements of a type that has it.

    Parameters
    ----------
    name : str
        A key of `METRICS`.
    element : Element
    nodes : (k, nodes, d) float64
        Where the nodes of each element are, in positive order.

    Returns
    -------
    (k,) float64
        Where nothing is left of an element, and the formula is 0 / 0, the worst value that there is.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        if element.judged_by == "determinant":
            measure = kernels.measure(*simplices.numbered(nodes), 1)[0]
            values = getattr(simplices, name)(nodes[:, 1:] - nodes[:, :1], measure)
        else:
            values = getattr(corners, name)(element, nodes)
    return np.where(np.isnan(values), 0.0 if METRICS[name].worst == "min" else np.inf, values)


def worst_and_mean(name: str, mesh: Mesh) -> tuple[float, float]:
    """Return the worst and the mean value of a metric among the elements that have it; nan, where none has."""
    values = evaluate(name, mesh)
    values = values[~np.isnan(values)]
    if not len(values):
        return np.nan, np.nan
    return float(values.min() if METRICS[name].worst == "min" else values.max()), float(values.mean())
