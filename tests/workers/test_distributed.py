"""One mesh over several processes: the bytes are those of one, and no process waits for ever."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import generate
import meshio
import numpy as np
import over_ranks
import pytest
from meshes import tangle
from over_ranks import METHODS
from places import MPIEXEC, SAMPLES, needs_mpi

pytest.importorskip(
    "pymetis", reason="without pymetis no mesh is shared among processes: pip install 'meshfix-cli[mpi]'"
)
from meshfix_cli import kernels
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.workers import mpi
from meshfix_cli.workers.distributed import Part, Ranks, partition, parts

MESHFIX = [sys.executable, "-m", "meshfix_cli"]
LONGEST = 600  # seconds for a run, which takes some; no process waits for ever
SOME = 6  # moves in one run


def mpiexec(count: int, *command: object, code: int = 0, **options: Any) -> subprocess.CompletedProcess[str]:
    words = [str(MPIEXEC), "-n", str(count), *map(str, command)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=LONGEST, **options)
    assert done.returncode == code, done.stdout + done.stderr
    return done


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """More than 300,000 tetrahedra, P=10, D=h, as binary VTK."""
    mesh = tangle(Mesh.build(*generate.bracket(0.0355, 12)), 10, 1)
    assert mesh.topology.m > 300_000
    path = tmp_path_factory.mktemp("large") / "large.vtk"
    cells = [("tetra", mesh.topology.simplices)]
    meshio.write(path, meshio.Mesh(mesh.points, cells), file_format="vtk42", binary=True)
    return path


@needs_mpi
def test_the_bytes_of_a_large_mesh_are_those_of_one_process(large: Path, tmp_path: Path) -> None:
    serial = tmp_path / "serial.vtk"
    subprocess.run([*MESHFIX, "untangle", "-q", large, serial], check=True)
    assert serial.read_bytes() != large.read_bytes()
    for ranks in (1, 2, 4):
        for turn in range(2):
            path = tmp_path / f"{ranks}-{turn}.vtk"
            threads = ("--threads", 2) if turn else ()
            done = mpiexec(ranks, *MESHFIX, "untangle", "--mpi", "--json", *threads, large, path)
            assert sha256(path) == sha256(serial)
            facts = json.loads(done.stdout)
            assert len(facts["ranks"]) == ranks
            assert sum(rank["vertices"] for rank in facts["ranks"]) == facts["vertices"]
    peaks = [rank["peak_mb"] for rank in facts["ranks"]]
    assert max(peaks[1:]) < peaks[0]  # only the reader has the whole


@needs_mpi
@pytest.mark.parametrize("first", range(0, len(METHODS), SOME))
def test_every_move_has_the_bits_of_one_process(first: int) -> None:
    names = list(METHODS)[first : first + SOME]
    done = mpiexec(3, sys.executable, over_ranks.__file__, *names)
    assert done.stdout.split("\n")[:-1] == [f"{name} True" for name in names]


def write(path: Path, form: str, mesh: Mesh, dtype: str, **options: object) -> None:
    points = np.zeros((len(mesh.points), 3), dtype=dtype)
    points[:, : mesh.dimension] = mesh.points
    cells = [("triangle" if mesh.dimension == 2 else "tetra", mesh.topology.simplices)]
    meshio.write(path, meshio.Mesh(points, cells), file_format=form, **options)


@needs_mpi
@pytest.mark.parametrize("name", ["double.vtk", "single.vtk", "text.vtk", "double.msh", "double.vtu", "skew.vtk"])
def test_formats(name: str, tmp_path: Path, bracket: Mesh, plate: Mesh) -> None:
    """In parts where the numbers are binary and stand in the file as they are, by the root elsewhere."""
    path, form = tmp_path / name, {".vtk": "vtk42", ".msh": "gmsh", ".vtu": "vtu"}[Path(name).suffix]
    mesh = tangle(plate if name == "skew.vtk" else bracket)
    write(path, form, mesh, "f4" if name == "single.vtk" else "f8", binary=name != "text.vtk")
    if name == "skew.vtk":
        skew = meshio.read(path)
        skew.points = skew.points @ np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
        meshio.write(path, skew, file_format="vtk42", binary=True)
    serial, shared = tmp_path / f"serial-{name}", tmp_path / f"shared-{name}"
    subprocess.run([*MESHFIX, "untangle", "-q", path, serial], check=True)
    mpiexec(2, *MESHFIX, "untangle", "--mpi", "-q", path, shared)
    assert shared.read_bytes() == serial.read_bytes()
    mpiexec(2, *MESHFIX, "untangle", "--mpi", "-q", path, path)
    assert path.read_bytes() == serial.read_bytes()


@needs_mpi
def test_stdout_and_the_report() -> None:
    sample = SAMPLES / "bracket_tangled.vtk"
    done = subprocess.run(
        [str(MPIEXEC), "-n", "2", *MESHFIX, "untangle", "--mpi", sample], capture_output=True, check=True
    )
    alone = subprocess.run([*MESHFIX, "untangle", "-q", sample], capture_output=True, check=True)
    assert done.stdout == alone.stdout
    lines = done.stderr.decode().splitlines()
    assert [line.split(":")[0] for line in lines if line.startswith("process ")] == ["process 0", "process 1"]
    assert lines[-1] == "valid: no element is inverted"


@needs_mpi
def test_sweeps_are_shown_once(tmp_path: Path) -> None:
    sample, out = SAMPLES / "bracket_tangled.vtk", tmp_path / "o.vtk"
    together = mpiexec(2, *MESHFIX, "untangle", "--mpi", "-v", sample, out).stderr
    alone = subprocess.run([*MESHFIX, "untangle", "-v", sample, out], capture_output=True, text=True, check=True).stderr
    assert [line.rsplit(",", 1)[0] for line in together.splitlines()] == [
        line.rsplit(",", 1)[0] for line in alone.splitlines()
    ]


@needs_mpi
def test_stdin_is_refused_once() -> None:
    done = mpiexec(2, *MESHFIX, "untangle", "--mpi", code=2)
    assert done.stderr.count("INPUT is a file") == 1


@needs_mpi
def test_an_error_is_one_line_and_ends_all(tmp_path: Path) -> None:
    bad = tmp_path / "bad.vtk"
    bad.write_text("# vtk DataFile Version 3.0\nbad\nASCII\nDATASET UNSTRUCTURED_GRID\n")
    done = mpiexec(3, *MESHFIX, "untangle", "--mpi", bad, tmp_path / "out.vtk", code=1)
    assert done.stdout + done.stderr == f"meshfix: error: {bad}: is truncated: the section POINTS is missing\n"
    assert [path.name for path in tmp_path.iterdir()] == ["bad.vtk"]


@needs_mpi
def test_inverted_elements_that_remain_are_told_by_the_exit_code(tmp_path: Path) -> None:
    mpiexec(2, *MESHFIX, "untangle", "--mpi", "-q", "--sweeps", 0, SAMPLES / "bracket_tangled.vtk",
            tmp_path / "o.vtk", code=3)  # fmt: skip


@needs_mpi
def test_a_process_that_fails_in_a_sweep_ends_all() -> None:
    done = mpiexec(3, sys.executable, "-c", FAILS, SAMPLES / "bracket_tangled.vtk", code=1)
    assert "meshfix: error: process 2: MemoryError" in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells of the writing end of a pipe what is in it")
def test_an_error_waits_for_the_launcher_to_read_it(tmp_path: Path) -> None:
    end, pipe = os.pipe()
    os.write(pipe, b"meshfix: error: ...\n")
    assert not mpi.drained(pipe, 0.01)
    reader = threading.Timer(0.05, os.read, (end, 100))
    reader.start()
    assert mpi.drained(pipe, 60)
    reader.join()
    os.close(pipe)
    os.close(end)
    assert mpi.drained(pipe, 0.01)
    with (tmp_path / "errors").open("w") as file:
        file.write("meshfix: error: ...\n")
        assert mpi.drained(file.fileno(), 0.01)


def test_a_signal_while_an_error_is_read_ends_all(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*arguments: object) -> bool:
        raise SystemExit(143)

    ended: list[tuple[str, int]] = []
    monkeypatch.setattr(mpi, "drained", interrupted)
    monkeypatch.setattr(os, "_exit", lambda code: ended.append(("exit", code)))
    comm: Any = SimpleNamespace(Abort=lambda code: ended.append(("Abort", code)))
    with pytest.raises(SystemExit):
        mpi.abort(comm, 1)
    assert ended == [("Abort", 1), ("exit", 1)]


# The command of the last process with a sweep that runs out of memory.
FAILS = """
import sys
from meshfix_cli.workers.distributed import Ranks
sweep = Ranks.sweep
def fail(self, *rest):
    if self.comm.rank == self.comm.size - 1:
        raise MemoryError
    return sweep(self, *rest)
Ranks.sweep = fail
from meshfix_cli.cli import main
main(["untangle", "--mpi", "-q", "--dry-run", sys.argv[1]])
"""


@needs_mpi
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_a_disk_that_fills_up_while_parts_are_written_changes_nothing(tmp_path: Path, bracket: Mesh) -> None:
    path = tmp_path / "mesh.vtk"
    write(path, "vtk42", tangle(bracket), "f8", binary=True)
    original = path.read_bytes()
    done = mpiexec(2, sys.executable, "-c", FULL, path, code=1)
    assert done.stderr.count("meshfix: error: ") == done.stderr.count("\n") == 1
    assert path.read_bytes() == original
    assert list(tmp_path.iterdir()) == [path]


# The command with a disk that has no room left when the coordinates are put into the copy.
FULL = """
import sys
from pathlib import Path
from meshfix_cli.workers.distributed import Root
put = Root.put
Root.put = lambda self, path, *rest: put(self, Path("/dev/full"), *rest)
from meshfix_cli.cli import main
main(["untangle", "--mpi", "-q", sys.argv[1], sys.argv[1]])
"""


@needs_mpi
def test_a_process_that_fails_before_its_part_is_written_leaves_nothing(tmp_path: Path, bracket: Mesh) -> None:
    path = tmp_path / "mesh.vtk"
    write(path, "vtk42", tangle(bracket), "f8", binary=True)
    original = path.read_bytes()
    done = mpiexec(2, sys.executable, "-c", NO_ROOM, path, code=1)
    assert done.stderr == f"meshfix: error: {path}: process 1: MemoryError\n"
    assert path.read_bytes() == original
    assert list(tmp_path.iterdir()) == [path]


# The command with a process that has no memory to sort what it writes.
NO_ROOM = """
import sys
import meshfix_cli.workers.distributed as distributed
put = distributed._put
def argsort(*arguments, **options):
    raise MemoryError
def _put(comm, *rest):
    if comm.rank == 1:
        distributed.np = type("", (), {"argsort": argsort})
    return put(comm, *rest)
distributed._put = _put
from meshfix_cli.cli import main
main(["untangle", "--mpi", "-q", sys.argv[1], sys.argv[1]])
"""


@needs_mpi
def test_a_signal_ends_all_without_a_word(tmp_path: Path) -> None:
    """Sent to one of the processes in the middle of a sweep, as launchers do to all of them."""
    done = mpiexec(2, sys.executable, "-c", STOPPED, SAMPLES / "bracket_tangled.vtk", tmp_path / "o.vtk", code=143)
    assert "Traceback" not in done.stderr
    assert "meshfix: error" not in done.stderr
    assert list(tmp_path.iterdir()) == []


STOPPED = """
import signal, sys
from meshfix_cli.workers.distributed import Ranks
sweep = Ranks.sweep
def stopped(self, *arguments):
    if self.comm.rank == 0:
        signal.raise_signal(signal.SIGTERM)
    return sweep(self, *arguments)
Ranks.sweep = stopped
from meshfix_cli.cli import main
main(["untangle", "--mpi", "-q", *sys.argv[1:]])
"""


def failing(environment: dict[str, str], *command: str) -> str:
    words = [*command, "untangle", "--mpi", "-q", "--dry-run", str(SAMPLES / "plate_tangled.vtk")]
    environment = {**os.environ, **environment}
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=60, env=environment)
    assert done.returncode == 1, done.stderr
    assert done.stderr.count("\n") == 1, done.stderr
    return done.stderr


@needs_mpi
def test_the_launcher_of_another_mpi_is_refused() -> None:
    assert "the launcher started 4 processes" in failing({"OMPI_COMM_WORLD_SIZE": "4"}, *MESHFIX)


@needs_mpi
def test_a_missing_partitioner_is_named_once() -> None:
    hidden = "import sys; sys.modules['pymetis'] = None; from meshfix_cli.cli import main; main()"
    assert "pymetis is not installed" in failing({}, str(MPIEXEC), "-n", "2", sys.executable, "-c", hidden)


def all_parts(mesh: Mesh, ranks: int) -> list[Part]:
    return list(parts(mesh, ranks, np.inf, 1))


@pytest.mark.parametrize("ranks", [1, 2, 3, 5, 40])
def test_parts_are_whole_blocks_and_one_layer_of_ghosts(fine: Mesh, ranks: int) -> None:
    """By definition, against sets of Python."""
    stars = fine.topology.stars()
    found = all_parts(fine, ranks)
    own = [set(part.vertices[: part.own].tolist()) for part in found]
    assert sum(map(len, own)) == len(set().union(*own)) == len(stars.vertices)
    simplices = 0
    for part, mine in zip(found, own, strict=True):
        here = np.isin(stars.simplices, list(mine)).any(axis=1)
        assert part.codes is None
        np.testing.assert_array_equal(part.vertices[part.nodes], stars.simplices[here])
        assert set(part.vertices[part.own :].tolist()) == set(stars.simplices[here].ravel().tolist()) - mine
        assert (np.diff(part.vertices[: part.own]) > 0).all()
        for ghost, owner in zip(part.vertices[part.own :].tolist(), part.owners.tolist(), strict=True):
            assert ghost in own[owner]
        simplices += int(part.own_elements.sum())
    assert simplices == fine.topology.m


@pytest.mark.parametrize("name", over_ranks.ELEMENTS)
@pytest.mark.parametrize("ranks", [1, 2, 3])
def test_parts_have_all_elements_of_their_vertices(name: str, ranks: int) -> None:
    """Whole, in the order of the mesh; what the kernels know of a part is what they know of the mesh."""
    mesh = Mesh.build(*over_ranks.ELEMENTS[name]())
    stars, count = mesh.topology.stars(), 0
    rows = np.split(stars.nodes, stars.node_offsets[1:-1])
    for part in all_parts(mesh, ranks):
        mine = set(part.vertices[: part.own].tolist())
        here = [e for e, nodes in enumerate(rows) if mine & set(nodes.tolist())]
        held = part.topology(1).stars()
        assert held.codes.tolist() == stars.codes[here].tolist()
        nodes = np.split(part.vertices[held.nodes], held.node_offsets[1:-1])
        assert [row.tolist() for row in nodes if len(row)] == [rows[e].tolist() for e in here]
        assert set(part.vertices[part.own :].tolist()) == {v for e in here for v in rows[e].tolist()} - mine
        for own in range(0, part.own, 97):
            vertex = part.vertices[own]
            for offsets, values in (("offsets", "faces"), ("neighbour_offsets", "neighbours")):
                (a, b), (c, d) = (getattr(one, offsets)[[v, v + 1]] for one, v in ((held, own), (stars, vertex)))
                k = mesh.dimension if values == "faces" else 1
                one, other = getattr(held, values).ravel()[k * a : k * b], getattr(stars, values).ravel()[k * c : k * d]
                np.testing.assert_array_equal(one if values == "faces" else part.vertices[one], other)
        count += int(part.own_elements.sum())
    assert count == mesh.topology.m


def test_the_partition_is_balanced(fine: Mesh) -> None:
    stars = fine.topology.stars()
    blocks = partition(stars, 3)
    assert set(blocks.tolist()) == {0, 1, 2}
    work = np.bincount(blocks, weights=np.diff(stars.offsets[:: kernels.BLOCK_SIZE], append=len(stars.corners)))
    assert work.max() <= 1.2 * work.mean()


def test_a_rank_among_values_is_found_by_bisection(
    random: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    team: Any = object.__new__(Ranks)
    monkeypatch.setattr(team, "total", lambda count: count, raising=False)
    for values in (random.random(1001), np.zeros(7), np.array([0.0, -0.0, 1e-300, 3.0]), random.random(1)):
        for percent in (0, 1, 37.5, 100):
            rank = int(percent / 100 * (len(values) - 1))
            assert team.ranked(values, percent) == np.sort(values)[rank]
