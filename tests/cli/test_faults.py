"""Whatever happens while a file is written, the original is whole, and what is left behind is nothing."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import meshio
import numpy as np
import pytest
from commands import POSIX, SLOW_DISK, SLOW_MESHIO, WRITES_FOR_EVER, run, start
from places import SAMPLES

from meshfix_cli import read, untangle, write
from meshfix_cli.errors import WriteError
from meshfix_cli.meshfile.atomic import write_file


@POSIX
def test_killed_at_twenty_moments_of_writing(tmp_path: Path, random: np.random.Generator) -> None:
    path = tmp_path / "mesh.vtk"
    shutil.copy(SAMPLES / "bracket_tangled.vtk", path)
    document = read(path)
    write(document, untangle(document.mesh).after, tmp_path / "repaired.vtk")
    versions = {(SAMPLES / "bracket_tangled.vtk").read_bytes(), (tmp_path / "repaired.vtk").read_bytes()}
    assert len(versions) == 2
    for _ in range(20):
        shutil.copy(SAMPLES / "bracket_tangled.vtk", path)
        with start(WRITES_FOR_EVER, path) as child:
            time.sleep(random.uniform(0, 0.05))
            child.kill()
        assert path.read_bytes() in versions


@POSIX
@pytest.mark.parametrize("source", ["plate_tangled.vtk", "mesh.post"])
def test_a_signal_is_no_error_of_meshio(source: str, tmp_path: Path) -> None:
    meshio.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [("triangle", [[0, 1, 2]])]).write(tmp_path / "mesh.post")
    path = SAMPLES / source if (SAMPLES / source).exists() else tmp_path / source
    with start(SLOW_MESHIO, "untangle", "-q", path, tmp_path / "out.ply") as child:
        child.send_signal(signal.SIGTERM)
        _, complaint = child.communicate(timeout=30)
    assert child.returncode == 143
    assert complaint.startswith(b"meshfix: interrupted while ")
    assert complaint.count(b"\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["mesh.post"]


@POSIX
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_leaves_no_temporary_file(name: str, tmp_path: Path) -> None:
    path = tmp_path / "mesh.vtk"
    shutil.copy(SAMPLES / "plate_tangled.vtk", path)
    original = path.read_bytes()
    with start(SLOW_DISK, "untangle", "-q", path, path) as child:
        assert len(list(tmp_path.iterdir())) == 2
        child.send_signal(getattr(signal, name))
        _, complaint = child.communicate(timeout=30)
    assert child.returncode == 128 + getattr(signal, name)
    assert complaint.startswith(b"meshfix: interrupted while writing; ") or name == "SIGHUP"
    assert path.read_bytes() == original
    assert list(tmp_path.iterdir()) == [path]


def test_a_directory_that_vanishes_is_one_error(tmp_path: Path) -> None:
    folder = tmp_path / "gone"
    folder.mkdir()

    def produce(temporary: Path) -> None:
        temporary.write_bytes(b"mesh")
        shutil.rmtree(folder)

    with pytest.raises(WriteError, match="No such file or directory"):
        write_file(str(folder / "mesh.vtk"), produce)
    assert not folder.exists()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="limits of POSIX")
@pytest.mark.parametrize("share", [0.0, 0.3, 0.99])
def test_a_full_disk_leaves_the_original(share: float, tmp_path: Path) -> None:
    """The kernel refuses to write beyond a share of the file."""
    import resource

    path = tmp_path / "mesh.vtk"
    shutil.copy(SAMPLES / "bracket_tangled.vtk", path)
    original = path.read_bytes()
    limit = int(share * len(original))
    done = subprocess.run(
        [sys.executable, "-m", "meshfix_cli", "untangle", "-q", "--backup", str(path), str(path)],
        capture_output=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    assert done.returncode == 1
    assert done.stderr.count(b"\n") == 1
    assert b"File too large" in done.stderr
    assert path.read_bytes() == original
    assert list(tmp_path.iterdir()) == [path]


def test_backups_never_replace_one_another(tmp_path: Path) -> None:
    path = tmp_path / "mesh.vtk"
    shutil.copy(SAMPLES / "plate_tangled.vtk", path)
    contents = [path.read_bytes()]
    for strength in ("1h", "2h"):
        run("perturb", "-q", "--percent", 25, "--dist", strength, "--backup", path, path)
        contents.append(path.read_bytes())
    assert (tmp_path / "mesh.vtk.bak").read_bytes() == contents[0]
    assert (tmp_path / "mesh.vtk.bak1").read_bytes() == contents[1]
    assert len(set(contents)) == 3
    run("untangle", "-q", "--backup", path, tmp_path / "new.vtk")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mesh.vtk", "mesh.vtk.bak", "mesh.vtk.bak1", "new.vtk"]


@pytest.mark.parametrize("name", ["plate_tangled.vtk", "bracket_tangled.vtk", "two_materials.msh", "plate_tangled.obj"])
def test_a_second_run_changes_no_byte(name: str, tmp_path: Path) -> None:
    once, twice = tmp_path / f"once_{name}", tmp_path / f"twice_{name}"
    run("untangle", "-q", SAMPLES / name, once)
    done = run("untangle", once, twice)
    assert twice.read_bytes() == once.read_bytes()
    assert b"nothing was moved" in done.stdout


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_signal_at_any_time_ends_without_a_traceback(tmp_path: Path) -> None:
    """Also while modules are imported, where Python may drop an exception; later in a line that says how far it was."""
    for delay in np.linspace(0.02, 0.3, 8).tolist():
        words = ["untangle", "-q", SAMPLES / "bracket_tangled.vtk", tmp_path / "o"]
        command = [sys.executable, "-m", "meshfix_cli", *map(str, words)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as child:
            time.sleep(delay)
            child.send_signal(signal.SIGTERM)
            printed, complaint = child.communicate(timeout=30)
        assert child.returncode in (0, -signal.SIGTERM, 128 + signal.SIGTERM)
        assert re.fullmatch(rb"(meshfix: interrupted [^\n]+\n)?", printed + complaint)
        assert {path.name for path in tmp_path.iterdir()} <= {"o"}
