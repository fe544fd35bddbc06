"""The options of the command line as keywords: what they may be, and what they make."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from functools import partial
from numbers import Integral, Real
from typing import Any, TypedDict

from numpy.typing import ArrayLike

from meshfix_cli.errors import OptionError
from meshfix_cli.quality.metrics import METRICS
from meshfix_cli.quality.requirement import Requirement
from meshfix_cli.repair import CURVINGS, SLIDES, Curving, Held, Method, Sliding
from meshfix_cli.repair.judge import Judge
from meshfix_cli.solve.perturb import Distance
from meshfix_cli.solve.strategies import RANGES, STRATEGIES, Smooth, senseless_beside_reference

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
    fixed: ArrayLike | None
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
    feature_angle: float


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
            known = sorted({*_READ, *Options.__annotations__, "reference"})
            near = get_close_matches(name, known, 1)
            told = f": did you mean {near[0]!r}?" if near else f"; there are {', '.join(known)}"
            raise OptionError(f"there is no option {name!r}{told}")
    return Method(**{name: _READ[name](name, value) for name, value in options.items()})


def check_reference(given: str, method: Method) -> None:
    """Refuse what makes no sense with a reference, which an option gives."""
    for other in senseless_beside_reference(method.only_invalid, method.threshold):
        raise OptionError(f"{given} and {other} exclude each other")


def held_of(fix: Names, regions: str | None, join_points: bool) -> Held:
    """Return what is held still."""
    return Held(_names("fix", fix), array_of("regions", regions), _flag("join_points", join_points))


def array_of(option: str, name: str | None) -> str | None:
    """Return the name of an array."""
    if name is not None and not isinstance(name, str):
        raise OptionError(f"{option} is the name of an array, and not the array itself or anything else")
    return name


def judge_of(metrics: Names, require: Names, threads: int) -> Judge:
    """Return what is found out about a result."""
    asked = _names("metrics", metrics)
    for name in asked:
        _one_of(METRICS)("metrics", name)
    try:
        required = tuple(Requirement.parse(text) for text in _names("require", require))
    except ValueError as error:
        raise OptionError(f"require: {error}") from error
    return Judge(asked, required, threads)


def length_of(name: str, value: object) -> Distance:
    """Return a length: a number in model units, or a text such as "2h"."""
    try:
        return value if isinstance(value, Distance) else Distance.parse(str(value))
    except ValueError as error:
        raise OptionError(
            f"{name} is neither a length such as 0.3 nor in mean edge lengths such as '2h': {value!r}"
        ) from error


def _names(option: str, names: Names) -> tuple[str, ...]:
    several = [names] if isinstance(names, str) else names
    if not isinstance(several, Sequence) or not all(isinstance(name, str) for name in several):
        hint = ", which `fixed` takes" * (option == "fix")
        raise OptionError(f"{option} is a text, or several, and no numbers{hint}")
    return tuple(several)


def _one_of(known: Iterable[str]) -> Callable[[str, Any], Any]:
    names = list(known)

    def check(name: str, value: Any) -> Any:
        if not isinstance(value, str):  # as in untangle(points, cells)
            told = f"and no {type(value).__name__}; points and cells are one argument, a pair"
            raise OptionError(f"{name} is one of {', '.join(names)}, {told}")
        if value not in names:
            raise OptionError(f"{name} is one of {', '.join(names)}, and not {value!r}")
        return value

    return check


def _within(whole: bool = False, none: bool = False, words: Sequence[str] = ()) -> Any:
    """Return what checks a number; `none`: it may be None; `words`: what else it may be."""

    def check(name: str, value: Any) -> Any:
        if (none and value is None) or (isinstance(value, str) and value in words):
            return value
        first, last = RANGES[name]
        number = isinstance(value, Integral if whole else Real) and not isinstance(value, bool)
        if not number or not first <= value <= (math.inf if last is None else last):
            kind, end = "a whole number" if whole else "a number", "on" if last is None else f"to {last:,}"
            others = "".join(f", or {word!r}" for word in words)
            raise OptionError(f"{name} is {kind} from {first} {end}{others}, and not {value!r}")
        return int(value) if whole else float(value)

    return check


def _flag(name: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise OptionError(f"{name} is True or False, and not {value!r}")
    return value


# The numbers that are no part of a `Method`.
percent_of, seed_of, threads_of = (
    partial(_within(whole), name) for name, whole in (("percent", False), ("seed", True), ("threads", True))
)

_READ: dict[str, Callable[[str, Any], Any]] = {
    "strategy": _one_of(STRATEGIES),
    "sweeps": _within(whole=True, none=True),
    "smooth": _within(whole=True, words=("auto", "best")),
    "threshold": _within(none=True),
    "max_move": lambda name, value: None if value is None else length_of(name, value),
    "only_invalid": _flag,
    "slide": _one_of(SLIDES),
    "slide_interfaces": _flag,
    "feature_angle": _within(),
    "max_deviation": length_of,
    "curving": _one_of(CURVINGS),
}
