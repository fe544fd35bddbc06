"""What a user asks of a mesh."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable
from dataclasses import dataclass

from meshfix_cli.quality.metrics import METRICS, NUMBERS
from meshfix_cli.quality.summary import Summary

RELATIONS: dict[str, Callable[[float, float], bool]] = {
    ">=": operator.ge, "<=": operator.le, "==": operator.eq, ">": operator.gt, "<": operator.lt,
}  # fmt: skip


@dataclass(frozen=True)
class Requirement:
    """A condition on the summary of a mesh, such as `min_angle >= 5`.

    Attributes
    ----------
    name : str
        One of `NUMBERS`, or a key of `METRICS`, of which the worst value counts.
    relation : str
        A key of `RELATIONS`.
    bound : float
    """

    name: str
    relation: str
    bound: float

    @classmethod
    def parse(cls, text: str) -> Requirement:
        """Read `NAME RELATION NUMBER`; ValueError, in one sentence, for anything else."""
        match = re.fullmatch(r"\s*(\w+)\s*(>=|<=|==|>|<)\s*(\S+)\s*", text)
        if match is None:
            raise ValueError(f"{text!r} is not a condition such as 'min_angle >= 5'")
        name, relation, bound = match.groups()
        if name not in NUMBERS and name not in METRICS:
            raise ValueError(f"{name!r} is none of {', '.join(dict.fromkeys((*NUMBERS, *METRICS)))}")
        try:
            number = float(bound)
        except ValueError:
            number = float("nan")
        if number != number:
            raise ValueError(f"{bound!r} is not a number")
        return cls(name, relation, number)

    @property
    def is_metric(self) -> bool:
        """Whether it is a metric that `summarise` must be asked for."""
        return self.name not in NUMBERS

    def value(self, summary: Summary) -> float:
        """Return the number that is compared."""
        return float(summary.metrics[self.name][0] if self.is_metric else getattr(summary, self.name))

    def holds(self, summary: Summary) -> bool:
        """Whether a mesh meets it."""
        return bool(RELATIONS[self.relation](self.value(summary), self.bound))

    def __str__(self) -> str:
        return f"{self.name} {self.relation} {self.bound:g}"
