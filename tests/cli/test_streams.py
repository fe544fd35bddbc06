"""Streams, terminals, devices and disks: where the bytes come from and go to."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import meshio
import pytest
from commands import MESHFIX, TANGLED, VALID, error_line, on_terminal, run
from places import SAMPLES

from meshfix_cli import read


def test_pipeline_of_streams() -> None:
    source = (SAMPLES / "bracket.vtk").read_bytes()
    tangled = run("perturb", "--percent", 25, "--dist", "2h", data=source)
    assert "moved 466 vertices" in tangled.stderr.decode()
    repaired = run("untangle", "--quiet", data=tangled.stdout)
    assert repaired.stderr == b""
    assert "valid" in run("quality", "-", data=repaired.stdout).stdout.decode()


def test_a_mesh_on_stdout_puts_the_report_on_stderr() -> None:
    done = run("untangle", TANGLED)
    assert done.stdout.startswith(b"# vtk")
    assert "valid: no element" in done.stderr.decode()


def test_a_directory_as_input_or_output(tmp_path: Path) -> None:
    assert "directory" in error_line("untangle", tmp_path, tmp_path / "out.vtk").lower()
    assert "is a directory" in error_line("untangle", TANGLED, tmp_path)


def test_targets_that_cannot_be_written(tmp_path: Path) -> None:
    assert "does not exist" in error_line("untangle", TANGLED, tmp_path / "nowhere" / "out.vtk")
    assert list(tmp_path.iterdir()) == []
    line = error_line("untangle", "--history", tmp_path / "no" / "h.csv", TANGLED, tmp_path / "o.vtk")
    assert "does not exist" in line
    assert list(tmp_path.iterdir()) == []


def test_history_never_replaces_a_mesh(tmp_path: Path) -> None:
    mesh = tmp_path / "in.vtk"
    mesh.write_bytes(Path(TANGLED).read_bytes())
    link = tmp_path / "link.csv"
    link.hardlink_to(mesh)
    assert "is the name of a mesh" in error_line("untangle", "--history", link, mesh, tmp_path / "o.vtk", code=2)
    assert "is the name of a mesh" in error_line("untangle", "--history", link, TANGLED, mesh, code=2)
    assert "is the name of a mesh" in error_line("untangle", "--history", link, TANGLED, link, code=2)
    twice = ["--history", tmp_path / "x", "--cells", tmp_path / "x"]
    assert "of another file to be written" in error_line("untangle", *twice, mesh, tmp_path / "o.vtk", code=2)
    assert mesh.read_bytes() == Path(TANGLED).read_bytes()


def test_pipes_and_devices_with_names(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo.vtk"
    os.mkfifo(fifo)
    repair = f"{MESHFIX} untangle -q"
    command = f"cat {TANGLED} >{fifo} & {repair} {fifo} /dev/stdout | head -c 5; {repair} {TANGLED} /dev/null"
    done = subprocess.run(["bash", "-c", command], capture_output=True, check=False, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"# vtk", b"")


@pytest.mark.parametrize("streams", ["2>&-", ">&-", "<&-", "<&- >&- 2>&-"])
def test_closed_streams(streams: str, tmp_path: Path) -> None:
    command = f"{MESHFIX} untangle {TANGLED} {tmp_path / 'out.vtk'} {streams}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, check=False)
    assert done.returncode == 0
    assert b"Traceback" not in done.stdout + done.stderr
    assert read(tmp_path / "out.vtk").mesh.check()[0] == 0
    piped = subprocess.run(["bash", "-c", f"{MESHFIX} untangle {TANGLED} 2>&-"], capture_output=True, check=False)
    assert piped.stdout == (tmp_path / "out.vtk").read_bytes()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_read_only_directory(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    assert "not writable" in error_line("untangle", TANGLED, tmp_path / "out.vtk")


def test_full_disk_leaves_the_target(tmp_path: Path) -> None:
    target = tmp_path / "out.vtk"
    target.write_text("precious")
    command = f"ulimit -f 1; trap '' XFSZ; exec {MESHFIX} untangle {SAMPLES / 'bracket_tangled.vtk'} {target}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, check=False)
    assert done.returncode == 1
    assert done.stderr.decode().count("\n") == 1
    assert target.read_text() == "precious"
    assert [p.name for p in tmp_path.iterdir()] == ["out.vtk"]


def test_empty_and_unknown_stdin() -> None:
    assert "<stdin>: is empty" in error_line("untangle", data=b"")
    assert "not recognised" in error_line("untangle", data=b"hello")


def test_a_reader_that_goes_away_is_no_traceback() -> None:
    done = subprocess.run(
        ["bash", "-c", f"{MESHFIX} untangle {SAMPLES / 'bracket_tangled.vtk'} 2>err | head -c 10; cat err; rm err"],
        capture_output=True, check=False, cwd="/tmp",
    )  # fmt: skip
    assert b"Traceback" not in done.stdout + done.stderr
    assert b"Exception ignored" not in done.stdout + done.stderr


def test_progress_and_colour_are_for_terminals(tmp_path: Path) -> None:
    arguments = ["untangle", SAMPLES / "bracket_tangled.vtk", tmp_path / "out.vtk"]
    code, shown = on_terminal(*arguments)
    assert code == 0
    assert "\x1b[1;32mvalid: no element is inverted" in shown
    assert "measuring the quality" in shown
    assert "32m" not in on_terminal(*arguments, NO_COLOR="1")[1]
    assert b"\x1b" not in run(*arguments).stdout


def test_terminals_get_no_binary_data_and_give_no_mesh(tmp_path: Path) -> None:
    mesh = meshio.read(VALID)
    mesh.write(tmp_path / "binary.vtk", binary=True)
    for output in ("-", *(["/dev/stdout"] if Path("/dev/stdout").exists() else [])):
        code, shown = on_terminal("untangle", tmp_path / "binary.vtk", output)
        assert code == 2
        assert "binary data is not written to a terminal" in shown
    code, shown = on_terminal("untangle")
    assert code == 2
    assert "there is no INPUT, and stdin is a terminal" in shown


@pytest.mark.parametrize("words", [("untangle",), ("perturb", "--percent", "5", "--dist", "h")])
def test_a_mesh_is_poured_into_a_terminal_only_where_that_is_asked_for(words: tuple[str, ...], tmp_path: Path) -> None:
    """And the refusal comes before any work: the file would not be found."""
    code, shown = on_terminal(*words, tmp_path / "no.vtk")
    assert code == 2
    last = "Error: there is no OUTPUT, and stdout is a terminal; name a file, or - for the terminal"
    assert shown.rstrip().splitlines()[-1] == last
    for named in ((VALID, "-"), ("-o", "-", VALID)):
        code, shown = on_terminal(*words, "--quiet", *named)
        assert code == 0
        assert shown.startswith("# vtk DataFile")
    code, shown = on_terminal(*words, "--dry-run", VALID)
    assert code == 0
    assert "# vtk" not in shown
    assert "332 triangles" in shown
