"""A batch on the processes of MPI, on the workers of Dask, and in an array job."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from pathlib import Path

import pytest
from commands import error_line, fill, statuses
from places import BINARIES, MPIEXEC, ROOT, needs_mpi


def shown(start: str) -> list[str]:
    """The words of a command that docs/many.md shows for clusters, for three processes at most."""
    (line,) = (line for line in (ROOT / "docs/many.md").read_text().splitlines() if line.startswith(start))
    return ["env", f"PATH={BINARIES}", *shlex.split(line.replace("-n 64", "-n 3"))]


@pytest.fixture
def cluster(tmp_path: Path) -> Path:
    """The folder that its commands speak of; mesh 3 is not one."""
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    fill(meshes, *(f"{i}.vtk" for i in range(7)))
    (meshes / "3.vtk").write_bytes(b"")
    return tmp_path


def check_cluster(folder: Path, command: list[str]) -> None:
    """All files but one are repaired, by more than one worker."""
    done = subprocess.run([*command, "--json"], cwd=folder, capture_output=True, check=False, timeout=60)
    assert done.returncode == 4, done.stderr.decode()
    assert statuses(done) == {f"{i}.vtk": "failed" if i == 3 else "valid" for i in range(7)}
    lines = done.stderr.decode().splitlines()
    (complaint,) = (line for line in lines if "waiting for the first" not in line)  # workers may be late
    assert complaint.startswith("meshfix: error: ")
    assert complaint.endswith("meshes/3.vtk: is empty")
    assert len(list((folder / "repaired").iterdir())) == 6


@needs_mpi
def test_mpi(cluster: Path) -> None:
    command = shown("mpiexec -n 64")
    check_cluster(cluster, command)
    wrong = subprocess.run(
        [*command, "--output-dir", "meshes"], cwd=cluster, capture_output=True, check=False, timeout=60
    )
    assert wrong.stderr.count(b"would replace the input") == 1


@needs_mpi
def test_a_process_of_mpi_that_cannot_work_ends_all(tmp_path: Path) -> None:
    fill(tmp_path, "a.vtk")
    command = [str(MPIEXEC), "-n", "3", sys.executable, "-c", BROKEN, "a.vtk", "repaired"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 1
    assert "meshfix: error: process 2: MemoryError\n" in done.stderr


# The command with a last process that has no memory to begin its work.
BROKEN = """
import sys
from mpi4py import MPI, futures
enter = futures.MPICommExecutor.__enter__
def fail(self):
    if MPI.COMM_WORLD.rank == 2:
        raise MemoryError
    return enter(self)
futures.MPICommExecutor.__enter__ = fail
from meshfix_cli.cli import main
main(["batch", "--executor", "mpi", "-q", sys.argv[1], "--output-dir", sys.argv[2]])
"""


@pytest.mark.parametrize("variable", ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"])
def test_the_launcher_of_another_mpi_is_refused(variable: str, cluster: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mpi4py", reason="the extra mpi is not installed")
    try:
        from mpi4py import MPI
    except RuntimeError:
        pytest.skip("there is no MPI library")
    assert MPI.COMM_WORLD.Get_size() == 1
    monkeypatch.setenv(variable, "4")
    arguments = ["batch", "--executor", "mpi", "--output-dir", cluster / "repaired", cluster / "meshes" / "*.vtk"]
    assert "the launcher started 4 processes, and mpi4py sees 1: it uses another MPI" in error_line(*arguments)
    assert not (cluster / "repaired").exists()


@pytest.mark.parametrize(
    ("module", "raised", "words"),
    [
        ("mpi4py", "ImportError('no such module')", "pip install 'meshfix-cli[mpi]' mpich"),
        ("mpi4py", "RuntimeError('cannot load MPI library')", "load the cluster's own, or pip install mpich"),
        ("distributed", "ImportError('no such module')", "Dask is not installed: pip install 'meshfix-cli[dask]'"),
    ],
)
def test_what_is_not_installed_is_named(
    module: str, raised: str, words: str, cluster: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (cluster / f"{module}.py").write_text(f"raise {raised}")
    monkeypatch.setenv("PYTHONPATH", str(cluster))
    where = ["--executor", "mpi"] if module == "mpi4py" else ["--executor", "dask", "--scheduler-file", "s.json"]
    assert words in error_line("batch", *where, "--output-dir", cluster / "repaired", cluster / "meshes" / "*.vtk")


def test_dask(cluster: Path) -> None:
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    programs = [
        [*shown("dask scheduler")[:-1], "--port", "0", "--dashboard-address", ":0"],
        [
            *shown("srun -n 64 dask worker")[:2],
            *shown("srun -n 64 dask worker")[5:-1],
            "--nworkers",
            "2",
        ],
    ]
    running = [
        subprocess.Popen(program, cwd=cluster, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for program in programs
    ]
    try:
        for _ in range(600):
            if (cluster / "scheduler.json").exists():
                break
            time.sleep(0.05)
        check_cluster(cluster, shown("meshfix batch --executor dask"))
    finally:
        for program in running[::-1]:
            program.terminate()
            program.wait(timeout=30)


def test_a_scheduler_file_that_is_none(cluster: Path) -> None:
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    (cluster / "s.json").write_text("{}")
    for name, words in (
        ("s.json", "is not a file of a Dask scheduler"),
        ("none.json", "is the Dask scheduler running?"),
    ):
        where = ["--executor", "dask", "--scheduler-file", cluster / name]
        line = error_line("batch", *where, "--output-dir", cluster / "repaired", cluster / "meshes" / "*.vtk")
        assert words in line


def test_a_job_of_a_slurm_array(cluster: Path) -> None:
    (wrapped,) = (word for word in shown("sbatch") if word.startswith("meshfix"))
    environment = {**os.environ, "SLURM_ARRAY_TASK_ID": "2"}
    command = [*shown("sbatch")[:2], "bash", "-c", wrapped.replace("\\$", "$") + " --json"]
    done = subprocess.run(command, cwd=cluster, env=environment, capture_output=True, check=False)
    assert statuses(done) == {"1.vtk": "valid"}
