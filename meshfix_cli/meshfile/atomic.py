"""Writing that never leaves half a file."""

from __future__ import annotations

import contextlib
import os
import stat
import sys
import tempfile
from collections.abc import Callable
from itertools import count
from pathlib import Path

from meshfix_cli.errors import WriteError


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
    try:
        with tempfile.TemporaryDirectory(prefix=".meshfix-", dir=None if streamed else path.parent) as folder:
            temporary = Path(folder) / (path.name if path.suffix else "mesh")
            produce(temporary)
            if target == "-":
                sys.stdout.buffer.write(temporary.read_bytes())
                sys.stdout.buffer.flush()
            elif streamed:
                path.write_bytes(temporary.read_bytes())
            else:
                _replace(temporary, path, backup)
    except BrokenPipeError:  # nobody reads stdout any more: the command line knows what that means
        raise
    except OSError as error:
        name = "<stdout>" if target == "-" else target
        raise WriteError(f"{name}: {error.strerror or error}") from error


def write_text(target: str, text: str) -> None:
    """Write a small file as `write_file` does."""
    write_file(target, lambda temporary: temporary.write_text(text))


def _replace(temporary: Path, path: Path, backup: bool) -> None:
    temporary.chmod(stat.S_IMODE(path.stat().st_mode) if path.exists() else 0o666 & ~_umask())
    with temporary.open("rb") as written:
        os.fsync(written.fileno())
    if backup and path.exists():
        _keep(path)
    temporary.replace(path)
    if os.name == "posix":  # the rename is done; what is left is that a crash of the machine does not undo it
        with contextlib.suppress(OSError):
            folder = os.open(path.parent, os.O_RDONLY)
            try:
                os.fsync(folder)
            finally:
                os.close(folder)


def _keep(path: Path) -> None:
    """Give a file a second name that no other file has; the rename takes the first one away."""
    for number in count():
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
