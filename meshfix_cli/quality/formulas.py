"""The values of the metrics: by the formulas of `simplices.py`, and of `corners.py` for all other types."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import Element
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality import corners, simplices
from meshfix_cli.quality.metrics import METRICS

if TYPE_CHECKING:
    from meshfix_cli.mesh.quadratic import Judgement

Array = NDArray[np.float64]
AT_ONCE = 16384  # elements: what is computed of so many stays in the caches, and takes little memory


def evaluate(name: str, mesh: Mesh, threads: int = 1, judgement: Judgement | None = None) -> Array:
    """Return the values of a metric for all elements.

    Parameters
    ----------
    name : str
        A key of `METRICS`.
    mesh : Mesh
    threads : int
    judgement : Judgement, optional
        Of its `quadratic` elements, where that is known.

    Returns
    -------
    (m,) float64
        See `evaluate_at`; nan for elements of types that do not have the metric. The scaled Jacobians of elements that
        may be curved are the smallest at their nodes, see `Judgement`; all else is of the straight ones. Those of
        surfaces are seen in planes.
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
    if mesh.quadratic is not None and name == "scaled_jacobian":
        judgement = judgement or mesh.quadratic.judge(mesh.points, threads)
        values[mesh.quadratic.rows] = judgement.scaled_jacobians
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


def worst_and_mean(name: str, mesh: Mesh, threads: int = 1, judgement: Judgement | None = None) -> tuple[float, float]:
    """Return the worst and the mean value of a metric among the elements that have it; nan, where none has."""
    values = evaluate(name, mesh, threads, judgement)
    values = values[~np.isnan(values)]
    if not len(values):
        return np.nan, np.nan
    return float(values.min() if METRICS[name].worst == "min" else values.max()), float(values.mean())
