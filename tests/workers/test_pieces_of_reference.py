"""A reference of a batch that is several files: none of them is replaced, and each tells how old it is."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from commands import VALID

from meshfix_cli.repair import Files, Held, Method, Morph
from meshfix_cli.repair.judge import Judge
from meshfix_cli.workers import batch


def test_no_piece_of_the_reference_is_replaced(tmp_path: Path) -> None:
    """A `.foam` stands for files beside it, and outputs have such as well."""
    for name in ("in", "ref"):
        points = tmp_path / name / "constant" / "polyMesh" / "points"
        points.parent.mkdir(parents=True)
        points.touch()
        (tmp_path / name / f"{name}.foam").touch()
    source, reference = (str(tmp_path / name / f"{name}.foam") for name in ("in", "ref"))
    assert batch.outputs([source], str(tmp_path / "out"), read=[reference]) == [str(tmp_path / "out" / "in.foam")]
    with pytest.raises(ValueError, match=r"points would replace the input .*ref\.foam"):
        batch.outputs([source], str(tmp_path / "ref"), read=[reference])


def test_resume_asks_how_old_the_pieces_of_the_reference_are(tmp_path: Path) -> None:
    points = tmp_path / "constant" / "polyMesh" / "points"
    points.parent.mkdir(parents=True)
    foam, source, target = (tmp_path / name for name in ("case.foam", "in.vtk", "out.vtk"))
    for path in (foam, points):
        path.touch()
    for path in (source, target):
        shutil.copy(VALID, path)
    task = batch.Task(Files(str(source), str(target)), Held(), Morph(str(foam)), Method(), Judge(), resume=True)
    assert batch.work(task)["status"] == "skipped"
    later = target.stat().st_mtime_ns + 1_000_000_000
    os.utime(points, ns=(later, later))
    assert batch.work(task)["status"] == "failed"  # there is no mesh in it, which is seen now
