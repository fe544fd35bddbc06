"""The live line: what a run shows on a terminal as it works, and that nothing is left of it."""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from commands import ANSI, POSIX, TANGLED, VALID, lines_of, on_terminal, run
from places import SAMPLES
from rich.console import Console

from meshfix_cli.report.live import Line

# The command, which waits where it is told to, until there is a file.
WAITS = """
import os, sys, time
from pathlib import Path
import meshfix_cli.cli.files
import meshfix_cli.solve.untangle as solve
meshfix_cli.cli.files.LARGE = 0
where, go = sys.argv[1], Path(sys.argv[2])
def wait():
    end = time.monotonic() + 60
    while time.monotonic() < end and not go.exists():
        time.sleep(0.01)
def steps(*arguments, **options):
    for i, step in enumerate(really(*arguments, **options)):
        yield step
        if where == str(i):
            wait()
def fsync(fd):
    if where == "writing":
        wait()
really, solve.steps, os.fsync = solve.steps, steps, fsync
from meshfix_cli.cli import main
main(sys.argv[3:])
"""


@contextmanager
def on_a_terminal(columns: int, go: Path, where: object, *arguments: object, code: int = 0) -> Iterator[Terminal]:
    pty = pytest.importorskip("pty")
    master, slave = pty.openpty()
    child = subprocess.Popen(
        [sys.executable, "-c", WAITS, str(where), str(go), *map(str, arguments)], stdin=slave, stdout=slave,
        stderr=slave, close_fds=True, env={**os.environ, "TERM": "xterm", "COLUMNS": str(columns)},
    )  # fmt: skip
    os.close(slave)
    try:
        yield Terminal(master, child.pid)
        assert child.wait(timeout=60) == code
    finally:
        child.kill()
        child.wait()
        os.close(master)


class Terminal:
    """What is shown there."""

    def __init__(self, master: int, process: int) -> None:
        self.process = process
        self._master, self._shown = master, b""

    def until(self, words: str) -> list[str]:
        """Wait for a line with some words, and return all lines."""
        while words not in "".join(lines_of(self._shown.decode(errors="replace"))):
            self._shown += os.read(self._master, 65536)
        return lines_of(self._shown.decode(errors="replace"))

    def rest(self) -> str:
        """Return all that is shown to the end."""
        try:
            while piece := os.read(self._master, 65536):
                self._shown += piece
        except OSError:  # the other end is closed
            pass
        return self._shown.decode()


@POSIX
def test_sweeps_and_the_share_that_is_mended_are_shown(tmp_path: Path) -> None:
    arguments = ["untangle", "--strategy", "US", TANGLED, tmp_path / "o.vtk"]
    with on_a_terminal(100, tmp_path / "go", 2, *arguments) as terminal:
        line = terminal.until("LP 2: 17 inverted, smallest area")[-1]
        assert re.search(r"\b0:\d\d ", line)
        assert " 81% LP 2: 17 inverted" in line  # 72 of 89
        (tmp_path / "go").touch()
        shown = terminal.rest()
    assert shown.rindex("\x1b[?25h") > shown.rindex("\x1b[?25l")  # the cursor is back
    assert shown.rindex("\x1b[2K") < shown.index("332 triangles")  # and the line is gone before the report


@POSIX
def test_of_what_is_valid_no_share_is_known(tmp_path: Path) -> None:
    with on_a_terminal(100, tmp_path / "go", 5, "untangle", "--strategy", "US", TANGLED, tmp_path / "o") as terminal:
        line = terminal.until("smoothing 1: 0 inverted")[-1]
        assert "%" not in line
        (tmp_path / "go").touch()
        terminal.rest()


@POSIX
def test_reading_and_writing_are_shown(tmp_path: Path) -> None:
    fifo, out = tmp_path / "in.vtk", tmp_path / "out.vtk"
    os.mkfifo(fifo)
    with on_a_terminal(200, tmp_path / "go", "writing", "untangle", fifo, out) as terminal:
        terminal.until(f"reading {fifo}")
        fifo.write_bytes(Path(TANGLED).read_bytes())
        terminal.until(f"writing {out}")
        (tmp_path / "go").touch()
        assert "measuring the quality" in terminal.rest()


@POSIX
@pytest.mark.parametrize("words", [("quality", "--all"), ("perturb", "--percent", "5", "--dist", "h")])
def test_other_commands_show_what_takes_a_while(words: tuple[str, ...], tmp_path: Path) -> None:
    fifo = tmp_path / "in.vtk"
    os.mkfifo(fifo)
    out = [tmp_path / "o.vtk"] if words[0] == "perturb" else []
    with on_a_terminal(200, tmp_path / "go", "nowhere", *words, fifo, *out) as terminal:
        terminal.until(f"reading {fifo}")
        fifo.write_bytes(Path(VALID).read_bytes())
        shown = terminal.rest()
    assert "measuring the quality" in shown
    assert shown.rindex("\x1b[2K") < shown.index("332 triangles")


@POSIX
def test_nothing_is_left_of_the_line_where_a_signal_ends_a_command(tmp_path: Path) -> None:
    fifo = tmp_path / "in.vtk"
    os.mkfifo(fifo)
    with on_a_terminal(200, tmp_path / "go", "nowhere", "quality", fifo, code=130) as terminal:
        terminal.until(f"reading {fifo}")
        os.kill(terminal.process, signal.SIGINT)
        shown = terminal.rest()
    assert ANSI.sub("", shown[shown.rindex("\x1b[2K") :]) == ""
    assert shown.rindex("\x1b[?25h") > shown.rindex("\x1b[?25l")


def test_the_line_leaves_streams_alone() -> None:
    """Whether they are terminals is asked while it is shown."""
    line, streams = Line(Console(file=io.StringIO(), force_terminal=True)), (sys.stdout, sys.stderr)
    line.show("reading")
    assert (sys.stdout, sys.stderr) == streams
    line.hide()


@POSIX
@pytest.mark.parametrize("columns", [30, 60, 80])
def test_the_line_is_one_line_on_a_narrow_terminal(columns: int, tmp_path: Path) -> None:
    arguments = ["untangle", "--strategy", "US", TANGLED, tmp_path / "o.vtk"]
    with on_a_terminal(columns, tmp_path / "go", 2, *arguments) as terminal:
        lines = terminal.until("LP 2: 17")
        assert all(len(line) <= columns for line in lines)
        (tmp_path / "go").touch()
        assert terminal.rest().partition("332 triangles")[0].count("\x1b[1A") == 1  # to take it away


@POSIX
def test_a_mesh_that_is_poured_into_a_terminal_has_no_line_in_it() -> None:
    code, shown = on_terminal("untangle", TANGLED, "-")
    assert code == 0
    assert run("untangle", "-q", TANGLED).stdout.decode() in shown.replace("\r\n", "\n")


def test_where_there_is_no_terminal_nothing_is_shown(tmp_path: Path) -> None:
    done = run("untangle", SAMPLES / "bracket_tangled.vtk", tmp_path / "o.vtk")
    assert done.stderr == b""
    assert b"\x1b" not in done.stdout
