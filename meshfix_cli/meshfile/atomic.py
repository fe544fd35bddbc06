"""Writing that never leaves half a file."""

from __future__ import annotations

import contextlib
import os
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from itertools import count
from pathlib import Path

from meshfix_cli.errors import WriteError

# Marks of what is being written: whoever ends the process while there are some must leave through every `finally`.
under_way: set[object] = set()

STALE = 3600.0  # seconds after which a temporary folder of a process that is not here is nobody's


def check_target(target: str) -> None:
    """Raise WriteError now, before any work, where writing to `target` cannot succeed."""
    if target == "-":
        return
    path = Path(target)
    if path.is_dir():
        raise WriteError(f"{target}: is a directory")
    if is_stream(target):
        return
    if not path.resolve().parent.is_dir():
        raise WriteError(f"{target}: the directory does not exist")
    if not os.access(path.resolve().parent, os.W_OK):
        raise WriteError(f"{target}: the directory is not writable")
    if path.exists() and not os.access(path, os.W_OK):  # a rename would not ask
        raise WriteError(f"{target}: is not writable")


def write_file(target: str, produce: Callable[[Path], object], backup: bool = False) -> None:
    """Let `produce` write a temporary file, then put it in the place of `target` at once ("-": stdout).

    The temporary file is in a folder of its own beside the target, so the replacement is one rename; symbolic
    links are followed and the mode of an existing file is kept. With `backup` that file stays as `target.bak`.
    """
    streamed = is_stream(target)
    path = Path(target) if streamed else Path(target).resolve()
    parent = Path(tempfile.gettempdir()) if streamed else path.parent
    with _under_way(), _sentence(target), _folder(parent) as folder:
        temporary = folder / (path.name if path.suffix else "mesh")
        produce(temporary)
        if target == "-":
            sys.stdout.buffer.write(temporary.read_bytes())
            sys.stdout.buffer.flush()
        elif streamed:
            path.write_bytes(temporary.read_bytes())
        else:
            _complete(temporary, path)
            if backup:
                _keep(path)
            _replace(temporary, path)


def write_files(contents: Iterable[tuple[str, bytes]], backup: bool = False) -> None:
    """Replace several files, each at once, in the order given, and the first when all of them are complete.

    The folder of a target is made where there is none. With `backup` each file that was there stays as `write_file`
    keeps it.
    """
    with _under_way(), contextlib.ExitStack() as stack:
        ready = [_stage(stack, target, data) for target, data in contents]
        for _, path in ready if backup else ():
            with _sentence(str(path)):
                _keep(path)
        try:
            _replace_all(ready)
        except (SystemExit, KeyboardInterrupt):  # between two of them: the rest takes no time, and a mixture is no mesh
            _replace_all(ready)
            raise


def _stage(stack: contextlib.ExitStack, target: str, data: bytes) -> tuple[Path, Path]:
    """Write a temporary file that goes away with the stack; return where it is, and the path that it is for."""
    path = Path(target).resolve()
    with _sentence(target):
        for missing in [folder for folder in reversed(path.parents) if not folder.exists()]:
            missing.mkdir()
            stack.callback(_remove_empty, missing)
        temporary = stack.enter_context(_folder(path.parent)) / path.name
        temporary.write_bytes(data)
        _complete(temporary, path)
    return temporary, path


def _replace_all(ready: Iterable[tuple[Path, Path]]) -> None:
    for temporary, path in ready:
        if temporary.exists():
            with _sentence(str(path)):
                _replace(temporary, path)


def _remove_empty(folder: Path) -> None:
    with contextlib.suppress(OSError):
        folder.rmdir()


@contextlib.contextmanager
def _sentence(target: str) -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:  # nobody reads stdout any more: the command line knows what that means
        raise
    except OSError as error:
        name = "<stdout>" if target == "-" else target
        raise WriteError(f"{name}: {error.strerror or error}") from error


@contextlib.contextmanager
def _under_way() -> Iterator[None]:
    mark = object()
    under_way.add(mark)
    try:
        yield
    finally:
        under_way.discard(mark)


@contextlib.contextmanager
def _folder(parent: Path) -> Iterator[Path]:
    """Make a folder that is gone in the end, also where a signal comes while it is made or removed."""
    _remove_stale(parent)
    folder = parent / f".meshfix-{os.getpid()}-{os.urandom(8).hex()}"
    try:
        folder.mkdir(0o700)
        yield folder
        shutil.rmtree(folder)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _remove_stale(parent: Path) -> None:
    """Remove what processes of this user that were killed have left there."""
    if os.name != "posix":
        return
    with contextlib.suppress(OSError):
        for folder in parent.glob(".meshfix-*-*"):
            number = folder.name.split("-")[1]
            if number.isdecimal() and folder.stat().st_uid == os.geteuid() and _is_over(folder, int(number)):
                shutil.rmtree(folder, ignore_errors=True)


def _is_over(folder: Path, process: int) -> bool:
    """Whether a process is gone, and what it made is old enough that none of another machine may be at work on it."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return folder.is_dir() and not folder.is_symlink() and time.time() - folder.stat().st_mtime > STALE
    except OSError:
        pass
    return False


def write_text(target: str, text: str) -> None:
    """Write text as `write_file` does, in UTF-8."""
    # Names of files may hold bytes that are no text.
    write_file(target, lambda temporary: temporary.write_text(text, encoding="utf-8", errors="replace"))


def _complete(temporary: Path, path: Path) -> None:
    """See that a file is on the disk, and give it the mode of the one that it will replace."""
    with temporary.open("rb") as written:  # which that mode may not allow
        os.fsync(written.fileno())
    temporary.chmod(stat.S_IMODE(path.stat().st_mode) if path.exists() else 0o666 & ~_umask())


def _replace(temporary: Path, path: Path) -> None:
    temporary.replace(path)
    if os.name == "posix":  # the rename is done; what is left is that a crash of the machine does not undo it
        with contextlib.suppress(OSError):
            folder = os.open(path.parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)


def _keep(path: Path) -> None:
    """Give a file, if there is one, a second name that no other has; the rename takes the first one away."""
    for number in count() if path.exists() else ():
        try:
            path.with_name(f"{path.name}.bak{number or ''}").hardlink_to(path)
        except FileExistsError:
            continue
        return


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def is_stream(target: str) -> bool:
    """Whether a target is stdout, a pipe or a device: written to, never replaced."""
    return target == "-" or (Path(target).exists() and not Path(target).is_file())
