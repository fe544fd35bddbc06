"""Pictures for papers, in the style of the figures of the method's paper. The only importer of matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from meshfix_cli.errors import WriteError, on_one_line
from meshfix_cli.report.curves import surface
from meshfix_cli.report.facts import Binned, Report, binned
from meshfix_cli.report.figures import Cells, Convergence, Figures, Points, Scene, State, number_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# What matplotlib would write of the time and of itself; without it the same mesh gives the same bytes.
METADATA: dict[str, dict[str, str | None]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None},
    ".pdf": {"CreationDate": None},
}
STYLE: dict[Any, Any] = {  # names of matplotlib's settings
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.5,
    "legend.frameon": False,
    "svg.hashsalt": "meshfix",
}
RED, AMBER, BLUE = "#c2361a", "#f0a500", "#1d6aa8"  # told apart by all eyes, and in grey
WIDTH, ROW, DPI = 7.2, 2.3, 300  # inches, inches, dots per inch
MOST_LINES = 5_000  # elements: the lines of more are pixels in .svg and .pdf as well


def check_plot(target: str) -> None:
    """Raise WriteError now, before any work, where a plot cannot be made."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError as error:
        raise WriteError(f"{target}: plots need matplotlib: pip install matplotlib") from error
    except Exception as error:  # settings of the user that it does not understand
        raise WriteError(f"{target}: matplotlib does not start: {on_one_line(error)}") from error


def plot(report: Report, drawn: Figures, target: Path) -> None:
    """Write the histogram, the convergence and, of a plane mesh, the picture of each stage.

    Parameters
    ----------
    report : Report
        With all stages.
    drawn : Figures
        Of that report.
    target : Path
        Its extension, a key of `METADATA`, is the format.

    Notes
    -----
    Source: figures 4.2 and 4.4.
    """
    import matplotlib

    suffix = target.suffix.lower()
    with matplotlib.rc_context():
        matplotlib.rcdefaults()  # whatever the user has set
        matplotlib.rcParams.update(STYLE)
        figure = _figure(report, drawn)
        figure.savefig(target, format=suffix[1:], dpi=DPI, metadata=METADATA[suffix])


def _figure(report: Report, drawn: Figures) -> Figure:
    from matplotlib.figure import Figure

    flat = report.mesh.points.shape[1] == 2
    charts = 1 if drawn.convergence is None else 3
    pictures = len(drawn.scene.states) if flat else 0
    width = WIDTH if max(charts, pictures) > 1 else WIDTH / 2
    rows = [_height(drawn.scene, width / pictures), ROW] if flat else [ROW]
    figure = Figure(figsize=(width, sum(rows)), layout="constrained")
    bands = figure.subfigures(len(rows), 1, height_ratios=rows, squeeze=False)[:, 0]
    if flat:
        for axes, (name, state) in zip(
            bands[0].subplots(1, pictures, squeeze=False)[0], drawn.scene.states.items(), strict=True
        ):
            _picture(axes, drawn.scene, state)
            count = number_of(state.worst)
            amber = f", amber: the worst {count if count > 1 else 'one'}" if count else ""
            axes.set_title(f"{name}: {state.count:,} inverted{amber}")
    axes = bands[-1].subplots(1, charts, squeeze=False)[0]
    _histogram(axes[0], drawn.histograms, binned(report.mesh))
    if drawn.convergence is not None:
        _inverted(axes[1], drawn.convergence)
        _measures(axes[2], drawn.convergence, report.mesh.topology.element.shape.measure)
    return figure


def _height(scene: Scene, width: float) -> float:
    """Return the height in inches of a picture of that width, with its title."""
    extent = scene.frame[1]
    return min(width * extent[1] / extent[0], 2 * width) + 0.3


def _picture(axes: Axes, scene: Scene, state: State) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    middle, extent = scene.frame
    whole = {key: rows for key, rows in state.cells.items() if key != "line"}  # the edges of those that are curved
    roles = (whole, "none", "0.25"), (state.worst, AMBER, "k"), (state.inverted, f"{RED}8c", RED)
    for cells, face, line in roles:
        many = number_of(cells) > MOST_LINES
        polygons = PolyCollection(
            _places(state.points, cells), facecolors=face, edgecolors=line, linewidths=0.1 if many else 0.3,
            rasterized=many,
        )  # fmt: skip
        axes.add_collection(polygons, autolim=False)
    lines = LineCollection(_places(scene.boundary, scene.facets), colors="k", linewidths=0.8)
    axes.add_collection(lines, autolim=False)
    low, high = _window(middle, extent, state)
    axes.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.axis("off")


def _places(points: Points, cells: Cells) -> list[Points]:
    """Return where the vertices (nodes, d) of each element are, as they go round it."""
    return [corners for key, rows in cells.items() for corners in points[rows[:, surface(key).outline]]]


def _window(middle: Points, extent: Points, state: State) -> tuple[Points, Points]:
    """Return the corners of what is shown: also what is inverted beyond the boundary, but for what is far away."""
    inverted = np.concatenate([*_places(state.points, state.inverted), np.empty((0, 2))])
    low, high = (
        choose(limit, choose.reduce(inverted, axis=0)) if len(inverted) else limit
        for choose, limit in ((np.minimum, middle - extent), (np.maximum, middle + extent))
    )
    return (
        np.maximum(low, middle - 1.5 * extent) - 0.05 * extent,
        np.minimum(high, middle + 1.5 * extent) + 0.05 * extent,
    )


def _histogram(axes: Axes, histograms: dict[str, tuple[int, ...]], counted: Binned) -> None:
    names, bins = list(histograms), len(next(iter(histograms.values())))
    edges = [i * counted.width for i in range(bins + 1)]
    axes.stairs(histograms[names[-1]], edges, fill=True, color=BLUE, alpha=0.6, label=names[-1])
    if len(names) > 1:
        axes.stairs(histograms[names[0]], edges, color=RED, linewidth=1.0, label=names[0])
        _legend(axes)
    axes.set(xlim=(0, edges[-1]), xlabel=counted.label, ylabel="elements")


def _inverted(axes: Axes, convergence: Convergence) -> None:
    axes.plot(convergence.inverted, "o-", color=RED, clip_on=False)
    axes.set_yscale("symlog", linthresh=1)  # zero is where it should end
    axes.set(ylim=(0, None), ylabel="inverted elements")
    _sweeps(axes, convergence)


def _measures(axes: Axes, convergence: Convergence, measure: str) -> None:
    for label, sign, style in (("negative", -1, "o-"), ("positive", 1, "s-")):
        points = [(i, abs(value)) for i, value in enumerate(convergence.measures) if value * sign > 0]
        if points:
            axes.plot(*zip(*points, strict=True), style, color=RED if sign < 0 else BLUE, label=label)
            axes.set_yscale("log")
    axes.set_ylabel(f"size of the smallest {measure}")
    _sweeps(axes, convergence)


def _sweeps(axes: Axes, convergence: Convergence) -> None:
    """Label the axis of the sweeps, and shade those of smoothing."""
    from matplotlib.ticker import MaxNLocator

    last = len(convergence.inverted) - 1
    margin = 0.05 * max(last, 1)
    axes.set(xlabel="sweeps", xlim=(-margin, last + margin))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if convergence.smoothing is not None:
        axes.axvspan(convergence.smoothing, last + margin, color="0.9", linewidth=0, zorder=0, label="smoothing")
    _legend(axes)


def _legend(axes: Axes) -> None:
    """Name what is drawn, above it: inside there may be no room."""
    handles, _ = axes.get_legend_handles_labels()
    if handles:
        axes.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncol=len(handles), borderaxespad=0.1, handlelength=1.2,
            handletextpad=0.5, columnspacing=1.2,
        )  # fmt: skip
