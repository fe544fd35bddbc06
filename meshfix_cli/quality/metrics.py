"""The table of metrics; `formulas.py` has a function for each. Light to import: the command line offers the names.

Source of all but the sine: Stimpson, Ernst, Knupp, Pebay, Thompson, "The Verdict Geometric Quality Library",
SAND2007-1751. A regular simplex has 1, but for the first two.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Metric:
    """A measure of the shape of one element.

    Attributes
    ----------
    worst : {"min", "max"}
        Which end of its range is bad.
    """

    worst: Literal["min", "max"]


# What the report prints of every mesh: fields of `summary.Summary`, which a requirement can name beside the metrics.
NUMBERS = (
    "elements", "inverted", "folded", "min_measure", "min_angle", "max_angle", "mean_min_angle", "percentile_1",
)  # fmt: skip

METRICS = {
    "min_angle": Metric("min"),  # degrees, without sign; dihedral for tetrahedra
    "min_sine": Metric("min"),  # equation (3.2), with the sign of the measure
    "aspect_ratio": Metric("max"),  # longest edge / inradius
    "scaled_jacobian": Metric("min"),  # Jacobian / edges at the worst corner
    "mean_ratio": Metric("min"),  # Verdict's shape; 0 where inverted
    "radius_ratio": Metric("max"),  # circumradius / (d inradius)
}
