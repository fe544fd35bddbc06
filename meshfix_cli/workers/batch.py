"""Many meshes: which files, one task for each, and whatever executor runs them."""

from __future__ import annotations

import glob
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from multiprocessing import connection
from pathlib import Path
from typing import Any

from meshfix_cli.errors import MeshfixError, ReadError, on_one_line
from meshfix_cli.meshfile.reading import pieces_of
from meshfix_cli.repair import Files, Held, Method, Morph, repair
from meshfix_cli.repair.judge import Judge
from meshfix_cli.report.as_json import SCHEMA, to_json
from meshfix_cli.report.facts import Report

GRACE = 10.0  # seconds that a worker has to clear up once it must end

Result = dict[str, Any]


def named_in(source: str) -> list[str]:
    """Return the file names in a list, one a line; "-" is stdin.

    Raises
    ------
    ReadError
    """
    try:
        data = sys.stdin.buffer.read() if source == "-" else Path(source).read_bytes()
    except OSError as error:
        raise ReadError(f"{source}: {error.strerror or error}") from error
    lines = (line.rstrip(b"\r") for line in data.split(b"\n"))
    return [os.fsdecode(line) for line in lines if line.strip()]


def expanded(names: Iterable[str]) -> Iterator[str]:
    """Replace each pattern by the files that match it, sorted; `**` stands for folders.

    Raises
    ------
    ValueError
        In one sentence: no file matches.
    """
    for name in names:
        if not glob.has_magic(name) or Path(name).exists():
            yield name
            continue
        found = sorted(path for path in glob.iglob(name, recursive=True) if Path(path).is_file())  # noqa: PTH207
        if not found:
            raise ValueError(f"no file matches {name!r}")
        yield from found


def distinct(names: Iterable[str]) -> list[str]:
    """Leave out names of files that were named before."""
    first: dict[str, str] = {}
    for name in names:
        first.setdefault(os.path.abspath(name), name)  # noqa: PTH100 (links stay: they have names of their own)
    return list(first.values())


def outputs(sources: Sequence[str], folder: str, reports: Sequence[str] = (), read: Sequence[str] = ()) -> list[str]:
    """Return the name of each output, which is that of the input in another folder.

    Parameters
    ----------
    sources : sequence of str
    folder : str
    reports : sequence of str
        More files to be written.
    read : sequence of str
        More files that are read.

    Raises
    ------
    ValueError
        In one sentence: two files to be written are the same, or one is an input.
    """
    targets = [os.path.join(folder, os.path.basename(source)) for source in sources]  # noqa: PTH118, PTH119
    pieces = [(source, *pieces_of(source, target)) for source, target in zip(sources, targets, strict=True)]
    inputs = {os.path.realpath(source): source for source in (*read, *sources)}  # links to one file are repaired each
    for source, paths, _ in pieces:
        for path in paths:
            other = inputs.setdefault(os.path.realpath(path), source)
            if other != source:
                is_input = os.path.realpath(path) == os.path.realpath(other)
                shared = "an input" if is_input else f"a piece of {other}"
                raise ValueError(f"{path} is a piece of {source}, and {shared} as well")
    for name in read:
        for path in pieces_of(name, name)[0]:
            inputs.setdefault(os.path.realpath(path), name)
    pairs = [*zip(sources, targets, strict=True), *zip(reports, reports, strict=True)]
    pairs += [(source, target) for source, _, made in pieces for target in made]
    written: dict[str, str] = {}
    for source, target in pairs:
        place = os.path.realpath(target)
        if place in inputs:
            target = f"the report {target}" if source in reports else target
            raise ValueError(f"{target} would replace the input {inputs[place]}")
        if place in written:
            raise ValueError(f"{written[place]} and {source} would both be written to {target}")
        written[place] = source
    return targets


@dataclass(frozen=True)
class Task:
    """One mesh to be repaired; what a worker gets.

    Attributes
    ----------
    files : Files
    held : Held
    morph : Morph
    method : Method
    judge : Judge
    resume : bool
        Skip the file where a valid output is not older than it, or than the reference.
    """

    files: Files
    held: Held
    morph: Morph
    method: Method
    judge: Judge
    resume: bool = False

    @property
    def options(self) -> Result:
        """What all files share, ready for JSON."""
        storing = {name: getattr(self.files, name) for name in ("double", "fix_orientation", "backup")}
        asked = {"metrics": self.judge.metrics, "requirements": [str(one) for one in self.judge.requirements]}
        morph, more = asdict(self.morph), {"resume": self.resume}
        return {**asdict(self.method), **asdict(self.held), **morph, **storing, **asked, **more}

    def at(self, source: str, target: str) -> Task:
        """Return the same for other files."""
        return replace(self, files=replace(self.files, source=source, target=target))

    def result(self, status: str, seconds: float, error: str | None = None, facts: Result | None = None) -> Result:
        """Return the facts of `as_json.to_json`, if there are any, and what became of the file."""
        names = {"command": "batch", "file": self.files.source, "output": self.files.target}
        return {"schema": SCHEMA, **(facts or {}), **names, "status": status, "seconds": seconds, "error": error}


def work(task: Task) -> Result:
    """Repair one mesh, in a worker.

    Returns
    -------
    dict
        Ready for JSON: see `Task.result`. The status is "valid", "invalid" (written, but elements are inverted or a
        requirement is not met), "skipped" or "failed".
    """
    start = time.perf_counter()
    try:
        report, status = _made_before(task) if task.resume else None, "skipped"
        if report is None:
            document, output = task.files.open(task.held, task.judge.threads)
            document, before = task.morph.of(document, task.held, task.judge.threads)
            report = repair(document, output, task.files, task.method, task.judge, reference=before)
            status = "valid" if report.valid and report.met else "invalid"
        return task.result(status, time.perf_counter() - start, facts=to_json(report))
    except (MeshfixError, OSError, MemoryError) as error:
        text = "out of memory" if isinstance(error, MemoryError) else str(error)
        if isinstance(error, OSError):
            text = f"{error.filename}: {error.strerror}" if error.filename and error.strerror else text
        return task.result("failed", time.perf_counter() - start, text)


def _made_before(task: Task) -> Report | None:
    """Return the report on the output, if that is not older than the input, valid, and all that is asked for."""
    target, read = Path(task.files.target), [task.files.source]
    if task.morph.reference is not None:
        read.append(task.morph.reference)
    paths = [Path(path) for name in read for path in (name, *pieces_of(name, name)[0])]
    if not target.is_file() or target.stat().st_mtime_ns < max(path.stat().st_mtime_ns for path in paths):
        return None
    try:
        document = task.held.read(str(target), task.judge.threads)
    except MeshfixError:
        return None
    report = task.judge.report("batch", document, {"after": document.mesh})
    return report if report.valid and report.met else None


def run(
    executor: Executor, tasks: Iterable[Task], in_flight: int, function: Callable[[Task], Result] = work
) -> Iterator[Result]:
    """Run tasks and yield their results as they come.

    Whatever raises an exception in place of a result, a worker that dies for one, is tried once more after all others
    that were out, and alone: if it raises again, it is that file's fault.

    Parameters
    ----------
    executor : Executor
        Any whose futures are those of `concurrent.futures`.
    tasks : iterable of Task
        Taken from when there is room.
    in_flight : int
        Files out at once.
    function : callable
        What is run.
    """
    waiting = iter(tasks)
    out: dict[Future[Result], Task] = {}
    suspects: list[Task] = []
    while True:
        while not suspects and len(out) < in_flight and (task := next(waiting, None)) is not None:
            out[executor.submit(function, task)] = task
        if not out:
            if not suspects:
                return
            yield from (_alone(executor, task, function) for task in suspects)
            suspects = []
            continue
        for future in wait(out, return_when=FIRST_COMPLETED).done:
            task = out.pop(future)
            if _error(future) is None:
                yield future.result()
            else:
                suspects.append(task)


def _alone(executor: Executor, task: Task, function: Callable[[Task], Result]) -> Result:
    start = time.perf_counter()
    future = executor.submit(function, task)
    wait([future])
    error = _error(future)
    if error is None:
        return future.result()
    text = f"{type(error).__name__}, twice: {on_one_line(error)}"
    if isinstance(error, BrokenExecutor):
        text = "the worker died, twice (out of memory?)"
    elif isinstance(error, CancelledError):
        text = "the workers have gone"
    return task.result("failed", time.perf_counter() - start, text)


def _error(future: Future[Result]) -> BaseException | None:
    return CancelledError() if future.cancelled() else future.exception()


class Pool(Executor):
    """Worker processes on this machine; where one dies, new ones take the place of all.

    Parameters
    ----------
    workers : int
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._pool = self._fresh()

    def _fresh(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self._workers, multiprocessing.get_context("spawn"), _end_with_the_parent)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """See `Executor.submit`."""
        with _deaf_children():  # a worker may be started here
            try:
                return self._pool.submit(_stoppable, fn, *args, **kwargs)
            except BrokenExecutor:
                self._pool.shutdown()
                self._pool = self._fresh()
                return self._pool.submit(_stoppable, fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """See `Executor.shutdown`; running calls are cancelled as well."""
        if cancel_futures:
            for worker in multiprocessing.active_children():
                worker.terminate()
        self._pool.shutdown(wait)

    def __exit__(self, kind: type[BaseException] | None, *rest: object) -> None:
        """Wait for the workers, which have no time to finish where something has happened."""
        self.shutdown(cancel_futures=kind is not None)


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Start processes, and all of each: what would stop this one in between is heard afterwards.

    They do not hear what the terminal tells the whole group: it is this process that ends them.
    """
    if not hasattr(signal, "pthread_sigmask") or threading.current_thread() is not threading.main_thread():
        yield
        return
    heard: list[int] = []
    stops = {signal.SIGINT, signal.SIGHUP, signal.SIGTERM}
    handlers = {number: signal.signal(number, lambda number, _: heard.append(number)) for number in stops}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, stops - {signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if heard:
            signal.raise_signal(heard[0])


def _end_with_the_parent() -> None:
    """Let a worker end when the process that started it is gone, whatever it was doing."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        connection.wait([parent.sentinel])
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, daemon=True).start()


def _stoppable(function: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function in a worker process, which SIGTERM leaves through every `finally`, and ends."""
    signal.signal(signal.SIGTERM, _unwind)
    try:
        return function(*arguments)
    except KeyboardInterrupt:  # the pool would take it for a result
        pass
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
    return signal.raise_signal(signal.SIGTERM)


def _unwind(number: int, frame: object) -> None:
    """Leave what is being done; a second signal must not disturb the clearing up."""
    del frame
    signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, GRACE)  # ends the process even if the pool has caught the exception
    raise KeyboardInterrupt
