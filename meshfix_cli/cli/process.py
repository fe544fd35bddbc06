"""The process: exit codes, signals, and the other processes that mpiexec has started."""

from __future__ import annotations

import io
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NoReturn, Protocol, TextIO, cast

import click

from meshfix_cli.cli.help import WithExamples
from meshfix_cli.errors import MeshfixError
from meshfix_cli.report.plain import plain

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from meshfix_cli.repair import Method, Steps
    from meshfix_cli.workers.distributed import Root

COMPLETE = "_MESHFIX_COMPLETE"  # by what shells ask for completion
CLEAR = "\r\x1b[2K"  # what stands in the line of a terminal

VALID, ERROR, INVERTED, SOME_FAILED = 0, 1, 3, 4  # 2, wrong usage, is click's

# Where launchers say how many processes they have started: Open MPI, MVAPICH, Hydra and whatever else speaks PMI, and
# srun, which comes last since the others may use it to start one of their own on each machine.
LAUNCHED = ("OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS")


# Processes that work for this one, and end with it.
helpers: set[str] = set()


class Told(Protocol):
    """A run that tells how far it is."""

    def hears(self) -> str:
        """Take a signal, and say what follows; nothing: the run is to be ended."""

    def ended(self) -> str:
        """Say how far it was when it was ended."""


# The run that is under way, where it is to be told how far it was when a signal ended it.
courses: list[Told] = []
# Streams that the shell has closed.
closed: set[str] = set()


class Commands(Mapping[str, click.Command]):
    """The commands by their names, which are those of their modules; one is imported when it is asked for."""

    names = ("untangle", "perturb", "quality", "batch")

    def __getitem__(self, name: str) -> click.Command:
        if name not in self.names:
            raise KeyError(name)
        command: click.Command = getattr(import_module(f"meshfix_cli.cli.{name}"), name)
        return command

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)


class Group(WithExamples, click.Group):
    """Errors are one line on stderr and an exit code, never a traceback; signals leave no temporary file."""

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run the command line, with what it has printed out of the way at the end: there Python would complain."""
        for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
            if getattr(sys, name) is None:  # closed by the shell: >&-
                closed.add(name)
                setattr(sys, name, Path(os.devnull).open(mode))  # noqa: SIM115 (for the whole run)
        for name in ("stdout", "stderr"):
            stream = getattr(sys, name)
            if isinstance(getattr(stream, "buffer", None), io.RawIOBase):
                setattr(sys, name, _buffered(stream))
                setattr(sys, f"__{name}__", getattr(sys, name))
        if os.environ.get(COMPLETE):
            problem = import_module("meshfix_cli.cli.completion").problem()
            if problem:
                fail(problem)
        try:
            try:
                return super().main(*args, **kwargs)
            finally:
                sys.stdout.flush()
        except BrokenPipeError:
            _end_without_a_reader()
        except OSError as error:
            _print_no_more(sys.stdout)
            fail(_in_words(error))
        finally:
            _flush(sys.stderr)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Find the command; where a file stands in its place, say what is missing."""
        if args[0] not in self.commands and Path(args[0]).exists():
            ctx.fail(f"{args[0]!r} is a file, and no command. Did you mean 'meshfix untangle'?")
        return super().resolve_command(ctx, args)

    def make_context(self, *arguments: Any, **more: Any) -> click.Context:
        """Read the command line."""
        with _in_plain_words():
            return super().make_context(*arguments, **more)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command."""
        for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):  # read when numpy and scipy are loaded, later
            os.environ[name] = "1"  # with more, sums have other bits, and nothing here is large enough to gain
        for name in ("SIGINT", "SIGTERM", "SIGHUP"):
            if hasattr(signal, name) and signal.getsignal(getattr(signal, name)) != signal.SIG_IGN:  # as nohup does
                signal.signal(getattr(signal, name), _stop)
        try:
            with _in_plain_words():
                return super().invoke(ctx)
        except MeshfixError as error:
            fail(str(error))
        except MemoryError:
            fail("out of memory")
        except RuntimeError as error:  # of pathlib, before Python 3.13
            if not str(error).startswith("Symlink loop"):
                raise
            fail(f"{str(error).rpartition(' from ')[2].strip(chr(39))}: too many levels of symbolic links")


def _buffered(stream: io.TextIOWrapper) -> io.TextIOWrapper:
    """Put a buffer below a stream that has none, as with PYTHONUNBUFFERED: there what a full device leaves is lost."""
    words, errors = stream.encoding, stream.errors
    below = cast("io.RawIOBase", stream.detach())
    return io.TextIOWrapper(io.BufferedWriter(below), words, errors, line_buffering=True)


def _in_words(error: OSError) -> str:
    """Say what the system says, of the file it is about or of stdout."""
    name = error.filename if error.filename is not None else "<stdout>"
    return f"{os.fsdecode(name) if isinstance(name, (str, bytes)) else name}: {error.strerror or error}"


def _end_without_a_reader() -> NoReturn:
    """End as the system ends a program whose output nobody reads any more."""
    _print_no_more(sys.stdout)
    sys.exit(128 + getattr(signal, "SIGPIPE", 13))


def _flush(stream: TextIO) -> None:
    """Print what is still to be printed, if it can be."""
    try:
        stream.flush()
    except OSError:
        _print_no_more(stream)


def _print_no_more(stream: TextIO) -> None:
    """Let what is still to be printed go nowhere: Python would try once more at the end."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


@contextmanager
def _in_plain_words() -> Iterator[None]:
    """Let what click says of wrong usage be one line that does not act on a terminal, whatever the user wrote."""
    try:
        yield
    except BrokenPipeError:  # click would end with 1
        _end_without_a_reader()
    except click.UsageError as error:
        if isinstance(error, getattr(click.exceptions, "NoArgsIsHelpError", ())):  # it is the help that it shows
            raise
        raise _WrongUsage(plain(error.format_message()), error.ctx) from error


class _WrongUsage(click.UsageError):
    """Has its exit code where nobody can be told, too."""

    def show(self, file: IO[Any] | None = None) -> None:
        with suppress(OSError):
            super().show(file)


def _stop(number: int, frame: object) -> None:
    """End, where there is something to clear up through every `finally`; a second signal must not disturb that.

    Elsewhere at once: in the middle of an import Python may drop an exception. A run that keeps its best mesh is let
    end by itself the first time.
    """
    del frame
    told = courses[-1] if courses and number != getattr(signal, "SIGHUP", None) else None
    if told is not None and (follows := told.hears()):
        _say_at_once(follows)
        return
    signal.signal(number, signal.SIG_IGN)
    with suppress(OSError, ValueError):  # a live line hides the cursor
        if sys.stderr.isatty():
            os.write(sys.stderr.fileno(), f"{CLEAR}\x1b[?25h".encode())
    if told is not None:
        _say_at_once(told.ended())
    atomic = sys.modules.get("meshfix_cli.meshfile.atomic")
    if helpers or getattr(atomic, "under_way", None):
        sys.exit(128 + number)
    os._exit(128 + number)


def _say_at_once(message: str) -> None:
    """Print a line on stderr, past what Python may be printing there or somewhere else, and over a live line."""
    stream = sys.__stderr__
    if stream is None:  # closed by the shell
        return
    with suppress(OSError, ValueError):
        os.write(stream.fileno(), f"{CLEAR * stream.isatty()}meshfix: {message}\n".encode())


def complain(message: str) -> None:
    """Print an error, on one line of stderr, if that takes it."""
    with suppress(OSError):
        click.echo(f"meshfix: error: {plain(message)}", err=True)


def fail(message: str) -> NoReturn:
    """Print an error and end."""
    complain(message)
    _flush(sys.stdout)
    sys.exit(ERROR)


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def processes(method: Method, threads: int, watch: Callable[[Steps], Steps]) -> Iterator[Root]:
    """Give the root those that mpiexec has started; they work for it, and end as it does."""
    from meshfix_cli.workers.distributed import ROOT, Root, serve

    comm = find_processes()
    helpers.add("mpi")
    if comm.rank != ROOT:
        try:
            code = serve(comm, method, threads)
        except BaseException as error:
            abort_all(comm, error)
        sys.exit(code)
    root, code = Root(comm, method, threads, watch), ERROR
    try:
        yield root
    except BaseException as error:
        if root.busy:
            abort_all(comm, error)
        if isinstance(error, SystemExit) and isinstance(error.code, int):
            code = error.code
        elif isinstance(error, click.ClickException):
            code = error.exit_code
        raise
    finally:
        root.dismiss(code)


def find_processes() -> Intracomm:
    """Find the processes; until all are there, signals end this one where it is."""
    from meshfix_cli.workers.mpi import world

    handlers = {number: signal.signal(number, signal.SIG_DFL) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        return world(_launched())
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


def abort_all(comm: Intracomm, error: BaseException) -> NoReturn:
    """End all processes with the error of one: the others would wait for it for ever."""
    from meshfix_cli.workers.mpi import abort

    code = error.code if isinstance(error, SystemExit) and isinstance(error.code, int) else ERROR
    try:
        if isinstance(error, (MeshfixError, MemoryError, OSError)):
            said = _in_words(error) if isinstance(error, OSError) else str(error)
            complain(f"process {comm.rank}: {said or type(error).__name__}")
        elif not isinstance(error, SystemExit):  # of a signal
            traceback.print_exception(error)
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        abort(comm, code)


def _launched() -> int | None:
    """How many processes the launcher of MPI programs says it has started, if there is one."""
    sizes = [os.environ[name] for name in LAUNCHED if name in os.environ]
    return int(sizes[0]) if sizes and sizes[0].isdecimal() else None
