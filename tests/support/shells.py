"""Shells on a terminal of their own, to which a test types."""

from __future__ import annotations

import os
import re
import select
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from places import BINARIES

PATIENCE = 60.0  # seconds for one answer: machines that run tests are busy
START = {
    "bash": ["bash", "--norc", "--noprofile", "-i"],
    "zsh": ["zsh", "-f", "-i"],
    "fish": ["fish", "--no-config", "--private", "--interactive"],
}
# What the README says to put into the shell's own file; zsh looks for functions only once it is told so.
SETUP = {
    "bash": 'eval "$(_MESHFIX_COMPLETE=bash_source meshfix)"',
    "zsh": 'autoload -Uz compinit && compinit -u -D && eval "$(_MESHFIX_COMPLETE=zsh_source meshfix)"',
    "fish": "_MESHFIX_COMPLETE=fish_source meshfix | source",
}
TO_THE_BEGIN, KILL_THE_LINE = "\x01", "\x15"  # Ctrl-A and Ctrl-U, in all of them


class Shell:
    """One that is ready to be typed to."""

    def __init__(self, master: int) -> None:
        self._master, self._asked = master, 0

    def run(self, keys: str) -> str:
        """Type keys, a new line, and a command that marks the end; return what was shown until that was done."""
        self._asked += 1
        os.write(self._master, f"{keys}\recho en''d{self._asked}.\r".encode())
        return self._until(f"end{self._asked}.")

    def completed(self, line: str) -> list[str]:
        """Return the words that a line has once Tab was pressed: the shell itself prints them."""
        shown = self.run(f"{line}\t{TO_THE_BEGIN}printf '<%s>\\n' ")
        return re.findall(r"<([^<>%]*)>\r?\n", shown)

    def wait_for_offer(self, line: str, *words: str) -> None:
        """Press Tab twice behind a line, and wait until all words that fit are shown; shells list none in a hurry."""
        os.write(self._master, f"{line}\t".encode())
        self._until(line.split()[-1])
        os.write(self._master, b"\t")
        self._until(*words)
        self.run(KILL_THE_LINE)

    def _until(self, *marks: str) -> str:
        shown, end = b"", time.monotonic() + PATIENCE
        while not all(mark.encode() in shown for mark in marks):
            if not select.select([self._master], [], [], max(0.0, end - time.monotonic()))[0]:
                raise TimeoutError(shown.decode(errors="replace"))
            shown += os.read(self._master, 65536)
        return shown.decode(errors="replace")


@contextmanager
def shell(name: str, folder: Path) -> Iterator[Shell]:
    """Start a shell in a folder, with completion as the README sets it up; skip the test where there is none."""
    pty, termios, fcntl = (pytest.importorskip(module) for module in ("pty", "termios", "fcntl"))
    if shutil.which(name) is None:
        pytest.skip(f"there is no {name}")
    home = folder.parent / "home"
    home.mkdir(exist_ok=True)
    master, slave = pty.openpty()
    termios.tcsetwinsize(slave, (50, 200)) if hasattr(termios, "tcsetwinsize") else None
    environment = {"PATH": BINARIES, "HOME": str(home), "TERM": "xterm", "LC_ALL": "C.UTF-8", "PS1": "> "}
    child = subprocess.Popen(
        START[name], stdin=slave, stdout=slave, stderr=slave, close_fds=True, cwd=folder, env=environment,
        start_new_session=True, preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
    )  # fmt: skip
    os.close(slave)
    try:
        ready = Shell(master)
        ready.run(SETUP[name])
        yield ready
    finally:
        child.kill()
        child.wait()
        os.close(master)
