"""What is reported of a run, in plain words and rows that a terminal and a page share."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.mesh.elements import JUDGED, MIXED, Shape, counted, role, straight_key, words
from meshfix_cli.mesh.mesh import BETWEEN, ON_BOUNDARY, Mesh
from meshfix_cli.quality.metrics import having, types_with
from meshfix_cli.quality.requirement import Requirement
from meshfix_cli.quality.summary import BIN_WIDTH, JACOBIAN_BINS, Summary

if TYPE_CHECKING:
    from meshfix_cli.quality.obstacles import Obstacles
    from meshfix_cli.solve.records import SweepRecord

Row = tuple[str, list[str]]  # of a table: a label, and a value for each column
LISTED = 10  # inverted elements named in the report

# By command, the words between the number of elements that are inverted and "inverted"; of others they "are".
_BEFORE_INVERTED = {
    "untangle": ("element remains", "elements remain"),
    "perturb": ("element is now", "elements are now"),
}


@dataclass(frozen=True, eq=False)
class Report:
    """All facts about one run, from which the table and the JSON are made.

    Attributes
    ----------
    name, command : str
    meshes : dict
        By the names of the stages; the last is the result, as the file stores it.
    points : callable
        Gives the result (n, 2) or (n, 3) float in the coordinates of the file.
    ids : (m,) int64
        The file's numbers of the elements.
    stages : dict
        Summaries by name in the order of the table's columns; the last is that of the result. A brief report has no
        others.
    ceiling : float or None
        The smallest angle in degrees, or scaled Jacobian where elements are not all simplices, that fixed vertices
        set.
    obstacles : Obstacles
        What makes a valid mesh impossible.
    fixed : dict
        Number of fixed vertices by reason.
    not_judged : dict
        Number of elements that are held and not judged, by the name of their type.
    higher_order : dict
        Number of elements that have more nodes than corners, by the name of their type.
    records : sequence of SweepRecord
    notes : sequence of str
    facts : dict
        Whatever else the command has to tell, under stable names.
    requirements : sequence of Requirement
        What the user asks of the result.
    everything : bool
        List all inverted elements, not only the first.
    groups : dict or None
        For each group of the file the number of its cells by their dimension; None: nobody asked.
    """

    name: str
    command: str
    meshes: Mapping[str, Mesh]
    points: Callable[[], NDArray[np.floating[Any]]]
    ids: NDArray[np.int64]
    stages: dict[str, Summary]
    ceiling: float | None
    obstacles: Obstacles
    fixed: dict[str, int]
    not_judged: Mapping[str, int]
    higher_order: Mapping[str, int] = field(default_factory=dict)
    records: Sequence[SweepRecord] = ()
    notes: Sequence[str] = ()
    facts: Mapping[str, Any] | None = None
    requirements: Sequence[Requirement] = ()
    everything: bool = False
    groups: Mapping[str, Mapping[int, int]] | None = None

    @property
    def mesh(self) -> Mesh:
        """The result."""
        return list(self.meshes.values())[-1]

    @property
    def result(self) -> Summary:
        """The summary of the result."""
        return list(self.stages.values())[-1]

    @property
    def misnumbered(self) -> int:
        """Elements numbered against the rest of the mesh: inverted for whoever reads the file, whatever their shape."""
        return int(self.mesh.topology.misnumbered.sum())

    @property
    def valid(self) -> bool:
        """All elements are judged, none is inverted, by shape or by numbering, and the mesh does not overlap itself."""
        return not (self.result.inverted or self.misnumbered or self.obstacles or self.not_judged)

    @property
    def met(self) -> bool:
        """All requirements are."""
        return all(one.holds(self.result) for one in self.requirements)

    @property
    def listed(self) -> int | None:
        """How many elements are listed; None: all."""
        return None if self.everything else LISTED


@dataclass(frozen=True)
class Binned:
    """What the histograms of a report count elements by.

    Attributes
    ----------
    key : str
        The metric.
    name, long_name : str
        Shorter and longer words for its values.
    unit : str
        "": none.
    width : float
        Of a bin.
    """

    key: str
    name: str
    long_name: str
    unit: str
    width: float

    @property
    def label(self) -> str:
        """What stands at an axis or at the head of a column."""
        return f"{self.long_name} [{self.unit}]" if self.unit else self.long_name

    @property
    def heading(self) -> str:
        """What stands above a chart."""
        return f"{self.long_name[0].upper()}{self.long_name[1:]}s"


def binned(mesh: Mesh) -> Binned:
    """Return what `Summary.histogram` counts."""
    if mesh.topology.simplicial:
        return Binned("min_angle", "smallest angle", f"smallest {mesh.topology.element.shape.angle}", "°", BIN_WIDTH)
    return Binned("scaled_jacobian", "scaled Jacobian", "scaled Jacobian", "", 1 / JACOBIAN_BINS)


def title(report: Report) -> str:
    """Return what the mesh is, in one line."""
    mesh = report.mesh
    held = ", ".join(f"{n:,} {why}" for why, n in report.fixed.items())
    vertices = counted(int(mesh.topology.used.sum()), "vertex", "vertices")
    free = f"{int(mesh.movable.sum()):,} free{_sliding(report)}"
    return f"{report.name}: {', '.join([*_elements(report), vertices])}: {free}{f', fixed {held}' if held else ''}"


def _elements(report: Report) -> Iterator[str]:
    """Count the elements by their types, those of higher order by their own."""
    kinds, topology = [(one.count, one.element) for one in report.result.kinds], report.mesh.topology
    for count, element in kinds or [(topology.m, topology.element)]:
        higher = [key for key in report.higher_order if element.key == straight_key(key)]
        left = count - sum(report.higher_order[key] for key in higher)
        if left:
            yield counted(left, element.shape.name, element.shape.plural)
        yield from (counted(report.higher_order[key], *words(key)) for key in higher)


def _sliding(report: Report) -> str:
    """Say how many vertices slide."""
    if "sliding" not in (report.facts or {}):
        return ""
    counts, solid = (report.facts or {})["sliding"], report.mesh.points.shape[1] == 3
    words = {"lines": "along lines", "planes": "in planes", "curves": "along curves", "surfaces": "on surfaces"}
    there = {key: n for key, n in counts.items() if n or report.mesh.surface is None}
    shown = (f"{n:,} {words[key]}" for key, n in there.items() if solid or key in ("lines", "curves"))
    return f" ({', '.join(shown)})" if there else ""


def quality_rows(report: Report) -> list[Row]:
    """Return the rows of the quality table: a label, and the value of each stage."""
    flat, stages = report.mesh.dimension == 2, list(report.stages.values())

    def row(label: str, form: str, value: Callable[[Summary], float]) -> Row:
        return label, [format(value(summary), form) for summary in stages]

    inside = row("of these invalid inside only", ",", _inside)
    rows = [
        row("inverted elements", ",", lambda one: one.inverted),
        *([inside] if is_some_inside(report) else []),
        row("folded interior edges" if flat else "folded interior faces", ",", lambda one: one.folded),
        row(f"smallest {report.mesh.topology.element.shape.measure}", ".3g", lambda one: one.min_measure),
        *(_curved(row) if report.result.curved else ()),
        *(_angles(report, row) if report.mesh.topology.simplicial else _jacobians(report, row)),
    ]
    if report.result.to_reference is not None:
        pairs = (summary.to_reference for summary in stages)
        worst = ["{:.3f} / {:.3f}".format(*pair) for pair in pairs if pair is not None]
        rows.append(("mean ratio to the reference, worst / mean", worst))
    for name in report.result.metrics:
        share, form = _share(report, name), "{:.3g} / {:.3g}" if having(name, report.mesh) else "not defined"
        label = f"{name} of {share}, worst / mean" if share else f"{name}, worst / mean"
        rows.append((label, [form.format(*summary.metrics[name]) for summary in stages]))
    return rows


def is_some_inside(report: Report) -> bool:
    """Whether in any stage an element is invalid though all of its corners, or nodes, are valid."""
    return any(map(_inside, report.stages.values()))


def _inside(summary: Summary) -> int:
    return summary.curved.inside if summary.curved and not summary.kinds else sum(one.inside for one in summary.kinds)


def _curved(row: Callable[..., Row]) -> Iterator[Row]:
    """Give the rows that tell how good curved elements are; what follows is of the straight ones of their corners."""
    yield row("smallest coefficient, straight: 1", ".3f", lambda one: one.curved.smallest)
    yield row("smallest scaled Jacobian at nodes", ".3f", lambda one: one.curved.scaled_jacobian)


def _angles(report: Report, row: Callable[..., Row]) -> Iterator[Row]:
    """Give the rows that tell how good simplices are."""
    angle = report.mesh.topology.element.shape.angle
    yield row(f"smallest {angle} [°]", ".3f", lambda one: one.min_angle)
    yield row(f"largest {angle} [°]", ".3f", lambda one: one.max_angle)
    yield row(f"mean smallest {angle} [°]", ".2f", lambda one: one.mean_min_angle)
    yield row("1st percentile [°]", ".2f", lambda one: one.percentile_1)
    yield from _ceiling(report, "ceiling set by fixed vertices [°]")


def _jacobians(report: Report, row: Callable[..., Row]) -> Iterator[Row]:
    """Give the rows that tell how good other elements are, and the angles of those that have angles."""
    yield row("smallest scaled Jacobian", ".3f", lambda one: one.jacobians.smallest)
    yield row("mean scaled Jacobian", ".3f", lambda one: one.jacobians.mean)
    yield row("1st percentile", ".3f", lambda one: one.jacobians.percentile_1)
    yield from _ceiling(report, "ceiling set by fixed vertices")
    kinds = [one.element for one in report.result.kinds]
    some = [one.shape for one in kinds if one.key in types_with("min_angle")]
    if some:
        among = "" if len(some) == len(kinds) else f" of {' and '.join(one.plural for one in some)}"
        yield row(f"smallest {some[0].angle}{among} [°]", ".3f", lambda one: one.min_angle)
        yield row(f"largest {some[0].angle}{among} [°]", ".3f", lambda one: one.max_angle)


def _ceiling(report: Report, label: str) -> Iterator[Row]:
    facts, before = report.facts or {}, [""] * (len(report.stages) - 1)
    slides = "ceiling_without_sliding" in facts
    if slides or report.ceiling is not None:
        yield label, [*before, _height(report.ceiling)]
    if slides:
        yield "the same, if nothing slid", [*before, _height(facts["ceiling_without_sliding"])]


def _height(ceiling: float | None) -> str:
    return "none" if ceiling is None else f"{ceiling:.3f}"


def kind_rows(report: Report) -> tuple[list[str], list[Row]]:
    """Return the columns and the rows of a table of the result's elements by their types: nothing for one type."""
    kinds = report.result.kinds
    if len(kinds) < 2:
        return [], []
    rows = [
        ("elements", [f"{one.count:,}" for one in kinds]),
        ("inverted", [f"{one.inverted:,}" for one in kinds]),
        ("of these invalid inside only", [f"{one.inside:,}" for one in kinds]),
        ("smallest scaled Jacobian", [f"{one.smallest:.3f}" for one in kinds]),
        ("mean scaled Jacobian", [f"{one.mean:.3f}" for one in kinds]),
    ]
    return [one.element.shape.plural for one in kinds], rows


def phases(report: Report) -> Iterator[str]:
    """Give a line for each phase: its sweeps, what is left after the last, and seconds."""
    by_name: dict[str, list[SweepRecord]] = {}
    for record in report.records:
        if record.sweep and record.phase != "best":
            by_name.setdefault(record.phase, []).append(record)
    for name, records in by_name.items():
        left, sweeps = records[-1], counted(len(records), "sweep", "sweeps")
        seconds = sum(record.seconds for record in records)
        measure = f"smallest {report.mesh.topology.element.shape.measure} {left.min_measure:.3g}"
        yield f"{name}: {sweeps}, {left.inverted:,} inverted, {measure}, {seconds:.3g} s"


def processes(report: Report) -> Iterator[str]:
    """Say of each of several processes what it held and sent."""
    for facts in (report.facts or {}).get("ranks", ()):
        memory = "" if facts["peak_mb"] is None else f", {facts['peak_mb']:,.0f} MB at most"
        vertices = counted(facts["vertices"], "vertex", "vertices")
        ghosts = counted(facts["ghosts"], "ghost", "ghosts")
        sent = f"sent {facts['megabytes']:.3g} MB in {counted(facts['messages'], 'message', 'messages')}"
        yield f"{vertices} and {ghosts}{memory}, {sent}"


def verdict(report: Report, listing: bool = True) -> list[str]:
    """Return in plain words how far vertices moved, and whether the mesh is valid; if not, why.

    With `listing`, a line for each inverted element that is listed follows.
    """
    facts = report.facts or {}
    lines = [_perturbed(facts)] if "moved" in facts else [_displaced(facts)] if "displacement" in facts else []
    count = report.result.inverted
    if report.valid:
        return [*lines, "valid: no element is inverted"]
    if report.not_judged:
        lines.append(f"NOT VALID: {not_judged(report)}")
    if count:
        subject = _BEFORE_INVERTED.get(report.command, ("element is", "elements are"))
        text = f"NOT VALID: {counted(count, *subject)} inverted"
        if listing:
            text += f"; the first {LISTED}:" if count > LISTED and not report.everything else ":"
        lines.append(text)
    if count and listing:
        lines += [f"  {name} at ({', '.join(f'{x:.6g}' for x in c)})" for name, _, c in first_inverted(report)]
    lines += _impossible(report)
    if report.misnumbered:
        what, it = ("element is", "it") if report.misnumbered == 1 else ("elements are", "them")
        which = _some(report, np.flatnonzero(report.mesh.topology.misnumbered))
        text = f"NOT VALID: {report.misnumbered:,} {what} numbered against the rest of the mesh ({which})"
        lines.append(f"{text}; untangle --fix-orientation renumbers {it}")
    return lines


def _impossible(report: Report) -> Iterator[str]:
    """Name what no motion of the free vertices can mend."""
    found, curved = report.obstacles, report.mesh.quadratic is not None
    if count := len(found.inverted):
        where = "without a free vertex" if report.mesh.topology.simplicial else "at corners without a free vertex"
        where = "wherever free nodes go" if curved else where
        slides = ", or wherever the only free one slides" * (report.mesh.freedom is not None)
        yield (
            f"IMPOSSIBLE: {count:,} of them {where}{slides}: the fixed ones are wrong ({_some(report, found.inverted)})"
        )
    if count := len(found.exclusive):  # at least two
        shared = "free nodes that they share go" if curved else "free vertex that they share goes"
        yield (
            f"IMPOSSIBLE: {count:,} elements exclude each other: wherever the {shared}, one of them is inverted "
            f"({_some(report, found.exclusive)})"
        )
    for pairs, what in ((found.crossing, "crosses itself"), (found.folding, "folds back upon itself")):
        if count := len(pairs):
            places = counted(count, "place", "places")
            yield f"IMPOSSIBLE: {what_is_fixed(report.fixed)} {what} in {places} ({_some_pairs(report, pairs)})"
    between = {reason: count for reason, count in report.fixed.items() if reason.startswith(BETWEEN)}
    if between and (len(found.inverted) or len(found.exclusive) or len(found.crossing)):
        held = " and ".join(f"{count:,} {reason}" for reason, count in between.items())
        yield f"among the fixed vertices are {held}: --regions none lets them move"
    if len(found.overlapping):
        yield f"IMPOSSIBLE: separate parts of the mesh overlap ({_some(report, found.overlapping)})"


def what_is_fixed(fixed: Mapping[str, int]) -> str:
    """Return what may cross itself, by the reasons for which vertices are fixed."""
    return "the fixed boundary" if set(fixed) <= {ON_BOUNDARY} else "what held vertices span"


def _some(report: Report, rows: NDArray[np.integer[Any]]) -> str:
    """Name the first of some elements as the file does."""
    first = rows[: report.listed]
    named = []
    numbers = zip(_shapes(report.mesh, first), report.ids[first].tolist(), strict=True)
    for shape, group in groupby(numbers, itemgetter(0)):
        ids = [str(number) for _, number in group]
        named.append(f"{shape.name if len(ids) == 1 else shape.plural} {', '.join(ids)}")
    return f"{', '.join(named)}{', ...' * (len(first) < len(rows))}"


def _some_pairs(report: Report, pairs: NDArray[np.integer[Any]]) -> str:
    """Name the first of some pairs of elements."""
    first = pairs[: report.listed]
    more = ", ..." * (len(first) < len(pairs))
    if report.mesh.topology.simplicial:
        return f"elements {', '.join(f'{a} and {b}' for a, b in report.ids[first].tolist())}{more}"
    return f"{', '.join(' and '.join(names(report, pair)) for pair in first)}{more}"


def names(report: Report, rows: NDArray[np.integer[Any]]) -> list[str]:
    """Return what elements are called: by the file's numbers and, where not all are simplices, their types."""
    shapes = _shapes(report.mesh, rows)
    return [f"{shape.name} {number}" for shape, number in zip(shapes, report.ids[rows].tolist(), strict=True)]


def _shapes(mesh: Mesh, rows: NDArray[np.integer[Any]]) -> list[Shape]:
    """Return the shapes of elements, whose words name them; simplices are called elements."""
    topology = mesh.topology
    if topology.simplicial:
        return [MIXED[mesh.dimension].shape] * len(rows)
    return [JUDGED[code].shape for code in topology.of_rows(topology.connectivity.codes)[rows].tolist()]


def not_judged(report: Report) -> str:
    """Say which elements are held and not judged: nothing, where all are judged."""
    named = [counted(count, *words(key)) for key, count in report.not_judged.items()]
    if not named:
        return ""
    return f"{' and '.join(named)} {'is' if sum(report.not_judged.values()) == 1 else 'are'} held and not judged"


def groups(report: Report) -> Iterator[str]:
    """Name the groups that hold something, if somebody asked for them."""
    if report.groups is None:
        return
    named = []
    for name, counts in report.groups.items():
        some = [counted(n, *role(dimension, report.mesh.dimension)) for dimension, n in counts.items() if n]
        named += [f"{name} ({', '.join(some)})"] * bool(some)
    yield f"groups: {', '.join(named) or 'none'}"


def required(report: Report) -> Iterator[tuple[bool, str]]:
    """Yield for each requirement whether it is met, and the same in words."""
    for one in report.requirements:
        met = one.holds(report.result)
        among = f", among {share}" if (share := _share(report, one.name)) else ""
        yield met, f"{'met' if met else 'NOT MET'}: {one} (it is {one.value(report.result):g}{among})"


def _share(report: Report, metric: str) -> str:
    """Say how many elements have a metric, or one of `metrics.NUMBERS`; nothing, where all have it."""
    count, total = having(metric, report.mesh), report.mesh.topology.m
    return "" if count == total else f"{count:,} of {counted(total, 'element', 'elements')}"


def _displaced(facts: Mapping[str, Any]) -> str:
    far = facts["displacement"]
    moved = counted(far["vertices"], "vertex", "vertices")
    return f"moved {moved} by {far['mean']:.3g} in the mean and {far['largest']:.3g} at most"


def _perturbed(facts: Mapping[str, Any]) -> str:
    if not facts["moved"]:
        return "moved no vertex"
    moved = counted(facts["moved"], "vertex", "vertices")
    return f"moved {moved} by {facts['distance']:.6g} (seed {facts['seed']})"


def first_inverted(report: Report) -> list[tuple[str, int, list[float]]]:
    """Return the name and the number of each inverted element that is listed, and its centroid."""
    first = report.result.inverted_elements[: report.listed]
    if not len(first):
        return []
    return list(zip(names(report, first), report.ids[first].tolist(), centroids(report, first).tolist(), strict=True))


def centroids(report: Report, rows: NDArray[np.integer[Any]]) -> NDArray[np.float64]:
    """Return the means of the nodes (k, 2 or 3) of elements, in the coordinates of the file."""
    mesh, topology = report.mesh, report.mesh.topology
    points = report.points().astype(np.float64)
    return topology.centroids(mesh.along_curve(points), topology.positions[rows])
