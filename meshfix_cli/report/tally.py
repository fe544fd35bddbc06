"""What is kept and counted of the results of a batch."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

# What can become of a file of a batch, and how it is told.
STATUSES = {"valid": "valid", "invalid": "NOT VALID", "failed": "failed", "skipped": "skipped"}


@dataclass
class Tally:
    """The results of a batch, see `batch.Task.result`, counted as they come.

    Attributes
    ----------
    statuses : Counter
    elements : int
        Of the meshes that were read.
    inverted : [int, int]
        Before and after; files that were skipped count only after.
    angle, jacobian : [float, float]
        The worst of the smallest angles, degrees, and of the smallest scaled Jacobians: infinite where there are none.
    """

    statuses: Counter[str] = field(default_factory=Counter)
    elements: int = 0
    inverted: list[int] = field(default_factory=lambda: [0, 0])
    angle: list[float] = field(default_factory=lambda: [math.inf, math.inf])
    jacobian: list[float] = field(default_factory=lambda: [math.inf, math.inf])

    def add(self, result: Mapping[str, Any]) -> None:
        """Count one more."""
        self.statuses[result["status"]] += 1
        self.elements += result.get("elements", 0)
        for i, summary in enumerate(before_and_after(result)):
            if summary is not None:
                self.inverted[i] += summary["inverted"]
                if summary["min_angle"] is not None:
                    self.angle[i] = min(self.angle[i], summary["min_angle"])
                if "scaled_jacobian" in summary:
                    self.jacobian[i] = min(self.jacobian[i], summary["scaled_jacobian"]["smallest"])

    def rows(self) -> list[tuple[str, list[str]]]:
        """Return the rows of a table with a column before and one after."""
        angles = [f"{angle:.3f}" if math.isfinite(angle) else "" for angle in self.angle]
        jacobians = [f"{value:.3f}" if math.isfinite(value) else "" for value in self.jacobian]
        rows = [
            ("files", ["", f"{self.statuses.total():,}"]),
            *((label, ["", f"{self.statuses[status]:,}"]) for status, label in STATUSES.items()),
            ("elements", ["", f"{self.elements:,}"]),
            ("inverted elements", [f"{count:,}" for count in self.inverted]),
            ("smallest angle of all [°]", angles),
        ]
        if any(jacobians):
            rows.append(("smallest scaled Jacobian of all", jacobians))
        return rows


def before_and_after(result: Mapping[str, Any]) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
    """Return the first and the last summary of a result; what is not known is None."""
    stages: dict[str, dict[str, Any]] = result.get("quality", {})
    return stages.get("before"), next(reversed(stages.values()), None)


def smallest(summary: Mapping[str, Any]) -> str:
    """Return the smallest angle or, where elements are not all simplices, scaled Jacobian."""
    if "scaled_jacobian" in summary:
        return f"{summary['scaled_jacobian']['smallest']:.3f}"
    return f"{summary['min_angle']:.3f}°"


def why(result: Mapping[str, Any]) -> str:
    """Return why a file has failed, without its name."""
    return str(result["error"]).removeprefix(f"{result['file']}: ")


def kept(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the report on a batch keeps of a result."""
    names = (
        "file", "output", "status", "error", "seconds", "dimension", "elements", "vertices", "valid", "requirements",
        "notes",
    )  # fmt: skip
    before, after = before_and_after(result)
    return {**{name: result.get(name) for name in names}, "before": before, "after": after}
