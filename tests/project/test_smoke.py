"""What an installed meshfix must do anywhere; it needs pytest alone, and is run on each wheel: `make wheels`."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from places import SAMPLES

import meshfix_cli

TANGLED = sorted(SAMPLES.glob("*_tangled.*"))
COMMAND = Path(sys.executable).with_name("meshfix.exe" if os.name == "nt" else "meshfix")


def run(*arguments: str | Path, given: bytes = b"") -> bytes:
    done = subprocess.run([COMMAND, *arguments], input=given, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout


def test_the_command_is_that_of_the_package() -> None:
    assert run("--version").decode().startswith(f"meshfix {meshfix_cli.__version__} ")


@pytest.mark.parametrize("sample", TANGLED, ids=lambda sample: sample.name)
def test_samples_are_repaired(sample: Path, tmp_path: Path) -> None:
    output = tmp_path / sample.name
    before = json.loads(run("untangle", "--json", sample, output))
    after = json.loads(run("quality", "--json", output))
    assert before["quality"]["before"]["inverted"] > 0
    assert after["valid"]
    assert after["elements"] == before["elements"]


def test_a_tangle_passes_through_streams(tmp_path: Path) -> None:
    tangled = run("perturb", "--percent", "25", "--dist", "2h", given=(SAMPLES / "bracket.vtk").read_bytes())
    page = tmp_path / "page.html"
    repaired = run("untangle", "--quiet", "--report", page, given=tangled)
    assert repaired != tangled
    assert page.read_bytes().startswith(b"<!DOCTYPE html>")
    run("quality", "--quiet", "-", given=repaired)


def test_streams_and_threads_give_the_same_bytes() -> None:
    given = (SAMPLES / "bracket_tangled.vtk").read_bytes()
    results = {run("untangle", "--quiet", "--threads", str(threads), given=given) for threads in (1, 2, 3)}
    assert len(results) == 1
