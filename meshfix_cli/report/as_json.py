"""Reports for programs: JSON and CSV."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any

from meshfix_cli import __version__
from meshfix_cli.mesh.elements import role
from meshfix_cli.quality.metrics import NUMBERS, having
from meshfix_cli.quality.summary import Kind, Summary, by_element
from meshfix_cli.report.facts import Report, binned, first_inverted

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.solve.records import SweepRecord

CURVED = ("smallest_coefficient", "scaled_jacobian")  # of elements that may be curved
SCHEMA = 1  # raised when a name in the JSON changes its meaning or goes away


def to_json(report: Report) -> dict[str, Any]:
    """Return the facts of the table under stable names; angles in degrees, times in seconds, lengths of the model.

    The numbers of the result stand at the top, and among those of all stages under "quality"; what no element has is
    null.
    """
    mesh, result = report.mesh, report.result
    return {
        "schema": SCHEMA,
        "command": report.command,
        "file": report.name,
        "dimension": mesh.dimension,
        "surface": mesh.surface is not None,
        "vertices": int(mesh.topology.used.sum()),
        "free_vertices": int(mesh.movable.sum()),
        "fixed": report.fixed,
        "valid": report.valid,
        "not_judged": dict(report.not_judged),
        **({"higher_order": dict(report.higher_order)} if report.higher_order else {}),
        "misnumbered": report.misnumbered,
        "mirrored": int(mesh.topology.mirrored.sum()),
        **{name: _finite(getattr(result, name)) for name in NUMBERS},
        "ceiling": report.ceiling,
        "quality": {stage: _summary_json(summary, mesh) for stage, summary in report.stages.items()},
        "first_inverted": list(_first_inverted(report)),
        "inverted_without_free_vertex": len(report.obstacles.inverted),
        "obstacles": {
            field.name: report.ids[getattr(report.obstacles, field.name)].tolist() for field in fields(report.obstacles)
        },
        "sweeps": [asdict(record) for record in report.records],
        "notes": list(report.notes),
        "requirements": [
            {"requirement": str(one), "value": _finite(one.value(report.result)), "met": one.holds(report.result)}
            for one in report.requirements
        ],
        **({} if report.groups is None else {"groups": list(_groups_json(report.groups, mesh))}),
        **(report.facts or {}),
    }


def json_line(report: Report) -> str:
    """Return one JSON object, on one line."""
    return json.dumps(to_json(report), allow_nan=False) + "\n"


def _first_inverted(report: Report) -> Iterator[dict[str, Any]]:
    """Give an object for each inverted element that is listed, with how good it is where it may be curved."""
    listed = first_inverted(report)
    more: list[dict[str, float]] = [{}] * len(listed)
    if report.mesh.quadratic is not None and listed:
        values = by_element(report.mesh)
        numbers = (values[name][report.result.inverted_elements].tolist() for name in CURVED)
        more = [dict(zip(CURVED, one, strict=True)) for one in zip(*numbers, strict=True)]
    for (_, number, centroid), curved in zip(listed, more, strict=False):
        yield {"id": number, "centroid": centroid, **{name: _finite(value) for name, value in curved.items()}}


def _groups_json(groups: Mapping[str, Mapping[int, int]], mesh: Mesh) -> Iterator[dict[str, Any]]:
    """Give an object for each kind of cells in each group; of one that is empty the kind may not be known."""
    for name, counts in groups.items():
        for dimension, number in counts.items():
            yield {"name": name, "kind": role(dimension, mesh.dimension)[0], "dimension": dimension, "number": number}
        if not counts:
            yield {"name": name, "kind": None, "dimension": None, "number": 0}


def batch_json(options: Mapping[str, Any], files: Sequence[Mapping[str, Any]], total: int) -> str:
    """Return one JSON object about a batch of so many files, of which some are done: one line for each."""
    head = {"schema": SCHEMA, "version": __version__, "command": "batch", "options": options, "total": total}
    lines = ",\n".join(json.dumps(one, allow_nan=False) for one in files)
    return f'{json.dumps(head, allow_nan=False)[:-1]}, "files": [\n{lines}\n]}}\n'


def history_csv(records: Iterable[SweepRecord]) -> str:
    """Return a line for each sweep: the series of the paper's figure 4.4."""
    rows = [asdict(record) for record in records]
    lines = [",".join(rows[0])] if rows else []
    return "\n".join(lines + [",".join(str(value) for value in row.values()) for row in rows]) + "\n"


def _summary_json(summary: Summary, mesh: Mesh) -> dict[str, Any]:
    values: dict[str, Any] = {name: _finite(getattr(summary, name)) for name in NUMBERS if name != "elements"}
    bins = binned(mesh)
    values["histogram"] = {"of": bins.key, "bin_width": bins.width, "counts": list(summary.histogram)}
    if summary.jacobians is not None:
        values["scaled_jacobian"] = asdict(summary.jacobians)
    if summary.kinds:
        values["types"] = {one.element.key: _kind_json(one) for one in summary.kinds}
    if summary.curved is not None:
        values["curved"] = asdict(summary.curved)
    if summary.to_reference is not None:
        values["to_reference"] = dict(zip(("smallest", "mean"), summary.to_reference, strict=True))
    values["metrics"] = {name: _metric_json(name, pair, mesh) for name, pair in summary.metrics.items()}
    return values


def _kind_json(kind: Kind) -> dict[str, Any]:
    jacobians = {"smallest": kind.smallest, "mean": kind.mean}
    return {"count": kind.count, "inverted": kind.inverted, "inside": kind.inside, "scaled_jacobian": jacobians}


def _metric_json(name: str, values: tuple[float, float], mesh: Mesh) -> dict[str, float | None]:
    """Return the worst and the mean value, and of how many elements where not all have the metric."""
    told = dict(zip(("worst", "mean"), map(_finite, values), strict=True))
    count = having(name, mesh)
    return told if count == mesh.topology.m else {**told, "elements": count}


def _finite(value: float) -> float | None:
    """JSON has no infinity, which is the aspect ratio of an inverted element, and no nan."""
    return value if abs(value) < float("inf") else None
