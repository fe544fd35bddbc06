"""The options of the command line as keywords: what they may be, and what they make."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypedDict

from meshfix_cli.errors import OptionError
from meshfix_cli.quality.metrics import METRICS
from meshfix_cli.quality.requirement import Requirement
from meshfix_cli.repair import CURVINGS, SLIDES, Curving, Held, Judge, Method, Sliding
from meshfix_cli.solve.perturb import Distance
from meshfix_cli.solve.strategies import STRATEGIES, Smooth

Length = float | str | Distance
Names = str | Sequence[str]


class Solving(TypedDict, total=False):
    """How a mesh is solved, beside the strategy; see `repair.Method`."""

    sweeps: int | None
    smooth: Smooth
    threshold: float | None
    max_move: Length | None
    only_invalid: bool
    slide: Sliding
    slide_interfaces: bool
    feature_angle: float
    max_deviation: Length
    curving: Curving


class Holding(TypedDict, total=False):
    """What is held still, see `repair.Held`; and how many threads do the work."""

    fix: Names
    regions: str | None
    join_points: bool
    threads: int


class Options(Solving, Holding, total=False):
    """What `untangle` takes beside a mesh, a strategy and a reference."""

    displace: str | None
    require: Names
    metrics: Names


class Perturbing(Holding, total=False):
    """What `perturb` takes beside what the paper has."""

    slide: Sliding


OF_DOCUMENTS = ("slide", "slide_interfaces", "feature_angle", "max_deviation", "curving")


def method_of(options: Mapping[str, Any]) -> Method:
    """Return how a mesh is solved.

    Raises
    ------
    OptionError
        There is no such option, or it cannot have this value.
    """
    for name in options:
        if name not in _READ:
            raise OptionError(f"there is no option {name!r}; there are {', '.join(_READ)}")
    return Method(**{name: _READ[name](name, value) for name, value in options.items()})


def held_of(fix: Names, regions: str | None, join_points: bool) -> Held:
    """Return what is held still."""
    return Held(_names(fix), regions, join_points)


def judge_of(metrics: Names, require: Names, threads: int) -> Judge:
    """Return what is found out about a result."""
    for name in _names(metrics):
        _one_of(METRICS)("metrics", name)
    try:
        required = tuple(Requirement.parse(text) for text in _names(require))
    except ValueError as error:
        raise OptionError(f"require: {error}") from error
    return Judge(_names(metrics), required, threads)


def length_of(name: str, value: object) -> Distance:
    """Return a length: a number in model units, or a text such as "2h"."""
    try:
        return value if isinstance(value, Distance) else Distance.parse(str(value))
    except ValueError as error:
        raise OptionError(
            f"{name} is neither a length such as 0.3 nor in mean edge lengths such as '2h': {value!r}"
        ) from error


def _names(names: Names) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else tuple(names)


def _one_of(known: Iterable[str]) -> Callable[[str, Any], Any]:
    names = list(known)

    def check(name: str, value: Any) -> Any:
        if value not in names:
            raise OptionError(f"{name} is one of {', '.join(names)}, and not {value!r}")
        return value

    return check


def _within(first: float, last: float, whole: bool = False, none: bool = False, words: Sequence[str] = ()) -> Any:
    """Return what checks a number; `none`: it may be None; `words`: what else it may be."""

    def check(name: str, value: Any) -> Any:
        if (none and value is None) or (isinstance(value, str) and value in words):
            return value
        number = isinstance(value, int) or (not whole and isinstance(value, float))
        if isinstance(value, bool) or not number or not first <= value <= last:
            kind = "a whole number" if whole else "a number"
            others = "".join(f", or {word!r}" for word in words)
            raise OptionError(f"{name} is {kind} from {first:g} to {last:g}{others}, and not {value!r}")
        return value

    return check


def _flag(name: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise OptionError(f"{name} is True or False, and not {value!r}")
    return value


_READ: dict[str, Callable[[str, Any], Any]] = {
    "strategy": _one_of(STRATEGIES),
    "sweeps": _within(0, 1e9, whole=True, none=True),
    "smooth": _within(0, 1e6, whole=True, words=("auto", "best")),
    "threshold": _within(0, 90, none=True),
    "max_move": lambda name, value: None if value is None else length_of(name, value),
    "only_invalid": _flag,
    "slide": _one_of(SLIDES),
    "slide_interfaces": _flag,
    "feature_angle": _within(0, 180),
    "max_deviation": length_of,
    "curving": _one_of(CURVINGS),
}
