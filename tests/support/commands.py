"""The command as a user runs it: to its end, on a terminal, or until it is stopped in the middle of its work."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import forked
import pytest
from places import SAMPLES

MESHFIX = forked.MESHFIX
TANGLED = str(SAMPLES / "plate_tangled.vtk")
VALID = str(SAMPLES / "plate.vtk")

ANSI = re.compile(r"\x1b\[[\d;?]*[A-Za-z]")
POSIX = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
WRITES_FOR_EVER = """
import sys
from meshfix_cli import read, untangle, write
document = read(sys.argv[1])
versions = [document.mesh, untangle(document.mesh).after]
print("ready", flush=True)
while True:
    for mesh in versions:
        write(document, mesh, sys.argv[1])
"""
# The command, with a disk that takes its time once the temporary file is written.
SLOW_DISK = """
import os, sys, time
def fsync(fd):
    print("writing", flush=True)
    time.sleep(60)
os.fsync = fsync
from meshfix_cli.cli import main
main(sys.argv[1:])
"""
# meshio takes its time.
SLOW_MESHIO = """
import sys, time
import meshio
def slow(*arguments, **options):
    sys.__stdout__.write("writing\\n")
    sys.__stdout__.flush()
    time.sleep(60)
meshio.read = meshio.write = slow
from meshfix_cli.cli import main
main(sys.argv[1:])
"""


def run(*arguments: object, data: bytes | None = None, code: int = 0) -> subprocess.CompletedProcess[bytes]:
    done = forked.run([*map(str, arguments)], data or b"")
    assert done.returncode == code, done.stderr.decode()
    assert b"Traceback" not in done.stderr
    return done


def error_line(*arguments: object, code: int = 1, data: bytes | None = None) -> str:
    """The one line on stderr of a run that fails; nothing on stdout."""
    done = run(*arguments, code=code, data=data)
    lines = done.stderr.decode().splitlines()
    if code == 1:
        assert len(lines) == 1
        assert lines[0].startswith("meshfix: error: ")
    assert done.stdout == b""
    return lines[-1]


def on_terminal(*arguments: object, **environment: str) -> tuple[int, str]:
    """Exit code of a run on a terminal, and all it shows there."""
    pty = pytest.importorskip("pty")
    master, slave = pty.openpty()
    process = subprocess.Popen(
        [MESHFIX, *map(str, arguments)], stdin=slave, stdout=slave, stderr=slave, close_fds=True,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "100", **environment},
    )  # fmt: skip
    os.close(slave)
    shown = b""
    while True:
        try:
            piece = os.read(master, 65536)
        except OSError:  # the other end is closed
            break
        if not piece:
            break
        shown += piece
    os.close(master)
    return process.wait(), shown.decode()


def lines_of(shown: str) -> list[str]:
    """The lines that were shown on a terminal, one after the other, without what tells it how."""
    return [line.rstrip() for line in ANSI.sub("", shown).replace("\r", "\n").split("\n")]


def start(code: str, *arguments: object) -> subprocess.Popen[bytes]:
    child = subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert child.stdout is not None
    assert child.stdout.readline().strip() in (b"ready", b"writing")
    return child


def fill(folder: Path, *names: str) -> list[Path]:
    return [Path(shutil.copy(TANGLED, folder / name)) for name in names]


def results(done: subprocess.CompletedProcess[bytes]) -> dict[str, dict[str, Any]]:
    """The JSON objects of a run by the names of the files."""
    return {Path(one["file"]).name: one for one in map(json.loads, done.stdout.splitlines())}


def statuses(done: subprocess.CompletedProcess[bytes]) -> dict[str, str]:
    return {name: one["status"] for name, one in results(done).items()}
