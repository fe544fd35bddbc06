"""`untangle`, `perturb` and `quality` for meshes in memory, with the options of the command line."""

from __future__ import annotations

import os
import sys
from base64 import b64encode
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshfix_cli.errors import InvalidMeshError, OptionError, WriteError, naming
from meshfix_cli.mesh.elements import counted, words
from meshfix_cli.mesh.mesh import Mesh, mask_of
from meshfix_cli.meshfile.displaced import displaced, places_in
from meshfix_cli.meshfile.document import Document, build
from meshfix_cli.meshfile.reading import read
from meshfix_cli.meshfile.recognise import Format
from meshfix_cli.objects.kinds import Kind, kind_of, points_of
from meshfix_cli.objects.options import (
    OF_DOCUMENTS,
    Length,
    Names,
    Options,
    Perturbing,
    Solving,
    array_of,
    check_reference,
    held_of,
    judge_of,
    length_of,
    method_of,
    percent_of,
    seed_of,
    threads_of,
)
from meshfix_cli.quality.summary import Summary, summarise
from meshfix_cli.repair import Files, Held, Method, Sliding, as_surface, repair
from meshfix_cli.repair.judge import Judge
from meshfix_cli.report.sliding import sliding
from meshfix_cli.solve.perturb import perturb as perturb_mesh
from meshfix_cli.solve.perturb import tangled
from meshfix_cli.solve.records import Outcome, SweepRecord
from meshfix_cli.solve.strategies import FEATURE_ANGLE
from meshfix_cli.solve.untangle import untangle as untangle_mesh

if TYPE_CHECKING:
    from collections.abc import Sequence

    from typing_extensions import Unpack

    from meshfix_cli.report.facts import Report

M = TypeVar("M")
File = Document | str | os.PathLike[str]
_IN_MEMORY = Format("memory")


@dataclass(frozen=True, eq=False, repr=False)
class Result(Generic[M]):
    """What became of a mesh.

    Attributes
    ----------
    report : Report
        All that the command line tells.
    document : Document
        The mesh as it came.
    given : object
        What was given.
    kind : Kind or None
        What that is; None: a document or a path.
    """

    report: Report
    document: Document
    given: M
    kind: Kind | None = field(default=None)

    @property
    def mesh(self) -> M:
        """A mesh of the kind that was given, with all its data; of a path or a document it is a `Mesh`."""
        after: Any = self.after if self.kind is None else self.kind.moved(self.given, self.points)
        return after

    @property
    def points(self) -> NDArray[np.floating[Any]]:
        """The points (n, d), of the type that they came in."""
        return self.report.points()

    @property
    def after(self) -> Mesh:
        """The result."""
        return self.report.mesh

    @property
    def summary(self) -> Summary:
        """How good it is."""
        return self.report.result

    @property
    def valid(self) -> bool:
        """All elements are judged and none is inverted, and the mesh does not overlap itself."""
        return self.report.valid

    @property
    def met(self) -> bool:
        """All that was required of it holds."""
        return self.report.met

    @property
    def records(self) -> Sequence[SweepRecord]:
        """What each sweep did."""
        return self.report.records

    @property
    def notes(self) -> Sequence[str]:
        """What a user should know, a sentence each."""
        return (*self.report.notes, *sliding(self.report))

    def write(self, target: str | os.PathLike[str]) -> tuple[str, ...]:
        """Write it in the format that the name tells or the file had; return what that format does not hold."""
        from meshfix_cli.meshfile.formats import by_name
        from meshfix_cli.meshfile.writing import write

        if self.kind is not None and by_name(Path(target)) is None:
            raise WriteError(f"{os.fspath(target)}: its extension tells no format that is known")
        return write(self.document, self.after, target)[1]

    def __repr__(self) -> str:
        before, after = next(iter(self.report.stages.values())), self.summary
        worst = "smallest angle" if after.jacobians is None else "smallest scaled Jacobian"
        told = f"{after.inverted:,} of {after.elements:,} elements inverted ({before.inverted:,} before)"
        others = "".join(f", {counted(count, *words(key))} not judged" for key, count in self.report.not_judged.items())
        return f"<{type(self).__name__} {self.report.name}: {told}{others}, {worst} {after.smallest:.3g}>"

    def plot(self, **options: Any) -> Any:
        """Return a `pyvista.Plotter` with the mesh before and after, coloured by quality, what is inverted in red.

        Solids are cut open. `result.plot().show()` opens it, in a window or in the notebook.

        Parameters
        ----------
        options
            Of `pyvista.Plotter`, such as `off_screen=True`.

        Raises
        ------
        ImportError
            There is no pyvista.
        """
        from meshfix_cli.report.render import plotter

        return plotter(self.report, **options)

    def _repr_html_(self) -> str:
        """Return what the terminal shows, for a notebook, and to those who have imported pyvista a picture."""
        from meshfix_cli.report.terminal import as_html

        picture = None
        if "pyvista" in sys.modules:
            from meshfix_cli.report.render import png

            picture = png(self.report)
        shown = "" if picture is None else f'<img src="data:image/png;base64,{b64encode(picture).decode()}">'
        return as_html(self.report) + shown


@overload
def untangle(  # type: ignore[overload-overlap]
    mesh: Mesh, strategy: str = "auto", *, reference: Any = None, **options: Unpack[Options]
) -> Outcome: ...
@overload
def untangle(
    mesh: File, strategy: str = "auto", *, reference: Any = None, **options: Unpack[Options]
) -> Result[Mesh]: ...
@overload
def untangle(mesh: M, strategy: str = "auto", *, reference: Any = None, **options: Unpack[Options]) -> Result[M]: ...
def untangle(
    mesh: Any,
    strategy: str = "auto",
    *,
    reference: Any = None,
    displace: str | None = None,
    fix: Names = (),
    fixed: ArrayLike | None = None,
    regions: str | None = None,
    join_points: bool = False,
    require: Names = (),
    metrics: Names = (),
    threads: int = 1,
    **options: Any,
) -> Any:
    """Move interior vertices until no element is inverted, then improve the worst.

    Parameters
    ----------
    mesh : object
        A `meshio.Mesh`, a `pyvista.UnstructuredGrid`, `PolyData` or `StructuredGrid`, one of VTK, a path, a `Document`,
        or points (n, 2 or 3) and cells as a pair: cells as an array (m, k), as arrays by their types, or as blocks of
        meshio. It is not changed. Of a `Mesh` the boundary is held.
    strategy : str
        A key of `STRATEGIES`: see `meshfix untangle --help`.
    reference : object, optional
        The same mesh before its boundary moved, of any of these kinds.
    displace : str, optional
        An array of point data, vectors by which points move first; the mesh as it came is the reference then.
    fixed : (n,) bool or (k,) int, optional
        Points that are held, as a mask or by their indices.
    fix, regions, join_points, require, metrics
        See `meshfix untangle --help`; metrics are those of `--metric`.
    threads : int
        The result has the same bits for any number.
    options
        `sweeps`, `smooth`, `threshold`, `max_move`, `only_invalid`, `slide`, `slide_interfaces`, `feature_angle`,
        `max_deviation`, `curving` of the command line. Lengths are numbers in model units, or texts such as "2h".

    Returns
    -------
    Result
        Of a `Mesh` an `Outcome`.

    Raises
    ------
    MeshfixError
        `OptionError` for an option, else with the sentence that the command line has.
    """
    method, threads = method_of({"strategy": strategy, **options}), threads_of(threads)
    held, judge = held_of(fix, regions, join_points), judge_of(metrics, require, threads)
    for option, is_given in (("reference", reference is not None), ("displace", array_of("displace", displace))):
        if is_given:
            check_reference(option, method)
    if isinstance(mesh, Mesh):
        _check_bare(held != Held() or displace or require or metrics, options)
        if not (reference is None or isinstance(reference, Mesh)):
            reference = _document(reference, Held(), None, threads)[0].mesh
        return _of_mesh(_with_fixed(mesh, fixed), method, reference, threads)
    document, kind = _document(mesh, held, fixed, threads)
    moved = document if displace is None else displaced(document, displace)
    before = document if reference is None and displace is not None else reference
    places = None
    if before is not None:
        with naming(document.name):
            referred = _document(before, Held(join_points=join_points), None, threads)[0]
        with naming(document.name if reference is None else f"{document.name}: as a reference"):
            places = places_in(referred, moved, threads)
    report = repair(moved, moved.format, Files(dry_run=True), method, judge, reference=places)
    return Result(report, moved, mesh, kind)


@overload
def perturb(  # type: ignore[overload-overlap]
    mesh: Mesh, percent: float, dist: Length, seed: int = 0, *, fixed: ArrayLike | None = None, threads: int = 1
) -> tuple[Mesh, int]: ...
@overload
def perturb(mesh: File, percent: float, dist: Length, seed: int = 0, **options: Unpack[Perturbing]) -> Result[Mesh]: ...
@overload
def perturb(mesh: M, percent: float, dist: Length, seed: int = 0, **options: Unpack[Perturbing]) -> Result[M]: ...
def perturb(
    mesh: Any,
    percent: float,
    dist: Length,
    seed: int = 0,
    *,
    slide: Sliding = "none",
    feature_angle: float = FEATURE_ANGLE,
    fix: Names = (),
    fixed: ArrayLike | None = None,
    regions: str | None = None,
    join_points: bool = False,
    threads: int = 1,
) -> Any:
    """Tangle a mesh as the paper does: move some interior vertices by a distance in random directions.

    Parameters
    ----------
    mesh : object
        See `untangle`.
    percent : float
        Of all vertices; where that is more than there are free vertices, all of those move.
    dist : float or str
        In model units, or a text such as "2h".
    seed : int
    slide, feature_angle, fix, fixed, regions, join_points, threads
        See `untangle`.

    Returns
    -------
    Result
        Of a `Mesh` the moved mesh, and how many vertices have moved.
    """
    length, method = length_of("dist", dist), method_of({"slide": slide, "feature_angle": feature_angle})
    percent, seed, threads = percent_of(percent), seed_of(seed), threads_of(threads)
    held = held_of(fix, regions, join_points)
    if isinstance(mesh, Mesh):
        _check_bare(held != Held(), {} if method == Method() else {"slide": slide})
        return perturb_mesh(_with_fixed(mesh, fixed), percent, length.length(mesh, threads), seed)
    document, kind = _document(mesh, held, fixed, threads)
    document = method.freed(document)
    moved, facts = tangled(document.mesh, percent, length, seed, threads)
    stages = {"before": document.mesh, "perturbed": document.as_stored(moved)}
    notes = method.without_effect(document.mesh)
    return Result(Judge(threads=threads).report("perturb", document, stages, notes, facts=facts), document, mesh, kind)


def quality(mesh: Any, metrics: Names = (), *, threads: int = 1) -> Summary:
    """Tell how good a mesh is.

    Parameters
    ----------
    mesh : object
        See `untangle`.
    metrics : sequence of str
        Those of `--metric`.
    threads : int
    """
    judge = judge_of(metrics, (), threads_of(threads))
    if not isinstance(mesh, Mesh):
        mesh = as_surface(_document(mesh, Held(), None, judge.threads)[0]).mesh
    return summarise(mesh, judge.metrics, judge.threads)


class Repairer:
    """Repairs one mesh again and again as its points move; the mesh is built once.

    Parameters
    ----------
    mesh : object
        See `untangle`.
    towards : bool
        Elements get the shapes back that they have in it; it is valid then.
    strategy, fix, fixed, regions, join_points, threads, options
        See `untangle`.

    Attributes
    ----------
    outcome : Outcome or None
        That of the last call.
    """

    def __init__(
        self,
        mesh: Any,
        strategy: str = "auto",
        *,
        towards: bool = False,
        fix: Names = (),
        fixed: ArrayLike | None = None,
        regions: str | None = None,
        join_points: bool = False,
        threads: int = 1,
        **options: Unpack[Solving],
    ) -> None:
        self.outcome: Outcome | None = None
        self._method, self._threads = method_of({"strategy": strategy, **options}), threads_of(threads)
        if towards:
            check_reference("towards", self._method)
        self._document = _document(mesh, held_of(fix, regions, join_points), fixed, threads)[0]
        self._places: NDArray[np.float64] | None = None
        if towards:
            with naming(self._document.name):
                self._places = places_in(self._document, self._document, threads)

    def __call__(self, points: ArrayLike) -> NDArray[np.floating[Any]]:
        """Return points (n, d) near given ones at which no element is inverted, where that can be.

        Raises
        ------
        InvalidMeshError
            They are no numbers, of another shape, or not finite.
        """
        document = self._at(points_of(points))
        freed = self._method.freed(document)  # the boundary is to be where it has been moved
        reach = self._method.reach(document.mesh, self._threads)
        outcome = self._method.solve(freed.mesh, reach, self._threads, reference=self._places)
        self.outcome = replace(outcome, all_judged=not document.not_judged)
        return freed.file_points(freed.first_valid_as_stored(self.outcome.after, self.outcome.before)[0])

    def _at(self, points: NDArray[Any]) -> Document:
        document = self._document
        there = document.source.points
        if points.shape != there.shape:
            raise InvalidMeshError(
                f"the points are an array of shape {points.shape}, and those of the mesh {there.shape}"
            )
        moved = points.astype(there.dtype)
        if not np.isfinite(moved[document.mesh.used]).all():
            raise InvalidMeshError("there are points that are not finite")
        return replace(document, mesh=document.in_plane(moved.astype(np.float64), document.mesh), displaced=moved)


def _of_mesh(mesh: Mesh, method: Method, reference: Mesh | None, threads: int) -> Outcome:
    return untangle_mesh(
        mesh, method.strategy, sweeps=method.sweeps, smooth=method.smooth, threshold=method.threshold,
        max_move=method.reach(mesh, threads),
        only_invalid=method.only_invalid, reference=reference, threads=threads,
    )  # fmt: skip


def _check_bare(given: object, options: Any) -> None:
    """Refuse what a bare mesh has lost."""
    if given or set(options) & set(OF_DOCUMENTS):
        raise OptionError(
            "a Mesh has neither names nor the shape of its boundary: give the document that `read` returns, for "
            f"fix, regions, join_points, displace, require, metrics, {', '.join(OF_DOCUMENTS)}"
        )


def _with_fixed(mesh: Mesh, fixed: ArrayLike | None) -> Mesh:
    return mesh if fixed is None else mesh.with_fixed(mask_of(fixed, len(mesh.points)))


def _document(mesh: Any, held: Held, fixed: ArrayLike | None, threads: int) -> tuple[Document, Kind | None]:
    """Return a document of a mesh, and what kind of object it is; None: a document or a path."""
    if isinstance(mesh, Document):
        if fixed is not None or held != Held():
            raise OptionError("a document has been read: give fix, fixed, regions and join_points to `read`")
        return mesh, None
    if isinstance(mesh, Result):
        raise InvalidMeshError("a Result is no mesh: give its `mesh`")
    if isinstance(mesh, str | os.PathLike):
        return read(mesh, held.fix, held.regions, fixed=fixed, join_points=held.join_points, threads=threads), None
    kind = kind_of(mesh)
    if isinstance(mesh, Mesh):
        fixed = ~_with_fixed(mesh, fixed).movable
    with naming(kind.name):
        source = kind.source(mesh)
        return build(kind.name, source, _IN_MEMORY, held.fix, held.regions, held.join_points, threads, fixed), kind
