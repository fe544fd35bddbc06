"""`meshfix batch`."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from meshfix_cli.cli.files import check_input, check_others, given
from meshfix_cli.cli.help import IN_OUT, PROCESS, Command, under
from meshfix_cli.cli.names import FILE, FOLDER
from meshfix_cli.cli.options import (
    REPORTS,
    Show,
    allowing,
    check_morph,
    chosen,
    holding,
    morphing,
    packed,
    requiring,
    showing,
    solving,
    storing,
)
from meshfix_cli.cli.process import SOME_FAILED, VALID, abort_all, complain, cores, courses, find_processes, helpers
from meshfix_cli.errors import WriteError
from meshfix_cli.mesh.elements import counted
from meshfix_cli.repair import Files, Held, Method, Morph
from meshfix_cli.repair.judge import Judge

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from meshfix_cli.quality.requirement import Requirement
    from meshfix_cli.report.tally import Tally
    from meshfix_cli.workers.batch import Result, Task


EXECUTORS = ("processes", "mpi", "dask")


class _Shard(click.ParamType):  # type: ignore[type-arg]
    name = "I/N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if isinstance(value, slice):
            return value
        which, slash, count = value.partition("/")
        if slash and which.isdecimal() and count.isdecimal() and 1 <= int(which) <= int(count):
            return slice(int(which) - 1, None, int(count))
        return self.fail(f"{value!r} is not such as 1/8, the first of eight parts", param, ctx)


@dataclass(frozen=True)
class _Listed:
    """Which files are repaired, and what is kept of them."""

    sources: tuple[str, ...]
    files_from: str | None
    shard: slice | None
    output_dir: str
    page: str | None
    json: str | None

    @property
    def reports(self) -> list[str]:
        """Files for a report on all, which are asked for."""
        return given(self.page, self.json)

    def report(self, task: Task, files: Sequence[Mapping[str, Any]], total: int, tally: Tally) -> None:
        """Write them, of the files that are done."""
        from meshfix_cli.meshfile.atomic import write_text
        from meshfix_cli.report.as_json import batch_json

        if self.json is not None:
            write_text(self.json, batch_json(task.options, files, total))
        if self.page is not None:
            from meshfix_cli.report.page.many import page_of_many

            write_text(self.page, page_of_many(files, total, tally, chosen()))

    def pairs(self, reference: str | None = None, *, absolute: bool) -> list[tuple[str, str]]:
        """Inputs and outputs, checked before any work: none replaces one that is read."""
        from meshfix_cli.workers.batch import distinct, expanded, named_in, outputs

        if self.files_from is not None:
            check_input(self.files_from)
        try:
            names = [*expanded(self.sources), *(named_in(self.files_from) if self.files_from is not None else ())]
            sources = distinct(os.path.abspath(name) if absolute else name for name in names)  # noqa: PTH100
            folder = os.path.abspath(self.output_dir) if absolute else self.output_dir  # noqa: PTH100
            pairs = list(zip(sources, outputs(sources, folder, self.reports, given(reference)), strict=True))
        except ValueError as error:
            raise click.UsageError(str(error)) from error
        if not pairs:
            raise click.UsageError("there is no IN; name files, or use --files-from")
        _make_folder(folder)
        check_others(self.reports)
        return pairs[self.shard or slice(None)]


def _make_folder(folder: str) -> None:
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        what = "is not a folder" if Path(folder).exists() else f"cannot be made: {error.strerror}"
        raise WriteError(f"{folder}: {what}") from error
    if not os.access(folder, os.W_OK):
        raise WriteError(f"{folder}: is not writable")


@dataclass(frozen=True)
class _Counted:
    """How far a batch is."""

    tally: Tally
    total: int

    def hears(self) -> str:
        """Let it be ended: a batch is resumed."""
        return ""

    def ended(self) -> str:
        """Say how many files are done."""
        return f"interrupted, {self.tally.statuses.total():,} of {counted(self.total, 'file', 'files')} done"


@dataclass(frozen=True)
class _Run:
    """Where the work is done."""

    executor: str
    scheduler_file: str | None
    jobs: int | None

    @contextmanager
    def workers(self) -> Iterator[tuple[Executor | None, int]]:
        """An executor, None in a process that has worked for another, and how many files it has at once."""
        if (self.executor == "dask") != (self.scheduler_file is not None):
            raise click.UsageError("--executor dask and --scheduler-file go together")
        if self.executor == "processes":
            from meshfix_cli.workers.batch import Pool

            jobs = self.jobs or cores()
            with Pool(jobs) as pool:
                yield pool, jobs
            return
        with self._cluster() as (executor, count):
            if count == 0:
                click.echo("meshfix: there is no worker yet; waiting for the first", err=True)
            yield executor, self.jobs or 2 * max(1, count)  # one that is worked on, and one that is on its way

    def _cluster(self) -> AbstractContextManager[tuple[Executor | None, int]]:
        if self.scheduler_file is not None:
            from meshfix_cli.workers import dask

            return dask.workers(self.scheduler_file)
        from meshfix_cli.workers import mpi

        return mpi.workers(find_processes(), abort_all)


_listing = packed(
    "listed",
    _Listed,
    click.argument("sources", metavar="[IN]...", nargs=-1, type=FILE),
    under(
        IN_OUT,
        "--output-dir",
        type=FOLDER,
        metavar="DIR",
        required=True,
        help="Outputs go here, under the names of the inputs.",
    ),
    under(IN_OUT, "--files-from", type=FILE, metavar="FILE|-", help="Read names of more inputs, one a line."),
    under(PROCESS, "--shard", type=_Shard(), help="Take every N-th file from the I-th on, for job I of N."),
    *REPORTS,
)
_running = packed(
    "where",
    _Run,
    under(
        PROCESS,
        "--executor",
        type=click.Choice(EXECUTORS),
        default=EXECUTORS[0],
        show_default=True,
        help="Processes on this machine, those that mpiexec has started, or the workers of a Dask cluster.",
    ),
    under(PROCESS, "--scheduler-file", type=FILE, metavar="FILE", help="Of the Dask cluster."),
    under(
        PROCESS,
        "--jobs",
        type=click.IntRange(1, 1024),
        help="Files at once, each on one thread. [default: a process for each core; of a cluster twice its workers]",
    ),
)


EXAMPLES = (
    ("All meshes of a folder", "meshfix batch 'meshes/*.vtk' --output-dir repaired"),
    ("Go on with a batch that was killed", "meshfix batch --resume 'meshes/**/*.vtk' --output-dir repaired"),
    (
        "Each with the shapes of before a morph",
        "meshfix batch --reference mesh.vtk 'meshes/*.vtk' --output-dir repaired",
    ),
    ("The first of eight parts of the work", "meshfix batch --shard 1/8 'meshes/*.vtk' --output-dir repaired"),
)


@click.command(cls=Command, examples=EXAMPLES, short_help="Untangle many meshes at once.")
@_listing
@_running
@under(IN_OUT, "--resume", is_flag=True, help="Skip a file whose output is not older, and valid.")
@storing
@solving
@morphing
@allowing
@requiring
@holding
@showing
def batch(
    listed: _Listed,
    where: _Run,
    resume: bool,
    files: Files,
    method: Method,
    morph: Morph,
    allow_inverted: bool,
    requirements: tuple[Requirement, ...],
    held: Held,
    show: Show,
) -> None:
    """Untangle many meshes at once, each into the file of its name in another folder.

    IN is a file or a quoted pattern such as 'run*/**/*.vtk'. A bad file costs only itself. Prints a line for each as
    it is done, then a summary. Exits with 0 where all are valid, and with 4 where some are not or failed.
    """
    from meshfix_cli.report.tally import Tally, kept
    from meshfix_cli.workers.batch import Task, run

    check_morph(morph, method)
    helpers.add("workers")
    with where.workers() as (executor, in_flight):
        if executor is None:
            return
        far = where.executor == "dask"
        if morph.reference is not None:
            held.read_reference(morph.reference, show.threads)  # what is wrong with it is told once, before any work
            morph = replace(morph, reference=os.path.abspath(morph.reference)) if far else morph  # noqa: PTH100
        pairs = listed.pairs(morph.reference, absolute=far)
        judge = Judge(show.metrics, requirements, brief=show.quiet and not listed.reports)
        task = Task(files, held, morph, method, judge, resume)
        passed, done, tally = True, {}, Tally()
        courses[:] = [_Counted(tally, len(pairs))]
        try:
            for result in _told(run(executor, (task.at(*pair) for pair in pairs), in_flight), len(pairs), show, tally):
                passed &= _passes(result, allow_inverted)
                if listed.reports:
                    done[result["file"]] = kept(result)
        finally:  # also where the batch is stopped
            listed.report(task, [done[source] for source, _ in pairs if source in done], len(pairs), tally)
    sys.exit(VALID if passed else SOME_FAILED)


def _told(results: Iterator[Result], total: int, show: Show, tally: Tally) -> Iterator[Result]:
    """Pass results through, count and print each, then print their summary."""
    from meshfix_cli.report.tally import why
    from meshfix_cli.report.terminal import console, print_result, print_tally, with_counts

    start, out, plain = time.perf_counter(), console(sys.stdout), not (show.quiet or show.as_json)
    for result in with_counts(results, total, console(sys.stderr)) if plain else results:
        if result["status"] == "failed":
            complain(f"{result['file']}: {why(result)}")
        if not show.quiet:
            print_result(result, out, show.as_json)
        tally.add(result)
        yield result
    if plain:
        print_tally(tally, time.perf_counter() - start, out)


def _passes(result: Result, allow_inverted: bool) -> bool:
    if allow_inverted and result["status"] == "invalid":
        return all(one["met"] for one in result["requirements"])
    return result["status"] in ("valid", "skipped")
