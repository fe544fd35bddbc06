"""The table of metrics. Light to import: the command line offers the names.

`simplices.py` has a function of its name for each, and `corners.py` for other types.

Source of all but the sine: Stimpson, Ernst, Knupp, Pebay, Thompson, "The Verdict Geometric Quality Library",
SAND2007-1751, and for pyramids and wedges its successor in VTK. An ideal element has 1, but for the first two.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from meshfix_cli.mesh.elements import JUDGED

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh

_ALL = tuple(element.key for element in JUDGED)

# Pyramids, wedges and hexahedra have faces of four nodes, which are curved as a rule: there is no one angle between
# them, and no sphere touches them all. Verdict has none of these metrics for them either.
_FLAT = ("triangle", "quad", "tetra")


@dataclass(frozen=True)
class Metric:
    """A measure of the shape of one element.

    Attributes
    ----------
    worst : {"min", "max"}
        Which end of its range is bad.
    elements : tuple of str
        Keys of the types that have it.
    """

    worst: Literal["min", "max"]
    elements: tuple[str, ...] = _ALL


# What the report prints of every mesh: fields of `summary.Summary`, which a requirement can name beside the metrics.
NUMBERS = (
    "elements", "inverted", "folded", "min_measure", "min_angle", "max_angle", "mean_min_angle", "percentile_1",
)  # fmt: skip
ANGLES = NUMBERS[4:]  # of these, those of elements that have angles

METRICS = {
    "min_angle": Metric("min", _FLAT),  # degrees, without sign; dihedral for tetrahedra
    "min_sine": Metric("min", _FLAT),  # equation (3.2), with the sign of the measure
    "aspect_ratio": Metric("max", _FLAT),  # longest edge / inradius
    "scaled_jacobian": Metric("min"),  # Jacobian / edges at the worst corner
    "shape": Metric("min"),  # Jacobian / mean square of the edges, at the worst corner; 0 where inverted
    "mean_ratio": Metric("min"),  # what the shape is called for simplices; the same for all
    "radius_ratio": Metric("max", _FLAT),  # circumradius / (d inradius)
}


def types_with(name: str) -> tuple[str, ...]:
    """Return the keys of the types that have a metric, or one of `NUMBERS`."""
    if name in ANGLES:
        return _FLAT
    return METRICS[name].elements if name in METRICS else _ALL


def having(name: str, mesh: Mesh) -> int:
    """Return how many elements have a metric, or one of `NUMBERS`."""
    topology, types = mesh.topology, types_with(name)
    if topology.simplicial:
        return topology.m if topology.element.key in types else 0
    return sum(len(block.rows) for block in topology.blocks if block.element.key in types)
