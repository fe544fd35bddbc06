"""The report as one HTML file: tables, charts, and a picture that can be turned; it needs nothing else."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import counted
from meshfix_cli.report.as_json import to_json
from meshfix_cli.report.curves import surface
from meshfix_cli.report.facts import (
    Report,
    binned,
    is_some_inside,
    kind_rows,
    phases,
    processes,
    quality_rows,
    required,
    title,
    verdict,
)
from meshfix_cli.report.figures import Cells, Figures, Scene, Worst, number_of
from meshfix_cli.report.page import charts
from meshfix_cli.report.page.parts import filled, framed, made, read, scrolled, shown, table
from meshfix_cli.report.sliding import sliding

FARTHEST = 1e6  # sizes of the mesh: single precision holds it, and nobody looks there

Numbers = NDArray[np.float64]


def page(report: Report, drawn: Figures, options: Mapping[str, str]) -> str:
    """Return the HTML.

    Parameters
    ----------
    report : Report
        With all stages.
    drawn : Figures
        Of that report.
    options : mapping
        Those of the command line and their values.
    """
    content = filled(
        "one.html",
        picture=shown(_in_words(report, drawn.scene)),
        stages=_stages(drawn.scene),
        legend=_legend(report, drawn.scene),
        keys=_keys(drawn.scene.dimension),
        quality=table("Quality of each stage", ["", *report.stages], quality_rows(report)) + _by_type(report),
        requirements=_requirements(report),
        charted="Angles" if report.mesh.topology.simplicial else "Scaled Jacobians",
        and_convergence=" and convergence" if drawn.convergence else "",
        charts=_charts(report, drawn),
        worst=_worst(report, drawn),
    )
    data = {"report": to_json(replace(report, everything=False)), "scene": _scene(drawn.scene)}
    elements = (f'<script type="application/json" id="{name}">{_json(one)}</script>\n' for name, one in data.items())
    return framed(
        report.valid,
        script=read("viewer.js"),
        data="".join(elements),
        command=shown(report.command),
        heading=shown(PurePath(report.name).name or report.name),
        subject=f'\n<p class="subject">{shown(title(report))}</p>',
        verdict=_verdict(report),
        lead=f"\n{_lead(report)}",
        content=content,
        made=_made(report, options),
    )


def _json(value: object) -> str:
    """Return JSON that cannot end the script element it stands in."""
    return json.dumps(value, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _verdict(report: Report) -> str:
    word = "Valid" if report.valid else "Not valid"
    notes = (f"note: {note}" for note in (*report.notes, *sliding(report)))
    lines = [*verdict(replace(report, everything=False), listing=False), *notes]
    lines = [line.removeprefix("valid: ").removeprefix("NOT VALID: ") for line in lines]
    return f"<p><strong>{word}</strong></p>" + "".join(f"<p>{shown(line)}</p>" for line in lines)


def _lead(report: Report) -> str:
    """Return the numbers that matter most, of the result and of the mesh as it came."""
    boxes = ""
    for name, values in quality_rows(report)[: 4 + is_some_inside(report)]:
        was = f' <span class="was">from {shown(values[0])}</span>' if len(values) > 1 else ""
        boxes += f"<div><dt>{shown(name)}</dt><dd>{shown(values[-1])}{was}</dd></div>"
    return f'<dl class="lead">{boxes}</dl>'


def _by_type(report: Report) -> str:
    types, rows = kind_rows(report)
    return table(f"The {_result(report)} by types of elements", ["", *types], rows) if types else ""


def _in_words(report: Report, scene: Scene) -> str:
    counts = ", ".join(f"{state.count:,} inverted {stage}" for stage, state in scene.states.items())
    what = "Plane view" if scene.dimension == 2 else "Three-dimensional view"
    return f"{what} of the mesh and its {report.mesh.topology.element.shape.plural}: {counts}"


def _stages(scene: Scene) -> str:
    radios = ""
    for i, (name, state) in enumerate(scene.states.items()):
        words = f"{name}: {counted(state.count, 'inverted element', 'inverted elements')}"
        if state.left_out:
            words += f", of which {counted(state.drawn, 'is', 'are')} drawn"
        radios += (
            f'<label><input type="radio" name="stage" value="{i}" data-drawn="{shown(words)}"'
            f"{' checked' * (i == 0)}>{shown(name)}</label>"
        )
    return radios


def _legend(report: Report, scene: Scene) -> str:
    boundary = "boundary, drawn coarsely" if scene.coarse else "boundary"
    if scene.dimension == 2 and any(state.cells for state in scene.states.values()):
        boundary = "all elements"
    count = number_of(list(scene.states.values())[-1].worst)
    worst = f"the worst {count}" if count > 1 else "the worst one"
    items = {"inverted": "inverted elements", "worst": f"{worst} of the {_result(report)}", "boundary": boundary}
    if any(state.off for state in scene.states.values()):
        facets = "facets" if scene.dimension == 3 else "edges"
        shares = (("near", "a tenth of --max-deviation"), ("off", "half of it"), ("beyond", "all of it"))
        items |= {style: f"{facets} off their shape by more than {share}" for style, share in shares}
    return "\n".join(f'<li><i class="{style}"></i>{words}</li>' for style, words in items.items())


def _keys(dimension: int) -> str:
    if dimension == 2:
        return "Drag to move, wheel or pinch to zoom. Keys: arrows move, + and − zoom, 0 resets."
    return (
        "Drag to turn, wheel or pinch to zoom, drag with Shift or two fingers to move. "
        "Keys: arrows turn, + and − zoom, 0 resets."
    )


def _requirements(report: Report) -> str:
    style = {True: "met", False: "unmet"}
    items = "".join(f'<li class="{style[met]}">{shown(text)}</li>' for met, text in required(report))
    return f'<ul class="plain">{items}</ul>' if items else ""


def _charts(report: Report, drawn: Figures) -> str:
    bins, measure = binned(report.mesh), report.mesh.topology.element.shape.measure
    edges = [f"{i * bins.width:g}" for i in range(len(report.result.histogram) + 1)]
    counts = [
        (f"{low}–{high}{bins.unit}", [f"{one[i]:,}" for one in drawn.histograms.values()])
        for i, (low, high) in enumerate(pairwise(edges))
    ]
    numbers = table(f"Elements by their {bins.name}", [bins.name, *drawn.histograms], counts)
    result = _figure(f"Elements by their {bins.long_name}", charts.histogram(drawn.histograms, bins), numbers)
    if drawn.convergence is None:
        return result
    result += _figure("Inverted elements, logarithmic", charts.inverted(drawn.convergence), _sweeps(report, measure))
    return result + _figure(f"Size of the smallest {measure}, logarithmic", charts.measures(drawn.convergence, measure))


def _figure(caption: str, svg: str, numbers: str = "") -> str:
    details = f"<details><summary>The numbers</summary>{numbers}</details>" if numbers else ""
    return f"<figure><figcaption>{shown(caption)}</figcaption>{svg}{details}</figure>\n"


def _sweeps(report: Report, measure: str) -> str:
    rows = [
        (str(i), [one.phase, f"{one.inverted:,}", f"{one.min_measure:.3g}", f"{one.moved:,}", f"{one.seconds:.3g}"])
        for i, one in enumerate(report.records)
    ]
    columns = ["sweep", "phase", "inverted", f"smallest {measure}", "moved", "seconds"]
    return table("Every sweep", columns, rows)


def _worst(report: Report, drawn: Figures) -> str:
    columns = [binned(report.mesh).label, report.mesh.topology.element.shape.measure, "inverted", "centroid"]
    head = "".join(f'<th scope="col">{column}</th>' for column in ("element", "picture", *columns))
    body = "".join(_worst_row(one, columns, drawn.scene) for one in drawn.worst)
    count = f"{len(drawn.worst)} worst elements" if len(drawn.worst) > 1 else "worst element"
    caption = f"The {count} of the {_result(report)}, as the file numbers them"
    return scrolled(caption, f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>", "stacked")


def _worst_row(one: Worst, columns: Sequence[str], scene: Scene) -> str:
    """Return a row; each cell has the name of its column, which stands before it where the page is narrow."""
    corners = _placed(one.corners, scene).astype(float)
    reach = np.linalg.norm(corners - corners.mean(axis=0), axis=1).max()
    place = [*corners.mean(axis=0), *[0.0] * (3 - scene.dimension), max(float(reach), 1e-6)]
    centroid = f"({', '.join(f'{x:.6g}' for x in one.centroid)})"
    values = f"{one.quality:.3f}", f"{one.measure:.3g}", "yes" if one.inverted else "no", centroid
    styles = "", "", "inverted" * one.inverted, ""
    cells = "".join(
        f'<td data-column="{column}" class="{style}">{value}</td>'
        for column, style, value in zip(columns, styles, values, strict=True)
    )
    data = f'data-element="{one.name}" data-place="{" ".join(f"{x:.6g}" for x in place)}"'
    button = f'<button type="button" hidden {data} aria-label="Show {one.name}">Show</button>'
    return f'<tr><th scope="row">{one.name.removeprefix("element ")}</th><td>{button}</td>{cells}</tr>'


def _result(report: Report) -> str:
    return "result" if len(report.stages) > 1 else "mesh"


def _made(report: Report, options: Mapping[str, str]) -> str:
    lines = [("file", [report.name]), *((name, [value]) for name, value in options.items())]
    if report.records:
        lines.append(("sweeps", ["; ".join(phases(report))]))
    lines += [(f"process {rank}", [text]) for rank, text in enumerate(processes(report))]
    return made(lines)


def _placed(points: Numbers, scene: Scene) -> NDArray[np.float32]:
    """Return points (k, d) relative to the middle of the mesh and its size."""
    middle, extent = scene.frame
    return np.clip((points - middle) / np.linalg.norm(extent), -FARTHEST, FARTHEST).astype(np.float32)


def _scene(scene: Scene) -> dict[str, Any]:
    """Return what the page's script draws.

    `points` are base64 of float32, `rows` of uint16 or, where wide, of uint32; layers name both by their place there,
    and `shapes` have the polygons that make the surface of an element.
    """
    points, extent = [scene.boundary], scene.frame[1]
    layers: list[dict[str, Any]] = []
    # One array, such as that of all cells, may be drawn in several stages.
    rows: dict[int, NDArray[np.int32]] = {}

    def add(role: str, cells: Cells, stage: int | None = None) -> None:
        for key, corners in cells.items():
            if len(corners):
                rows.setdefault(id(corners), corners)
                place = {"points": len(points) - 1, "rows": list(rows).index(id(corners))}
                layers.append({"role": role, "shape": key, "stage": stage, **place})

    add("boundary", scene.facets)
    add("creases", {"line": scene.creases})
    for stage, state in enumerate(scene.states.values()):
        points.append(state.points)
        add("cells", state.cells, stage)
        add("inverted", state.inverted, stage)
        add("worst", state.worst, stage)
        for role, cells in state.off.items():
            add(role, cells, stage)
    return {
        "dimension": scene.dimension,
        "extent": (extent / np.linalg.norm(extent)).tolist(),
        "points": [_base64(_placed(one, scene)) for one in points],
        "rows": [_numbered(one) for one in rows.values()],
        "shapes": {layer["shape"]: _surface(layer["shape"]) for layer in layers},
        "layers": layers,
    }


def _surface(key: str) -> dict[str, Any]:
    """Return the number of corners, the corners of each polygon and, where these are not its sides, of each line."""
    drawn = surface(key)
    told = {"corners": drawn.corners, "sides": drawn.sides}
    return told if drawn.edges is None else {**told, "edges": [pair for edge in drawn.edges for pair in pairwise(edge)]}


def _numbered(rows: NDArray[np.int32]) -> dict[str, Any]:
    wide = bool(rows.max(initial=0) >= 2**16)
    return {"wide": wide, "data": _base64(rows.astype(np.uint32 if wide else np.uint16))}


def _base64(values: NDArray[Any]) -> str:
    return base64.b64encode(values.astype(values.dtype.newbyteorder("<")).tobytes()).decode()
