"""Every ending is clean: signals from the first moment on, closed and full streams, devices, links in a circle."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from commands import MESHFIX, POSIX, SLOW_DISK, TANGLED, VALID, error_line, run
from places import SAMPLES

from meshfix_cli import read, untangle, write
from meshfix_cli.meshfile import atomic

KILLS = 16  # at random moments; hundreds were tried by hand

# The command, which gets a signal while it imports what it needs.
EARLY = """
import os, sys
class Finder:
    def find_spec(name, path=None, target=None):
        if name == "click":
            os.kill(os.getpid(), int(sys.argv.pop()))
sys.meta_path.insert(0, Finder)
import runpy
runpy.run_module("meshfix_cli", run_name="__main__")
"""
# The command, which never ends to solve.
ENDLESS = """
import sys, time
import meshfix_cli.solve.untangle as solve
def steps(*arguments, **options):
    yield from [next(really(*arguments, **options))]
    sys.stderr.write("solving")
    sys.stderr.flush()
    time.sleep(60)
really, solve.steps = solve.steps, steps
from meshfix_cli.cli import main
main(sys.argv[1:])
"""


@POSIX
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_while_the_command_is_imported_is_no_traceback(name: str) -> None:
    number = getattr(signal, name)
    command = [sys.executable, "-c", EARLY, "quality", VALID, str(int(number))]
    done = subprocess.run(command, capture_output=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, b"", b"")


@POSIX
def test_ctrl_c_while_solving_gives_the_cursor_back(tmp_path: Path) -> None:
    pty = pytest.importorskip("pty")
    master, slave = pty.openpty()
    child = subprocess.Popen(
        [sys.executable, "-c", ENDLESS, "untangle", TANGLED, str(tmp_path / "out.vtk")], stdin=slave, stdout=slave,
        stderr=slave, close_fds=True, env={**os.environ, "TERM": "xterm"},
    )  # fmt: skip
    os.close(slave)
    shown = b""
    while b"solving" not in shown:
        shown += os.read(master, 65536)
    assert b"\x1b[?25l" in shown
    child.send_signal(signal.SIGINT)
    try:
        while piece := os.read(master, 65536):
            shown += piece
    except OSError:  # the other end is closed
        pass
    os.close(master)
    assert child.wait() == 130
    assert shown.rindex(b"\x1b[?25h") > shown.rindex(b"\x1b[?25l")
    assert b"Traceback" not in shown
    assert not (tmp_path / "out.vtk").exists()


def wait_for_handlers(child: subprocess.Popen[bytes]) -> None:
    """Wait until it is the program that runs, and not Python that starts, however slow the machine is."""
    status = Path(f"/proc/{child.pid}/status")
    if not status.exists():
        time.sleep(0.1)
    while status.exists() and child.poll() is None:
        caught = re.search(r"SigCgt:\s*(\w+)", status.read_text())
        if caught and int(caught[1], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.001)


@POSIX
def test_killed_at_any_moment_the_file_is_the_old_or_the_new(tmp_path: Path, random: np.random.Generator) -> None:
    path = tmp_path / "mesh.vtk"
    original = (SAMPLES / "bracket_tangled.vtk").read_bytes()
    run("untangle", "-q", SAMPLES / "bracket_tangled.vtk", tmp_path / "new.vtk")
    versions = {original, (tmp_path / "new.vtk").read_bytes()}
    signals = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL]
    for i in range(KILLS):
        path.write_bytes(original)
        child = subprocess.Popen([MESHFIX, "untangle", "-q", path, path], stderr=subprocess.PIPE)
        wait_for_handlers(child)
        time.sleep(random.uniform(0.0, 0.4))
        child.send_signal(signals[i % 4])
        _, complaint = child.communicate(timeout=60)
        assert b"Traceback" not in complaint
        assert path.read_bytes() in versions


def test_a_mesh_that_goes_to_a_closed_stdout_is_not_lost_in_silence() -> None:
    for command in (f"untangle -q <{TANGLED}", f"perturb -q --percent 5 --dist h <{VALID}"):
        done = subprocess.run(["sh", "-c", f"'{MESHFIX}' {command} >&-"], capture_output=True, check=False)
        said = b"meshfix: error: <stdout>: is closed, and the mesh goes there; name an OUTPUT\n"
        assert (done.returncode, done.stderr) == (1, said)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")
@pytest.mark.parametrize(
    "arguments",
    ["--help", "--version", "untangle --help", f"quality {VALID}", f"quality --json {VALID}", f"untangle {VALID}"],
)
def test_a_full_device_is_one_line(arguments: str) -> None:
    command = ["sh", "-c", f"'{MESHFIX}' {arguments} >/dev/full"]
    done = subprocess.run(command, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (1, b"meshfix: error: <stdout>: No space left on device\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_where_nobody_can_be_told_the_exit_code_tells(unbuffered: str) -> None:
    for arguments, code in (("--bogus", 2), ("quality", 2), ("quality no.vtk", 1), (f"quality --json {VALID}", 0)):
        command = ["sh", "-c", f"'{MESHFIX}' {arguments} 2>/dev/full"]
        done = subprocess.run(
            command, stdout=subprocess.DEVNULL, check=False, env={**os.environ, "PYTHONUNBUFFERED": unbuffered}
        )
        assert done.returncode == code


@POSIX
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", [("quality", "--json", VALID), ("quality", VALID), ("untangle", "-q", TANGLED)])
def test_a_device_that_is_full_in_the_middle(arguments: tuple[str, ...], unbuffered: str, tmp_path: Path) -> None:
    whole = run(*arguments).stdout
    room, begun = max(len(whole), 4096), tmp_path / "begun"
    begun.write_bytes(bytes(room - len(whole) // 2))

    def limit() -> None:
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (room, room))

    with begun.open("ab") as stdout:
        done = subprocess.run(
            [MESHFIX, *arguments], stdout=stdout, stderr=subprocess.PIPE, preexec_fn=limit, check=False,
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        )  # fmt: skip
    assert (done.returncode, done.stderr) == (1, b"meshfix: error: <stdout>: File too large\n")
    assert begun.stat().st_size == room


@POSIX
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", ["--help", f"quality {VALID}", f"quality --json {VALID}", f"untangle {TANGLED}"])
def test_a_reader_that_goes_away_ends_the_command_as_it_does_any_other(arguments: str, unbuffered: str) -> None:
    read_end, write_end = os.pipe()
    os.close(read_end)
    done = subprocess.run(
        [MESHFIX, *arguments.split()], stdout=write_end, stderr=subprocess.PIPE, check=False,
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
    )  # fmt: skip
    os.close(write_end)
    assert (done.returncode, done.stderr) == (128 + signal.SIGPIPE, b"")


@POSIX
def test_links_that_lead_in_a_circle(tmp_path: Path) -> None:
    loop, history, out = tmp_path / "loop.vtk", tmp_path / "loop.csv", tmp_path / "out.vtk"
    for link in (loop, history):
        link.symlink_to(tmp_path / f"other{link.suffix}")
        (tmp_path / f"other{link.suffix}").symlink_to(link)
    for words in (
        ("untangle", "-q", VALID, loop),
        ("untangle", "-q", loop, out),
        ("untangle", "-q", "--history", history, VALID, out),
        ("untangle", "-q", "--cells", loop, VALID, out),
        ("quality", loop),
        ("perturb", "--percent", 5, "--dist", "h", VALID, loop),
    ):
        assert "oo many levels of symbolic links" in error_line(*words)
    assert not out.exists()


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there is no such device")
def test_devices_without_end_are_not_read() -> None:
    assert "is a device, and no mesh comes from it" in error_line("quality", "/dev/zero")
    with Path("/dev/zero").open("rb") as zeros:
        done = subprocess.run([MESHFIX, "quality", "-"], stdin=zeros, capture_output=True, check=False)
    assert (done.returncode, done.stderr.count(b"\n")) == (1, 1)
    assert "/dev/null: is empty" in error_line("quality", "/dev/null")


@POSIX
def test_what_is_replaced_need_not_be_readable(tmp_path: Path) -> None:
    (tmp_path / "out.vtk").write_text("old")
    (tmp_path / "out.vtk").chmod(0o200)
    command = [MESHFIX, "untangle", "-q", TANGLED, str(tmp_path / "out.vtk")]
    rights = "-dac_override,-dac_read_search"  # with these, root may read anything
    if os.geteuid() == 0 and shutil.which("setpriv"):
        command = ["setpriv", f"--bounding-set={rights}", f"--inh-caps={rights}", *command]
    done = subprocess.run(command, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    (tmp_path / "out.vtk").chmod(0o600)
    assert read(tmp_path / "out.vtk").mesh.check()[0] == 0


@POSIX
def test_what_killed_processes_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    child = subprocess.Popen(
        [sys.executable, "-c", SLOW_DISK, "untangle", "-q", TANGLED, tmp_path / "a.vtk"], stdout=subprocess.PIPE
    )
    assert child.stdout is not None
    child.stdout.readline()
    (alive,) = tmp_path.glob(".meshfix-*")
    with subprocess.Popen(
        [sys.executable, "-c", SLOW_DISK, "untangle", "-q", TANGLED, tmp_path / "b.vtk"], stdout=subprocess.PIPE
    ) as other:
        assert other.stdout is not None
        other.stdout.readline()
        other.kill()
    (left,) = set(tmp_path.glob(".meshfix-*")) - {alive}
    long_ago = time.time() - 2 * atomic.STALE
    foreign = tmp_path / ".meshfix-notes-1"
    foreign.mkdir()
    for folder in (left, alive, foreign):
        os.utime(folder, (long_ago, long_ago))
    document = read(VALID)
    write(document, untangle(document.mesh).after, tmp_path / "c.vtk")
    assert {path.name for path in tmp_path.glob(".meshfix-*")} == {alive.name, foreign.name}
    child.kill()
    child.communicate()
