"""One mesh from file to file: what `meshfix untangle` does, for one command and for each file of a batch.

Light to import: the command line reads the fields of the classes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from meshfix_cli.errors import WriteError, listed, naming
from meshfix_cli.mesh.elements import counted
from meshfix_cli.solve import strategies
from meshfix_cli.solve.perturb import Distance
from meshfix_cli.solve.strategies import SMOOTH, THRESHOLD, Smooth, plan

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from meshfix_cli.mesh import curved
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.meshfile.document import Document
    from meshfix_cli.meshfile.recognise import Format
    from meshfix_cli.meshfile.writing import Put
    from meshfix_cli.repair.judge import Judge
    from meshfix_cli.report.facts import Report
    from meshfix_cli.solve.records import Outcome, SweepRecord
    from meshfix_cli.solve.team import Team

    Steps = Iterator[tuple[Mesh, SweepRecord]]


Sliding = Literal["none", "flat", "curved"]
Curving = Literal["hold", "relax"]
CURVINGS: tuple[Curving, ...] = get_args(Curving)
SLIDES: tuple[Sliding, ...] = get_args(Sliding)  # the later, the more vertices move
MAX_DEVIATION = Distance(strategies.MAX_DEVIATION, in_h=True)


@dataclass(frozen=True)
class Held:
    """What is held still beside the boundary, and what is one point: see `reading.read`."""

    fix: tuple[str, ...] = ()
    regions: str | None = None
    join_points: bool = False
    input_format: str | None = None

    def read(self, source: str, threads: int, *, double: bool = False, fix_orientation: bool = False) -> Document:
        """Read a mesh; the errors are those of `reading.read`."""
        from meshfix_cli.meshfile.reading import read

        return read(
            source, self.fix, self.regions, double=double, fix_orientation=fix_orientation,
            join_points=self.join_points, form=self.input_format, threads=threads,
        )  # fmt: skip

    def read_reference(self, source: str, threads: int) -> Document:
        """Read a mesh whose points only are asked for: what is held in it is not."""
        return replace(self, fix=(), regions=None, input_format=None).read(source, threads)


@dataclass(frozen=True)
class Morph:
    """How the boundary came to be where it is: the mesh from before that, or the vectors by which points move."""

    reference: str | None = None
    displace: str | None = None

    def of(self, first: Document, held: Held, threads: int) -> tuple[Document, NDArray[np.float64] | None]:
        """Return the document, displaced if it is to be, and where its vertices were, as `untangle.steps` takes it.

        Raises
        ------
        ReadError, InvalidMeshError
            Also where the elements are others.
        """
        if self == Morph():
            return first, None
        from meshfix_cli.meshfile.displaced import displaced, places_in

        document = first if self.displace is None else displaced(first, self.displace)
        if self.reference is None:
            with naming(first.name):
                return document, places_in(first, document, threads)
        reference = held.read_reference(self.reference, threads)
        with naming(f"{self.reference}: as a reference"):
            return document, places_in(reference, document, threads)


@dataclass(frozen=True)
class Files:
    """The file that is read and the one that is written; the fields are the options of the command line."""

    source: str = "-"
    target: str = "-"
    form: str | None = None
    double: bool = False
    fix_orientation: bool = False
    backup: bool = False
    dry_run: bool = False

    def open(self, held: Held, threads: int) -> tuple[Document, Format]:
        """Read the mesh, and find out before any work whether the output can be written.

        Raises
        ------
        ReadError, InvalidMeshError, WriteError
        """
        from meshfix_cli.meshfile.atomic import check_target
        from meshfix_cli.meshfile.writing import check_output, output_format

        if not self.dry_run and not Path(self.target).is_dir():  # which only the mesh tells whether it may be
            check_target(self.target)
        document = held.read(self.source, threads, double=self.double, fix_orientation=self.fix_orientation)
        output = output_format(document, self.target, self.form)
        if not self.dry_run:
            check_output(document, self.target, output)
        if document.is_file(self.target) and not (document.is_kept_by(output) or self.backup or self.dry_run):
            lost = f"would be written anew as {output.name}, which may not hold all of it"
            raise WriteError(f"{self.target}: {lost}; name another OUTPUT, or use --backup")
        return document, output

    def write(
        self, document: Document, mesh: Mesh, output: Format, put: Put | None = None
    ) -> tuple[Mesh, tuple[str, ...]]:
        """Write a moved mesh; return it as the file holds it, and what the user should know."""
        from meshfix_cli.meshfile.writing import other_format, unknown_extension, write

        if self.dry_run:
            return document.as_stored(mesh), ()
        notes: tuple[str, ...] = ()
        unknown = unknown_extension(document, self.target) if self.form is None else None
        if unknown is not None:
            notes = (f"{self.target}: the extension {unknown} is not known, so it is written as {output.reader}",)
        other = other_format(document, self.target) if self.form is None else None
        if other is not None:
            written = f"it is written as {output.reader}, as the input is"
            notes = (f"{self.target}: the extension is also that of {other}; {written}",)
        stored, dropped = write(document, mesh, self.target, output, self.backup, put)
        if document.is_kept_by(output) or document.is_as_read(stored, output):
            return stored, notes
        lost = f"; dropped: {listed(dropped)}" if dropped else ""
        if output.reader != document.format.reader:
            return stored, (*notes, f"converted from {document.format.name} to {output.name}{lost}")
        if not lost and (document.source.data is None or b"\0" in document.source.data):
            lost = ": what it does not know of the input is lost"
        return stored, (*notes, f"written anew as {output.name}{lost}")


@dataclass(frozen=True)
class Method:
    """How a mesh is untangled and smoothed; the fields are those of `untangle.steps` and `strategies.plan`.

    `slide` and `slide_interfaces` tell which vertices of the boundary and of interfaces move as well, where that does
    not change the shape, or, with "curved", by little; see `curved.Smooth` for the next two, of which h is that of the
    boundary. With `curving` "relax" curved edges of the boundary become straighter where elements cannot be valid
    otherwise.
    """

    strategy: str = "auto"
    sweeps: int | None = None
    smooth: Smooth = SMOOTH
    threshold: float | None = None
    max_move: Distance | None = None
    only_invalid: bool = False
    slide: Sliding = "none"
    slide_interfaces: bool = True
    feature_angle: float = strategies.FEATURE_ANGLE
    max_deviation: Distance = MAX_DEVIATION
    curving: Curving = "hold"

    def freed(
        self, document: Document, reference: NDArray[np.float64] | None = None, with_shape: bool = True
    ) -> Document:
        """Return a document in which vertices may slide, if they are to.

        `reference`: see `untangle.steps`; not where the boundary was displaced, which says where it is to be.
        `with_shape`: see `surface.laid_out`; `solve` gives surfaces theirs.
        """
        if document.mesh.surface is not None:
            return self.on_surface(document, reference, with_shape=with_shape)
        if self.slide == "none" or document.mesh.quadratic is not None:  # corners and nodes would part
            return document
        from meshfix_cli.meshfile.sliding import slid

        smooth = self._smooth(document, reference) if self.slide == "curved" else None
        return slid(document, self.slide_interfaces, reference, smooth=smooth)

    def on_surface(
        self,
        document: Document,
        reference: NDArray[np.float64] | None = None,
        threads: int = 1,
        with_shape: bool = True,
    ) -> Document:
        """Return a document of a surface in which vertices slide on it, as they always do; see `surface.laid_out`."""
        from meshfix_cli.meshfile.surfaces import on_surface

        smooth = self._smooth(document, reference)
        return on_surface(document, smooth, self.slide, self.slide_interfaces, reference, threads, with_shape)

    def _smooth(self, document: Document, reference: NDArray[np.float64] | None) -> curved.Smooth:
        from meshfix_cli.mesh.curved import Smooth

        mesh = document.mesh if reference is None else document.mesh.with_vertices(reference)
        return Smooth(self.feature_angle, self.max_deviation.on_boundary(mesh))

    def without_effect(self, mesh: Mesh) -> tuple[str, ...]:
        """Say what of it means nothing for a mesh."""
        if self.slide == "none" or mesh.quadratic is None:
            return ()
        return (f"--slide {self.slide} has no effect: the boundary of curved elements does not slide",)

    def reach(self, mesh: Mesh, threads: int) -> float:
        """Return how far vertices may move, in model units."""
        return math.inf if self.max_move is None else self.max_move.length(mesh, threads)

    def steps(
        self,
        mesh: Mesh,
        reach: float,
        threads: int,
        hopeless: NDArray[np.bool_] | None = None,
        team: Team | None = None,
        reference: NDArray[np.float64] | None = None,
    ) -> Steps:
        """Run the phases, see `untangle.steps`."""
        from meshfix_cli.solve.untangle import steps

        phases = plan(self.strategy, self.smooth, self.only_invalid, reference is not None)
        return steps(
            mesh, phases, sweeps=self.sweeps, threshold=self.threshold, max_move=reach, only_invalid=self.only_invalid,
            hopeless=hopeless, reference=reference, threads=threads, team=team,
        )  # fmt: skip

    def solve(
        self,
        mesh: Mesh,
        reach: float,
        threads: int,
        watch: Callable[[Steps], Steps] = iter,
        reference: NDArray[np.float64] | None = None,
    ) -> Outcome:
        """Run them to the end; `watch` passes the steps through, to show them."""
        from meshfix_cli.quality.obstacles import find_obstacles
        from meshfix_cli.solve.records import Outcome, drain

        if mesh.quadratic is not None:  # what is impossible may change, as its boundary may
            found = drain(watch(self._curved_steps(mesh, reach, threads, reference)))
            return Outcome(*found, find_obstacles(found[2], threads))
        if mesh.surface is not None:  # what a fold feigns to be features is free in the end
            from meshfix_cli.solve.surface import solved

            return solved(watch(self._surface_steps(mesh, reach, threads)), threads)
        obstacles = find_obstacles(mesh, threads)
        run = self.steps(mesh, reach, threads, obstacles.hopeless(mesh), reference=reference)
        return Outcome(*drain(watch(run)), obstacles)

    def _surface_steps(self, mesh: Mesh, reach: float, threads: int) -> Steps:
        """Run what surfaces need, see `surface.surface_steps`."""
        from meshfix_cli.solve.surface import surface_steps

        smoothing = partial(self.steps, reach=reach, threads=threads)
        untangling = partial(replace(self, smooth=0).steps, reach=reach, threads=threads)
        return surface_steps(mesh, untangling, smoothing, reach, threads)

    def _curved_steps(
        self, mesh: Mesh, reach: float, threads: int, reference: NDArray[np.float64] | None = None
    ) -> Steps:
        """Run what curved elements need, see `quadratic.curved_steps`."""
        from meshfix_cli.solve.curved_shape import WELL
        from meshfix_cli.solve.quadratic import curved_steps

        smooth: Smooth = 0 if self.only_invalid or not self.smooth else "best" if self.smooth == "best" else SMOOTH
        threshold = THRESHOLD[mesh.dimension] if self.threshold is None else self.threshold
        highest = {0: None, "best": 1.0}.get(smooth, min(math.sin(math.radians(threshold)), WELL))
        untangling = replace(self, smooth=smooth)
        straight = partial(untangling.steps, reach=reach, threads=threads, reference=reference)
        return curved_steps(
            mesh, straight, highest=highest, relax=self.curving == "relax", max_move=reach, threads=threads,
            sweeps=self.sweeps,
        )  # fmt: skip


def as_surface(document: Document) -> Document:
    """Return a document in which the vertices of a surface slide on it, if it is one, and its features are held."""
    return document if document.mesh.surface is None else Method().on_surface(document)


def repair(
    document: Document,
    output: Format,
    files: Files,
    method: Method,
    judge: Judge,
    solve: Callable[..., Outcome] | None = None,
    put: Put | None = None,
    reference: NDArray[np.float64] | None = None,
    begin: Callable[[str], object] = lambda _: None,
) -> Report:
    """Untangle and smooth a mesh, write it and report.

    Parameters
    ----------
    document, output
        What `files.open` gave.
    files : Files
    method : Method
    judge : Judge
    solve : callable
        (mesh, how far vertices may move in model units, reference=) -> Outcome; default: `method.solve`.
    put : callable
        See `writing.write`.
    reference : (k, d) float64
        Gives elements their shapes, see `untangle.steps`.
    begin : callable
        Is told when "writing" begins, and "judging".

    Raises
    ------
    WriteError, InvalidMeshError, RequirementError
        Nothing was written.
    """
    from meshfix_cli.quality.summary import displacement
    from meshfix_cli.report.happened import folded_at_first, of_boundary, what_happened

    judge.check(document)
    threads = judge.threads
    reach = method.reach(document.mesh, threads)
    solve = partial(method.solve, threads=threads) if solve is None else solve
    document, outcome, slid = _solved(document, method, partial(solve, reference=reference), reach, reference)
    meshes = outcome.after, outcome.untangled, outcome.before
    after, rounded = document.first_valid_as_stored(*meshes, threads=threads)
    begin("writing")
    # Processes write what they hold: not the nodes between corners.
    result, written = files.write(document, after, output, put if document.ties is None else None)
    begin("judging")
    asked = method.smooth and not method.only_invalid and reference is None
    happened = what_happened(
        outcome, after, all_judged=not document.not_judged, asked=bool(asked), rounded=rounded,
        kind=document.source.points.dtype.name,
    )  # fmt: skip
    notes = (*slid, *happened, *written)
    if result.surface is not None:
        from meshfix_cli.meshfile.surfaces import laid_as

        notes += folded_at_first(outcome, reference is not None)
        document = laid_as(document, outcome.after)
    if result.quadratic is not None:
        notes += of_boundary(document.mesh, result, method.curving, reach, threads)
    stages = {"before": outcome.before, "untangled": outcome.untangled, "smoothed": result}
    facts: dict[str, Any] = {"strategy": method.strategy, "displacement": displacement(outcome.before, result)}
    if outcome.ranks:
        facts["ranks"] = [asdict(rank) for rank in outcome.ranks]
    if method.max_move is not None:
        facts["max_move"] = reach
    return judge.report(
        "untangle", document, stages, notes, outcome.obstacles, reference, records=outcome.records, facts=facts
    )


def _solved(
    document: Document,
    method: Method,
    solve: Callable[..., Outcome],
    reach: float,
    reference: NDArray[np.float64] | None,
) -> tuple[Document, Outcome, tuple[str, ...]]:
    """Solve a mesh in which vertices slide as they may; where that leads astray, less, and say so.

    What counts is what the file will hold: boundaries of few digits may have been smoothed away from what these allow.
    """
    if document.mesh.quadratic is not None:
        return document, solve(document.mesh, reach), method.without_effect(document.mesh)
    shape = reference if document.displaced is None else None
    freed = method.freed(document, shape, with_shape=False)
    outcome = solve(freed.mesh, reach)
    notes: tuple[str, ...] = ()
    rounded = 0  # elements that rounding has inverted: then less may be better also where it is valid
    for slide in SLIDES[: SLIDES.index(method.slide)][::-1]:
        left, rounded = outcome.records[-1].inverted, rounded or freed.first_valid_as_stored(outcome.after)[1]
        if not (left or rounded):
            break
        other = replace(method, slide=slide).freed(document, shape, with_shape=False)
        instead = solve(other.mesh, reach)
        if _rank(other, instead) < _rank(freed, outcome):
            freed, outcome = other, instead
            inverted, why = counted(left or rounded, "element", "elements"), "" if left else ", rounded for the file,"
            notes = (f"--slide {method.slide}{why} would leave {inverted} inverted, so that --slide {slide} is taken",)
    if freed.mesh.freedom is not None:
        from meshfix_cli.meshfile.sliding import held_back

        notes += tuple(held_back(freed, outcome.after, method.feature_angle))
    return freed, outcome, notes


def _rank(document: Document, outcome: Outcome) -> tuple[int, float]:
    """Return how good is what a file will hold: the smaller the better."""
    from meshfix_cli.quality.summary import summarise

    mesh, _ = document.first_valid_as_stored(outcome.after, outcome.untangled, outcome.before)
    stored = summarise(document.as_stored(mesh))
    return stored.inverted, -stored.smallest
