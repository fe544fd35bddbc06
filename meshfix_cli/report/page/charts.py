"""Histograms and convergence as inline SVG; colours come from the page's style sheet."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import escape

from meshfix_cli.report.facts import Binned
from meshfix_cli.report.figures import Convergence

WIDTH, HEIGHT = 340, 250
LEFT, RIGHT, TOP, BOTTOM = 48, 330, 28, 208
MOST_MARKERS = 60  # sweeps: with more, a line is clearer
MOST_DECADES = 6  # that are labelled

_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def histogram(counts: Mapping[str, Sequence[int]], binned: Binned) -> str:
    """Return the histogram of one stage or two: the last in bars, one before as an outline.

    Parameters
    ----------
    counts : mapping
        Of each stage.
    binned : Binned
        What is counted.
    """
    names, bins = list(counts), len(next(iter(counts.values())))
    largest = max(map(max, counts.values()))
    step = _round_step(largest)
    top = math.ceil(largest / step) * step
    width = (RIGHT - LEFT) / bins

    def y(count: float) -> float:
        return BOTTOM - (BOTTOM - TOP) * count / top

    bars = "".join(
        f'<rect class="after bars" x="{LEFT + i * width + 0.5:.1f}" y="{y(count):.1f}" width="{width - 1:.1f}" '
        f'height="{BOTTOM - y(count):.1f}"/>'
        for i, count in enumerate(counts[names[-1]])
    )
    outline = ""
    if len(names) > 1:
        steps = "".join(f"V{y(count):.1f}H{LEFT + (i + 1) * width:.1f}" for i, count in enumerate(counts[names[0]]))
        outline = f'<path class="before" d="M{LEFT},{BOTTOM}{steps}V{BOTTOM}"/>'
    ticks = [(y(value), f"{value:,.0f}") for value in _multiples(step, top)]
    values = [(LEFT + i * width, f"{i * binned.width:g}") for i in range(0, bins + 1, max(3, bins // 5))]
    keys = [("after", names[-1])] + ([("before", names[0])] if len(names) > 1 else [])
    body = _rows(ticks) + bars + outline + _columns(values, binned.label) + _keys(keys)
    words = f"Number of elements by their {binned.long_name}: " + "; ".join(
        f"{name}, {', '.join(map(str, one))}" for name, one in counts.items()
    )
    return _svg("histogram", binned.heading, words, body)


def inverted(convergence: Convergence) -> str:
    """Return the number of inverted elements after each sweep, on a logarithmic axis that begins with 0."""
    counts, x = convergence.inverted, _sweeps(len(convergence.inverted))
    decades = max(1, math.ceil(math.log10(max(max(counts), 1))))
    height = (BOTTOM - TOP) / (decades + 0.6)

    def y(count: int) -> float:
        return BOTTOM - height * (0.6 + math.log10(count)) if count else float(BOTTOM)

    series = [(x(i), y(count)) for i, count in enumerate(counts)]
    ticks = [(y(0), "0")] + [(y(10**k), f"{10**k:,}") for k in range(decades + 1)]
    body = _smoothing(convergence, x) + _rows(ticks) + _columns(_numbers(len(counts), x), "sweeps")
    body += f'<path class="before series" d="{_path(series)}"/>' + _markers(series, "before")
    words = f"Inverted elements after each sweep: {_first_and_last(counts)}"
    return _svg("inverted", "Inverted elements", words, body)


def measures(convergence: Convergence, measure: str) -> str:
    """Return the size of the smallest area or volume after each sweep, logarithmic; negative ones have a colour."""
    values, x = convergence.measures, _sweeps(len(convergence.measures))
    sizes = [abs(value) for value in values if value] or [1.0]
    low, high = math.floor(math.log10(min(sizes))), math.ceil(math.log10(max(sizes)))
    step = max(1, -(-(high - low) // MOST_DECADES))
    high = low + step * max(1, -(-(high - low) // step))

    def y(value: float) -> float:
        return BOTTOM - (BOTTOM - TOP) * (math.log10(abs(value)) - low) / (high - low)

    body = _smoothing(convergence, x)
    body += _rows((y(10.0**k), f"10{str(k).translate(_SUPERSCRIPTS)}") for k in range(low, high + 1, step))
    body += _columns(_numbers(len(values), x), "sweeps")
    for name, sign in (("before", -1), ("after", 1)):
        here = [(x(i), y(value)) for i, value in enumerate(values) if value * sign > 0]
        body += f'<path class="{name} series" d="{_path(here)}"/>' + _markers(here, name)
    body += _keys([("before", "negative"), ("after", "positive")])
    words = f"Smallest {measure} after each sweep: {_first_and_last(values)}"
    return _svg("measures", f"Smallest {measure}", words, body)


def _svg(name: str, title: str, words: str, body: str) -> str:
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-labelledby="{name}-title {name}-words">'
        f'<title id="{name}-title">{escape(title)}</title><desc id="{name}-words">{escape(words)}</desc>{body}</svg>'
    )


def _first_and_last(values: Sequence[float]) -> str:
    return f"{values[0]:.3g} at first, {values[-1]:.3g} after {len(values) - 1}"


def _round_step(top: float) -> float:
    """Return the distance of four or so round numbers up to `top`, at least 1."""
    size = 10.0 ** math.floor(math.log10(top / 4)) if top > 4 else 1.0
    return next(size * factor for factor in (1, 2, 5, 10) if size * factor * 5 > top or factor == 10)


def _multiples(step: float, top: float) -> list[float]:
    return [step * i for i in range(round(top / step) + 1)]


def _rows(ticks: Iterable[tuple[float, str]]) -> str:
    return "".join(
        f'<path class="grid" d="M{LEFT},{y:.1f}H{RIGHT}"/>'
        f'<text class="tick" x="{LEFT - 7}" y="{y + 4:.1f}" text-anchor="end">{label}</text>'
        for y, label in ticks
    )


def _columns(ticks: Iterable[tuple[float, str]], label: str) -> str:
    marks = "".join(
        f'<path class="axis" d="M{x:.1f},{BOTTOM}v4"/>'
        f'<text class="tick" x="{x:.1f}" y="{BOTTOM + 18}" text-anchor="middle">{text}</text>'
        for x, text in ticks
    )
    middle = (LEFT + RIGHT) / 2
    return (
        f'<path class="axis" d="M{LEFT},{BOTTOM}H{RIGHT}"/>{marks}'
        f'<text x="{middle}" y="{HEIGHT - 5}" text-anchor="middle">{escape(label)}</text>'
    )


def _keys(keys: Sequence[tuple[str, str]]) -> str:
    """Name the colours above the chart, from the left."""
    text = ""
    for i, (style, name) in enumerate(keys):
        x = LEFT + 100 * i
        text += f'<rect class="{style}" x="{x}" y="6" width="10" height="10"/><text x="{x + 15}" y="15">{name}</text>'
    return text


def _sweeps(count: int) -> Callable[[float], float]:
    return lambda sweep: LEFT + 10 + (RIGHT - LEFT - 20) * sweep / max(count - 1, 1)


def _numbers(count: int, x: Callable[[float], float]) -> list[tuple[float, str]]:
    step = max(1, int(_round_step(max(count - 1, 1))))
    return [(x(i), str(i)) for i in range(0, count, step)]


def _smoothing(convergence: Convergence, x: Callable[[float], float]) -> str:
    """Shade the sweeps of smoothing."""
    if convergence.smoothing is None:
        return ""
    start = x(convergence.smoothing)
    anchor, at = ("start", start + 6) if start < RIGHT - 80 else ("end", RIGHT - 4)
    return (
        f'<rect class="smoothing" x="{start:.1f}" y="{TOP}" width="{RIGHT - start:.1f}" height="{BOTTOM - TOP}"/>'
        f'<text class="tick" x="{at:.1f}" y="{TOP + 14}" text-anchor="{anchor}">smoothing</text>'
    )


def _path(points: Sequence[tuple[float, float]]) -> str:
    return "M" + "L".join(f"{x:.1f},{y:.1f}" for x, y in points) if points else ""


def _markers(points: Sequence[tuple[float, float]], style: str) -> str:
    if len(points) > MOST_MARKERS:
        return ""
    return "".join(f'<circle class="{style}" cx="{x:.1f}" cy="{y:.1f}" r="3.2"/>' for x, y in points)
