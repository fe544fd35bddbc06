"""Runs that are interrupted: they say how far they were, and keep the best mesh where that is asked for."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bent import curved, mesh_of, straight
from commands import MESHFIX, POSIX, SLOW_DISK, TANGLED, error_line, run, start
from places import SAMPLES

from meshfix_cli import Mesh, read
from meshfix_cli.cli.course import JUDGING, READING, SOLVING, WRITING, Course
from meshfix_cli.repair import Method
from meshfix_cli.solve.records import SweepRecord

# The command, which waits after so many steps: until a signal is to let it go on, or for a minute.
WAITS = """
import sys, time
import meshfix_cli.solve.untangle as solve
from meshfix_cli.cli.process import courses
def steps(*arguments, **options):
    for i, step in enumerate(really(*arguments, **options)):
        yield step
        if i == count:
            print("writing", flush=True)
            end = time.monotonic() + 60
            while time.monotonic() < end and not (goes_on and courses[-1].asked):
                time.sleep(0.01)
really, solve.steps = solve.steps, steps
count, goes_on = int(sys.argv[1]), sys.argv[2] == "goes on"
from meshfix_cli.cli import main
main(sys.argv[3:])
"""
KEPT = "meshfix: the best mesh so far is kept once this sweep is done; a second signal ends it without that"
US = ("untangle", "--json", "--strategy", "US")  # four sweeps, which leave 46, 17, 1 and 0 of 89 inverted


def told(child: subprocess.Popen[bytes]) -> list[str]:
    """What it says on stderr until it ends."""
    return child.communicate(timeout=60)[1].decode().splitlines()


@POSIX
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize(
    ("steps", "where"),
    [
        (0, "before the first sweep, 89 of 332 elements inverted"),
        (2, "in LP, sweep 2, 17 of 332 elements inverted"),
        (5, "in smoothing, sweep 1, 0 of 332 elements inverted"),
    ],
)
def test_an_interrupted_run_says_how_far_it_was_and_writes_nothing(
    steps: int, where: str, name: str, tmp_path: Path
) -> None:
    (tmp_path / "out.vtk").write_text("precious")
    beside = ["--history", tmp_path / "h.csv", "--report-json", tmp_path / "r.json"]
    with start(WAITS, steps, "", *US, "--verbose", *beside, TANGLED, tmp_path / "out.vtk") as child:
        child.send_signal(getattr(signal, name))
        lines = told(child)
    assert lines[-1] == f"meshfix: interrupted {where}; nothing was written"
    assert child.returncode == 128 + getattr(signal, name)
    assert [path.name for path in tmp_path.iterdir()] == ["out.vtk"]
    assert (tmp_path / "out.vtk").read_text() == "precious"


@POSIX
@pytest.mark.parametrize("keep", [[], ["--keep-best"]])
def test_interrupted_while_reading(keep: list[str], tmp_path: Path) -> None:
    fifo = tmp_path / "in.vtk"
    os.mkfifo(fifo)
    command = [MESHFIX, "untangle", *keep, str(fifo), str(tmp_path / "out.vtk")]
    with subprocess.Popen(command, stderr=subprocess.PIPE) as child, fifo.open("wb"):  # opened once it is being read
        child.send_signal(signal.SIGINT)
        assert told(child) == ["meshfix: interrupted while reading; nothing was written"]
    assert child.returncode == 130
    assert list(tmp_path.iterdir()) == [fifo]


@POSIX
def test_interrupted_while_writing(tmp_path: Path) -> None:
    (tmp_path / "out.vtk").write_text("precious")
    with start(SLOW_DISK, "untangle", "-q", TANGLED, tmp_path / "out.vtk") as child:
        child.send_signal(signal.SIGINT)
        said = told(child)
    assert said == ["meshfix: interrupted while writing; OUTPUT is what it was, or all of the new mesh"]
    assert (child.returncode, (tmp_path / "out.vtk").read_text()) == (130, "precious")
    assert [path.name for path in tmp_path.iterdir()] == ["out.vtk"]


@POSIX
def test_interrupted_while_writing_to_a_pipe(tmp_path: Path) -> None:
    """Whoever reads it has a part of the mesh, and is told that it may be no more."""
    fifo = tmp_path / "out.vtk"
    os.mkfifo(fifo)
    command = [MESHFIX, "untangle", "-q", str(SAMPLES / "bracket_tangled.vtk"), str(fifo)]  # more than a pipe holds
    with subprocess.Popen(command, stderr=subprocess.PIPE) as child, fifo.open("rb", buffering=0) as reader:
        assert reader.read(1) == b"#"
        child.send_signal(signal.SIGINT)
        said = told(child)
    assert said == ["meshfix: interrupted while writing; OUTPUT may have the beginning of the new mesh"]
    assert child.returncode == 130


NONE = "nothing was written"


@pytest.mark.parametrize(
    ("doing", "options", "ended", "follows"),
    [
        (READING, {}, f"while reading; {NONE}", ""),
        (READING, {"streamed": True, "dry_run": True}, f"while reading; {NONE}", ""),
        (SOLVING, {"streamed": True}, f"before the first sweep; {NONE}", "the best mesh so far is kept once this"),
        (WRITING, {}, "while writing; OUTPUT is what it was, or all of the new mesh", "OUTPUT is completed"),
        (WRITING, {"streamed": True}, "while writing; OUTPUT may have the beginning", "OUTPUT is completed"),
        (WRITING, {"streamed": True, "dry_run": True}, f"once solved; {NONE}", "the report is completed"),
        (JUDGING, {}, "once OUTPUT was written, before the report", "the report is completed"),
        (JUDGING, {"streamed": True}, "once OUTPUT was written, before the report", "the report is completed"),
        (JUDGING, {"dry_run": True}, "once solved, before the report", "the report is completed"),  # a --history may be
    ],
)
def test_what_is_told_of_files_is_so(doing: str, options: dict[str, bool], ended: str, follows: str) -> None:
    course = Course(keep_best=True, **{"dry_run": False, **options})
    course.begin(doing)
    assert course.ended().startswith(f"interrupted {ended}")
    first = course.hears()
    assert first.startswith(follows) and bool(first) == bool(follows)
    assert course.hears() == ""


@POSIX
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize(("steps", "inverted", "code"), [(0, 46, 3), (1, 17, 3), (3, 0, 0), (6, 0, 0)])
def test_the_best_mesh_so_far_is_kept(name: str, steps: int, inverted: int, code: int, tmp_path: Path) -> None:
    """The sweep that was under way is the last."""
    out, history = tmp_path / "out.vtk", tmp_path / "h.csv"
    with start(WAITS, steps, "goes on", *US, "--keep-best", "--history", history, TANGLED, out) as child:
        child.send_signal(getattr(signal, name))
        printed, complaint = child.communicate(timeout=60)
    assert (child.returncode, complaint.decode()) == (code, f"{KEPT}\n")
    assert read(out).mesh.check()[0] == inverted
    facts = json.loads(printed)
    assert facts["inverted"] == inverted
    assert len(facts["sweeps"]) in (steps + 2, steps + 3)  # the best of them may be another than the last
    last = facts["sweeps"][steps + 1]
    assert facts["interrupted"] == {name: last[name] for name in ("phase", "sweep", "inverted")}
    (note,) = (one for one in facts["notes"] if "interrupted" in one)
    assert note.endswith(f"{inverted} of 332 elements inverted: the best mesh so far was taken")
    assert len(history.read_text().splitlines()) == len(facts["sweeps"]) + 1


@POSIX
def test_what_is_being_written_is_completed(tmp_path: Path) -> None:
    """The disk is asked again and again whether a signal has come."""
    slow = SLOW_DISK.replace("time.sleep(60)", "while not courses[-1].asked: time.sleep(0.01)")
    slow = f"from meshfix_cli.cli.process import courses{slow}"
    with start(slow, "untangle", "-q", "--keep-best", TANGLED, tmp_path / "out.vtk") as child:
        child.send_signal(signal.SIGINT)
        assert told(child) == ["meshfix: OUTPUT is completed; a second signal ends it without that"]
    assert child.returncode == 0
    assert read(tmp_path / "out.vtk").mesh.check()[0] == 0


@pytest.mark.parametrize(
    ("doing", "dry_run", "what"),
    [(WRITING, False, "OUTPUT"), (JUDGING, False, "the report"), (WRITING, True, "the report")],
)
def test_what_is_said_to_be_completed_is_what_is_not_there_yet(doing: str, dry_run: bool, what: str) -> None:
    course = Course(keep_best=True, dry_run=dry_run)
    course.begin(doing)
    assert course.hears() == f"{what} is completed; a second signal ends it without that"
    assert course.hears() == ""


@POSIX
def test_a_second_signal_ends_a_run_that_would_keep_its_best(tmp_path: Path) -> None:
    with start(WAITS, 2, "", *US, "--keep-best", TANGLED, tmp_path / "out.vtk") as child:
        assert child.stderr is not None
        child.send_signal(signal.SIGINT)
        assert child.stderr.readline().decode() == f"{KEPT}\n"
        child.send_signal(signal.SIGINT)
        ended = "meshfix: interrupted in LP, sweep 2, 17 of 332 elements inverted; nothing was written"
        assert told(child) == [ended]
    assert child.returncode == 130
    assert not list(tmp_path.iterdir())


@POSIX
@pytest.mark.parametrize("sample", ["hexes_tangled.inp", "shell_tangled.obj", "two_materials.msh"])
def test_meshes_of_every_kind_are_kept(sample: str, tmp_path: Path) -> None:
    """A surface goes on until its vertices are on it again; where vertices may slide, it is not tried with less."""
    before, out = read(SAMPLES / sample).mesh.check()[0], tmp_path / sample
    slide = ["--slide", "flat"] if sample.endswith(".msh") else []
    with start(WAITS, 1, "goes on", "untangle", "--json", "--keep-best", *slide, SAMPLES / sample, out) as child:
        child.send_signal(signal.SIGINT)
        printed, _ = child.communicate(timeout=120)
    facts = json.loads(printed)
    assert child.returncode == (0 if facts["valid"] else 3)
    assert facts["inverted"] <= before
    assert facts["interrupted"]["phase"]


def followed(course: Course, run: list[tuple[Mesh, SweepRecord]], signal_after: int) -> list[tuple[Mesh, SweepRecord]]:
    """The steps that come of a run, with a signal once so many have been passed through."""

    def steps() -> Iterator[tuple[Mesh, SweepRecord]]:
        for i, step in enumerate(run):
            yield step
            if i == signal_after:
                assert course.hears()

    course.begin(SOLVING, 332)
    return list(course.follow(steps()))


def test_what_is_kept_is_never_worse_than_the_input() -> None:
    """Whatever records say, and of valid meshes it is the one with the larger smallest angle."""
    mesh = read(TANGLED).mesh
    run = list(Method().steps(mesh, np.inf, 1))
    (good, valid), (smooth, last) = run[1], run[-1]
    assert (valid.inverted, last.inverted) == (0, 0)
    worse = mesh.with_points(mesh.points[::-1].copy())
    lies = replace(valid, inverted=0, min_measure=1.0)
    cases = (
        ([run[0], (worse, lies), (worse, lies)], mesh),
        ([run[0], (good, valid), (worse, replace(valid, inverted=300))], good),
        ([run[0], (good, replace(valid, min_measure=9.0)), (smooth, last)], smooth),
    )
    for steps, best in cases:
        kept = followed(Course(keep_best=True, dry_run=False), [*steps, steps[-1]], len(steps) - 1)
        assert kept[-1][0].points.tobytes() == best.points.tobytes()
        assert kept[-1][1].inverted == best.check()[0]


@pytest.mark.parametrize("key", ["triangle6", "tetra10"])
def test_curved_meshes_are_kept_wherever_they_are_interrupted(key: str) -> None:
    """Also where straight elements are untangled first, whose records do not tell of curved ones."""
    quadratic, points, free = curved(key, 0.8)
    corners = free & quadratic.corners
    points = points + 0.5 * np.random.default_rng(1).uniform(-1, 1, points.shape) * corners[:, None]
    mesh = mesh_of(quadratic, points, key, straight(key)[1], free)
    run = list(Method()._curved_steps(mesh, np.inf, 1))
    assert run[0][1].inverted == mesh.check()[0] > 0
    for after in range(len(run)):
        kept = followed(Course(keep_best=True, dry_run=False), run, after)[-1]
        assert kept[0].check()[0] <= min(mesh.check()[0], run[min(after + 1, len(run) - 1)][0].check()[0])


def test_keeping_the_best_and_many_processes_exclude_each_other(tmp_path: Path) -> None:
    said = error_line("untangle", "--mpi", "--keep-best", TANGLED, tmp_path / "o.vtk", code=2)
    assert said == "Error: --mpi and --keep-best exclude each other"


def test_a_run_that_nobody_interrupts_is_the_same(tmp_path: Path) -> None:
    facts = json.loads(run("untangle", "--json", "--keep-best", TANGLED, tmp_path / "a.vtk").stdout)
    run("untangle", "-q", TANGLED, tmp_path / "b.vtk")
    assert "interrupted" not in facts
    assert (tmp_path / "a.vtk").read_bytes() == (tmp_path / "b.vtk").read_bytes()
