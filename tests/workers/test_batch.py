"""Many meshes at once: what becomes of each, whatever becomes of the others, of the workers and of the command."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future, wait
from html import unescape
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
from commands import MESHFIX, TANGLED, VALID, error_line, fill, on_terminal, results, run, statuses
from places import SAMPLES

from meshfix_cli import __version__, read
from meshfix_cli.quality.requirement import Requirement
from meshfix_cli.repair import Files, Held, Method, Morph
from meshfix_cli.repair.judge import Judge
from meshfix_cli.workers import batch

POSIX = pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="needs signals and /proc")

# A disk on which some files take their time, or are the end of whoever writes them. Imported by every process.
DISK = """
import os, signal, time
from pathlib import Path

really = os.fsync

def fsync(fd):
    name, told = os.readlink(f"/proc/self/fd/{fd}"), Path(os.environ["TOLD"])
    if "deadly" in name:
        os.kill(os.getpid(), signal.SIGKILL)
    if "slow" in name and not list(told.glob("slow*")):
        (told / f"slow{os.getpid()}").touch()
        time.sleep(60)
    really(fd)

os.fsync = fsync
"""


@pytest.fixture
def inputs(tmp_path: Path) -> Path:
    folder = tmp_path / "in"
    folder.mkdir()
    return folder


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "out"


class Here(Executor):
    """Does nothing until it is asked to."""

    def __init__(self) -> None:
        self.out: list[tuple[Future[Any], Any]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.out.append((Future(), lambda: fn(*args)))
        return self.out[-1][0]

    def finish(self, which: int) -> None:
        future, call = self.out.pop(which)
        try:
            future.set_result(call())
        except OSError as error:
            future.set_exception(error)


def tasks(count: int) -> list[batch.Task]:
    return [batch.Task(Files(f"{i}.vtk", f"out/{i}.vtk"), Held(), Morph(), Method(), Judge()) for i in range(count)]


def name(task: batch.Task) -> batch.Result:
    return task.result("valid", 0.0)


def test_a_batch_tells_of_each_file_and_of_all(inputs: Path, out: Path) -> None:
    fill(inputs, "a.vtk", "b.vtk")
    done = run("batch", "--jobs", 2, inputs / "*.vtk", "--output-dir", out / "made" / "here")
    lines = done.stdout.decode().splitlines()
    for file in (inputs / "a.vtk", inputs / "b.vtk"):
        (line,) = (line for line in lines if line.startswith(f"{file}: "))
        assert "valid, 89 inverted -> 0, smallest angle 0.022° -> 30.703°, " in line
    assert any("inverted elements" in line and "178" in line for line in lines)
    assert lines[-1].endswith(" files a second")
    assert done.stderr == b""
    once = run("untangle", "-q", TANGLED, out / "once.vtk")
    assert once.returncode == 0
    for file in (out / "made" / "here").iterdir():
        assert file.read_bytes() == (out / "once.vtk").read_bytes()


def test_a_bad_file_costs_only_itself(inputs: Path, out: Path, tmp_path: Path) -> None:
    good = fill(inputs, "a.vtk", "b.vtk")
    (inputs / "bad.vtk").write_bytes(b"\x00noise" * 99)
    arguments = [good[0], inputs / "bad.vtk", inputs / "none.vtk", good[1]]
    report, page = tmp_path / "report.json", tmp_path / "report.html"
    options = ["--report-json", report, "--report", page, "--strategy", "US"]
    done = run("batch", *options, *arguments, "--output-dir", out, code=4)
    complaints = sorted(done.stderr.decode().splitlines())
    assert complaints[0].startswith(f"meshfix: error: {inputs / 'bad.vtk'}: is not a readable vtk")
    assert complaints[1:] == [f"meshfix: error: {inputs / 'none.vtk'}: No such file or directory"]
    assert done.stdout.count(b": valid, 89 inverted -> 0") == 2
    assert sorted(p.name for p in out.iterdir()) == ["a.vtk", "b.vtk"]
    told = json.loads(report.read_text())
    assert (told["schema"], told["version"], told["total"]) == (1, __version__, 4)
    assert told["options"]["strategy"] == "US"
    assert [one["file"] for one in told["files"]] == list(map(str, arguments))
    assert [one["status"] for one in told["files"]] == ["valid", "failed", "failed", "valid"]
    assert (told["files"][0]["before"]["inverted"], told["files"][0]["after"]["inverted"]) == (89, 0)
    assert told["files"][1]["before"] is None
    shown = page.read_text()
    assert "<title>4 meshes – meshfix</title>" in shown
    assert "Not all are valid" in shown
    assert cells(shown, inputs / "none.vtk") == ["No such file or directory"]
    assert cells(shown, inputs / "a.vtk")[:6] == ["valid", "332", "89", "0", "0.022°", "35.886°"]
    assert cells(shown, "inverted elements") == ["178", "0"]
    assert cells(shown, "--strategy") == ["US"]
    assert "<script" not in shown


def cells(page: str, name: object) -> list[str]:
    """What stands in the row of a name."""
    row = page.partition(f'<th scope="row">{name}</th>')[2].partition("</tr>")[0]
    return [unescape(one) for one in re.findall(r"<td>(.*?)</td>", row)]


def test_what_is_not_valid_or_not_met_exits_4(inputs: Path, out: Path) -> None:
    (path,) = fill(inputs, "a.vtk")
    arguments = ["batch", "--sweeps", 0, path, "--output-dir", out]
    assert b"a.vtk: NOT VALID, 89 inverted -> 89" in run(*arguments, code=4).stdout
    run(*arguments, "--allow-inverted")
    line = run("batch", "--require", "min_angle > 80", path, "--output-dir", out, code=4).stdout
    assert b"0, smallest angle 0.022\xc2\xb0 -> 30.703\xc2\xb0, NOT MET: min_angle > 80" in line
    arguments = ["--quiet", "--require", "min_angle > 80", "--allow-inverted", path, "--output-dir", out]
    assert run("batch", *arguments, code=4).stdout == b""


def test_json_lines(inputs: Path, out: Path) -> None:
    fill(inputs, "a.vtk", "b.vtk")
    (inputs / "bad.vtk").write_bytes(b"")
    done = run("batch", "--json", inputs / "*", "--output-dir", out, "--metric", "aspect_ratio", code=4)
    told = results(done)
    assert statuses(done) == {"a.vtk": "valid", "b.vtk": "valid", "bad.vtk": "failed"}
    single = json.loads(run("untangle", "--json", inputs / "a.vtk", out / "a.vtk").stdout)
    assert single.keys() <= told["a.vtk"].keys()
    assert told["a.vtk"]["quality"]["smoothed"].keys() == single["quality"]["smoothed"].keys()
    assert told["a.vtk"]["output"] == str(out / "a.vtk")
    assert told["bad.vtk"]["error"].endswith("is empty")


def test_progress_is_for_terminals(inputs: Path, out: Path) -> None:
    fill(inputs, "a.vtk", "b.vtk")
    code, shown = on_terminal("batch", "--jobs", 1, inputs / "*.vtk", "--output-dir", out)
    assert code == 0
    assert "0 of 2 files" in shown
    assert "1 of 2 files" in shown
    assert shown.count(": valid, 89 inverted -> 0") == 2


def test_files_are_found_in_order_and_once(inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (inputs / "deep" / "er.vtk").mkdir(parents=True)
    fill(inputs, "b.vtk", "a.vtk", "[x].vtk", "deep/c.vtk")
    monkeypatch.chdir(tmp_path)
    assert list(batch.expanded(["in/**/*.vtk", "in/[x].vtk", "none.vtk"])) == [
        *("in/[x].vtk", "in/a.vtk", "in/b.vtk", "in/deep/c.vtk"), "in/[x].vtk", "none.vtk",
    ]  # fmt: skip
    with pytest.raises(ValueError, match=r"no file matches 'in/\*\.msh'"):
        list(batch.expanded(["in/*.msh"]))
    assert batch.distinct(["in/a.vtk", "b.vtk", "./in/a.vtk", str(tmp_path / "b.vtk")]) == ["in/a.vtk", "b.vtk"]
    (tmp_path / "list").write_bytes(b"in/a.vtk\n\n in/b .vtk\r\nin/\xff.vtk")
    assert batch.named_in("list") == ["in/a.vtk", " in/b .vtk", os.fsdecode(b"in/\xff.vtk")]


def test_files_from_a_list(inputs: Path, out: Path) -> None:
    names = "\n".join(map(str, fill(inputs, "a.vtk", "b.vtk"))).encode()
    done = run("batch", "--json", "--files-from", "-", "--output-dir", out, inputs / "a.vtk", data=names)
    assert statuses(done) == {"a.vtk": "valid", "b.vtk": "valid"}
    assert "No such file" in error_line("batch", "--files-from", inputs / "none", "--output-dir", out)


def test_shards_cover_all_files_once(inputs: Path, out: Path) -> None:
    fill(inputs, *(f"{i}.vtk" for i in range(5)))
    shards = [
        statuses(run("batch", "--json", "--jobs", 1, "--shard", f"{i}/3", inputs / "*.vtk", "--output-dir", out))
        for i in (1, 2, 3)
    ]
    assert [sorted(shard) for shard in shards] == [["0.vtk", "3.vtk"], ["1.vtk", "4.vtk"], ["2.vtk"]]
    empty = run("batch", "--shard", "9/9", inputs / "*.vtk", "--output-dir", out)
    assert empty.stdout == b"no file falls to this shard: nothing was done\n"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["in/*.msh"], "no file matches 'in/*.msh'"),
        ([], "there is no IN"),
        (["in/a.vtk", "in/deep/a.vtk"], "in/a.vtk and in/deep/a.vtk would both be written to out/a.vtk"),
        (["in/a.vtk", "in/deep/a.vtk", "--shard", "1/2"], "would both be written"),
        (["in/a.vtk", "--output-dir", "in"], "in/a.vtk would replace the input in/a.vtk"),
        (["in/a.vtk", "--output-dir", "link"], "link/a.vtk would replace the input in/a.vtk"),
        (["in/a.vtk", "--report-json", "r.html"], "r.html: the name of a report as JSON ends in .json"),
        (["in/a.vtk", "--report", "r.json"], "r.json: the name of a report ends in .html or .htm"),
        (["in/a.json", "--report-json", "in/a.json"], "the report in/a.json would replace the input in/a.json"),
        (["in/a.json", "--report-json", "out/a.json"], "in/a.json and out/a.json would both be written to out/a.json"),
        (["in/a.vtk", "--report", "r", "--report-json", "r"], "r and r would both be written to r"),
        (["in/a.vtk", "--shard", "0/2"], "'0/2' is not such as 1/8"),
        (["in/a.vtk", "--shard", "3/2"], "'3/2' is not such as 1/8"),
        (["in/a.vtk", "--executor", "dask"], "--executor dask and --scheduler-file go together"),
        (["in/a.vtk", "--scheduler-file", "s.json"], "--executor dask and --scheduler-file go together"),
    ],
)
def test_wrong_usage_is_told_before_any_work(
    arguments: list[str], words: str, tmp_path: Path, inputs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (inputs / "deep").mkdir()
    (tmp_path / "link").symlink_to(inputs)
    fill(inputs, "a.vtk", "deep/a.vtk")
    monkeypatch.chdir(tmp_path)
    assert words in error_line("batch", "--output-dir", "out", *arguments, code=2)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["in", "link"]


@POSIX
def test_links_to_one_file_are_repaired_each_and_none_is_written_through(inputs: Path, tmp_path: Path) -> None:
    fill(inputs, "a.vtk")
    (inputs / "link.vtk").symlink_to("a.vtk")
    out = tmp_path / "out"
    run("batch", "-q", "--jobs", 1, inputs / "*.vtk", "--output-dir", out)
    assert (out / "a.vtk").read_bytes() == (out / "link.vtk").read_bytes() != (inputs / "a.vtk").read_bytes()
    assert not (out / "link.vtk").is_symlink()
    (out / "a.vtk").unlink()
    (out / "a.vtk").symlink_to(inputs / "link.vtk")
    said = error_line("batch", inputs / "a.vtk", "--output-dir", out, code=2)
    assert f"{out / 'a.vtk'} would replace the input" in said


def test_nothing_is_done_where_nothing_can_be_written(inputs: Path, tmp_path: Path) -> None:
    fill(inputs, "a.vtk")
    (tmp_path / "file").touch()
    assert "is not a folder" in error_line("batch", inputs / "a.vtk", "--output-dir", tmp_path / "file")
    arguments = ["batch", inputs / "a.vtk", "--output-dir", tmp_path / "out"]
    assert "does not exist" in error_line(*arguments, "--report-json", tmp_path / "no" / "r.json")
    assert list((tmp_path / "out").iterdir()) == []


def test_only_so_many_files_are_out() -> None:
    executor, taken = Here(), 0

    def counted() -> Iterator[batch.Task]:
        nonlocal taken
        for task in tasks(9):
            taken += 1
            yield task

    done: list[str] = []
    running = batch.run(executor, counted(), 3, name)
    seen = []

    def finish_the_last(out: Any, return_when: str) -> Any:
        seen.append((len(executor.out), taken - len(done)))
        executor.finish(-1)
        return wait(out, return_when=return_when)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("meshfix_cli.workers.batch.wait", finish_the_last)
        done += (one["file"] for one in running)
    assert sorted(done) == [f"{i}.vtk" for i in range(9)]
    assert done[0] == "2.vtk"  # as they come
    assert max(seen) == (3, 3)


class Now(Executor):
    """Does at once what it is asked to."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args))
        except OSError as error:
            future.set_exception(error)
        return future


def test_what_raises_is_tried_once_more_after_the_others() -> None:
    tried: list[str] = []

    def fail(task: batch.Task) -> batch.Result:
        tried.append(task.files.source)
        if task.files.source == "1.vtk" or tried.count(task.files.source) == 1:
            raise OSError("gone")
        return name(task)

    told = {one["file"]: one for one in batch.run(Now(), iter(tasks(4)), 2, fail)}
    assert [sorted(tried[i : i + 2]) for i in (0, 2, 4, 6)] == [["0.vtk", "1.vtk"]] * 2 + [["2.vtk", "3.vtk"]] * 2
    assert [told[f"{i}.vtk"]["status"] for i in range(4)] == ["valid", "failed", "valid", "valid"]
    assert told["1.vtk"]["error"] == "OSError, twice: gone"


def test_a_reader_that_goes_away_is_no_traceback(inputs: Path, out: Path) -> None:
    fill(inputs, *(f"{i}.vtk" for i in range(9)))
    command = f"{MESHFIX} batch '{inputs}/*.vtk' --output-dir {out} | head -n 1"
    done = subprocess.run(["bash", "-c", command], capture_output=True, check=False)
    assert (done.stdout.count(b"\n"), done.stderr) == (1, b"")


@pytest.fixture
def environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give all processes the slow disk; the folder in which it tells who waits for it."""
    told = tmp_path / "told"
    told.mkdir()
    (told / "sitecustomize.py").write_text(DISK)
    monkeypatch.setenv("TOLD", str(told))
    monkeypatch.setenv("PYTHONPATH", str(told))
    return told


def start(*arguments: object) -> subprocess.Popen[bytes]:
    command = [MESHFIX, "batch", "--json", *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)


def who_waits(told: Path) -> int:
    """The process that writes to the slow disk."""
    for _ in range(600):
        for path in told.glob("slow*"):
            return int(path.name.removeprefix("slow"))
        time.sleep(0.05)
    raise AssertionError("nobody writes")


def alive(group: int) -> list[int]:
    """The processes of a group that still run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:  # it has just ended
            continue
        if int(fields[2]) == group and fields[0] != "Z":
            found.append(int(stat.parent.name))
    return found


def wait_for_the_end_of_all(group: int) -> None:
    for _ in range(200):
        if not alive(group):
            return
        time.sleep(0.05)
    raise AssertionError("processes are left")


@POSIX
def test_a_worker_that_is_killed_is_replaced(inputs: Path, out: Path, environment: Path) -> None:
    names = [f"{i}.vtk" for i in range(6)]
    fill(inputs, *names, "slow.vtk")
    process = start("--jobs", 2, inputs / "*.vtk", "--output-dir", out)
    os.kill(who_waits(environment), signal.SIGKILL)
    printed, complaint = process.communicate(timeout=60)
    assert (process.returncode, complaint) == (0, b"")
    told = [json.loads(line) for line in printed.splitlines()]
    assert sorted(Path(one["file"]).name for one in told) == [*names, "slow.vtk"]
    assert {one["status"] for one in told} == {"valid"}
    assert all(read(out / name).mesh.check()[0] == 0 for name in [*names, "slow.vtk"])


@POSIX
def test_a_file_that_kills_its_worker_fails_alone(inputs: Path, out: Path, environment: Path) -> None:
    del environment
    names = [f"{i}.vtk" for i in range(4)]
    fill(inputs, "deadly.vtk", *names, "deadly2.vtk")
    done = run("batch", "--json", "--jobs", 2, inputs / "*.vtk", "--output-dir", out, code=4)
    assert statuses(done) == {**dict.fromkeys(names, "valid"), "deadly.vtk": "failed", "deadly2.vtk": "failed"}
    assert sorted(done.stderr.decode().splitlines()) == [
        f"meshfix: error: {inputs / name}: the worker died, twice (out of memory?)"
        for name in ("deadly.vtk", "deadly2.vtk")
    ]
    assert sorted(p.name for p in out.iterdir() if p.is_file()) == names


@POSIX
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_all_at_once_and_the_rest_is_resumed(
    number: signal.Signals, inputs: Path, out: Path, environment: Path, tmp_path: Path
) -> None:
    fill(inputs, "a.vtk", "b.vtk", "slow.vtk", "z.vtk")
    arguments = ["--jobs", 1, inputs / "*.vtk", "--output-dir", out, "--report-json", tmp_path / "report.json"]
    process = start(*arguments)
    who_waits(environment)
    assert any(p.is_dir() for p in out.iterdir())  # the temporary folder
    start_of_end = time.perf_counter()
    if number == signal.SIGINT:  # as the terminal sends it: to all
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    printed, complaint = process.communicate(timeout=30)
    assert time.perf_counter() - start_of_end < 5
    assert (process.returncode, complaint) == (128 + number, b"meshfix: interrupted, 2 of 4 files done\n")
    wait_for_the_end_of_all(process.pid)
    assert printed.count(b"\n") == 2
    assert sorted(p.name for p in out.iterdir()) == ["a.vtk", "b.vtk"]
    told = json.loads((tmp_path / "report.json").read_text())
    assert (len(told["files"]), told["total"]) == (2, 4)
    done = statuses(run("batch", "--json", "--resume", *arguments))
    assert done == {"a.vtk": "skipped", "b.vtk": "skipped", "slow.vtk": "valid", "z.vtk": "valid"}


@POSIX
def test_workers_end_with_the_command(inputs: Path, out: Path, environment: Path) -> None:
    fill(inputs, "a.vtk", "slow.vtk")
    process = start("--jobs", 2, inputs / "*.vtk", "--output-dir", out)
    who_waits(environment)
    assert process.stdout is not None
    assert b"a.vtk" in process.stdout.readline()
    assert len(alive(process.pid)) >= 3
    process.kill()
    wait_for_the_end_of_all(process.pid)
    process.communicate(timeout=60)
    assert [p.name for p in out.iterdir()] == ["a.vtk"]


def test_resume_does_again_what_is_old_broken_or_not_good_enough(inputs: Path, out: Path) -> None:
    out.mkdir()
    paths = fill(inputs, "bad.vtk", "good.vtk", "old.vtk", "tangled.vtk")

    def again(*requirements: str) -> list[str]:
        judge = Judge(requirements=tuple(map(Requirement.parse, requirements)))
        task = batch.Task(Files(), Held(), Morph(), Method(), judge, resume=True)
        return [batch.work(task.at(str(path), str(out / path.name)))["status"] for path in paths]

    assert again() == ["valid"] * 4
    (out / "bad.vtk").write_bytes(b"# vtk DataFile Version 3.0\n")
    os.utime(out / "old.vtk", (1, 1))
    shutil.copy(TANGLED, out / "tangled.vtk")
    assert again() == ["valid", "skipped", "valid", "valid"]
    assert again("min_angle > 5") == ["skipped"] * 4
    assert again("min_angle > 40") == ["invalid"] * 4
    paths[0].unlink()
    assert again() == ["failed", *["skipped"] * 3]
    told = run("batch", "--resume", paths[1], "--output-dir", out).stdout.decode()
    assert f"{paths[1]}: skipped, " in told


def test_options_reach_the_work(inputs: Path, out: Path) -> None:
    out.mkdir()
    (path,) = fill(inputs, "a.vtk")
    (out / "a.vtk").write_text("precious")
    options = ["--max-move", "0.35", "--only-invalid", "--smooth", 0, "--backup"]
    (told,) = results(run("batch", "--json", *options, path, "--output-dir", out)).values()
    assert told["displacement"]["largest"] <= 0.35
    assert {one["phase"] for one in told["sweeps"]} == {"input", "Laplacian", "back to the input"}
    assert (out / "a.vtk.bak").read_text() == "precious"


def test_many_meshes_get_back_the_shapes_of_one(inputs: Path, out: Path, tmp_path: Path) -> None:
    fill(inputs, "a.vtk", "b.vtk")
    command = ["batch", "--resume", "--json", "--jobs", 1, f"{inputs}/*.vtk", "--output-dir", out, "--reference"]
    reference = tmp_path / "reference.vtk"
    said = error_line(*command, reference, code=1)
    assert said == f"meshfix: error: {reference}: No such file or directory"
    told = results(run(*command, SAMPLES / "bracket.vtk", code=4))
    assert all("bracket.vtk: as a reference: " in one["error"] for one in told.values())
    shutil.copy(VALID, reference)
    assert {one["status"] for one in results(run(*command, reference)).values()} == {"valid"}
    run("untangle", "-q", "--reference", reference, inputs / "a.vtk", tmp_path / "alone.vtk")
    assert (out / "a.vtk").read_bytes() == (out / "b.vtk").read_bytes() == (tmp_path / "alone.vtk").read_bytes()
    assert {one["status"] for one in results(run(*command, reference)).values()} == {"skipped"}
    later = (out / "a.vtk").stat().st_mtime_ns + 1_000_000_000
    os.utime(reference, ns=(later, later))
    assert {one["status"] for one in results(run(*command, reference)).values()} == {"valid"}
    shutil.copy(VALID, out / "b.vtk")
    assert "b.vtk would replace the input " in error_line(*command, out / "b.vtk", code=2)
    said = error_line(*command, reference, "--only-invalid", code=2)
    assert said == "Error: --reference and --only-invalid exclude each other"


def test_each_mesh_moves_by_its_own_vectors(inputs: Path, out: Path, tmp_path: Path) -> None:
    mesh = meshio.read(VALID)
    for i in range(2):
        mesh.point_data["motion"] = np.column_stack([0.1 * (i + 1) * mesh.points[:, :2], np.zeros(len(mesh.points))])
        meshio.write(inputs / f"{i}.vtk", mesh, file_format="vtk42")
    run("batch", "-q", "--displace", "motion", f"{inputs}/*.vtk", "--output-dir", out)
    for i in range(2):
        run("untangle", "-q", "--displace", "motion", inputs / f"{i}.vtk", tmp_path / "alone.vtk")
        assert (out / f"{i}.vtk").read_bytes() == (tmp_path / "alone.vtk").read_bytes()
        width = np.ptp(meshio.read(out / f"{i}.vtk").points[:, 0])
        assert width == pytest.approx((1.1 + 0.1 * i) * np.ptp(mesh.points[:, 0]))
