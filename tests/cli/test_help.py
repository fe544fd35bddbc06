"""The help: options under headings, and examples that run."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from commands import TANGLED, VALID
from places import BINARIES

from meshfix_cli.cli import main
from meshfix_cli.cli.help import HEADINGS, Command, WithExamples, heading_of

COMMANDS: dict[str, click.Command] = {"": main, **main.commands}


def examples(command: click.Command) -> list[str]:
    assert isinstance(command, WithExamples)
    return [line for _, line in command.examples]


def help_of(name: str) -> str:
    return CliRunner().invoke(main, [*name.split(), "--help"]).output


@pytest.mark.parametrize("name", main.commands)
def test_each_option_stands_once_under_its_heading(name: str) -> None:
    command = main.commands[name]
    assert isinstance(command, Command)
    sections = re.split(r"^(\S.*):\n", help_of(name).partition("\n\n")[2], flags=re.MULTILINE)[1:]
    told = dict(zip(sections[::2], sections[1::2], strict=True))
    assert list(told) == [heading for heading in HEADINGS if heading in told] + ["Examples"]
    for option in command.params:
        if isinstance(option, click.Option):
            named = re.compile(rf"^  (-\w, )?{re.escape(option.opts[0])}(?![\w-])", re.MULTILINE)
            assert [heading for heading, text in told.items() if named.search(text)] == [heading_of(option)]
    assert told[HEADINGS[-1]].rstrip().endswith("Show this message and exit.")


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_ends_with_examples(name: str) -> None:
    shown = help_of(name).partition("\nExamples:\n")[2]
    assert re.findall(r"^    \$ (.*)$", shown, re.MULTILINE) == examples(COMMANDS[name])
    assert all(f"meshfix {name}" in line for line in examples(COMMANDS[name]) if name)
    assert all(len(line) <= 80 for line in shown.splitlines())


@pytest.mark.skipif(not shutil.which("bash"), reason="there is no bash")
@pytest.mark.parametrize("name", COMMANDS)
def test_examples_run(name: str, tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    for place in ("mesh.vtk", "meshes/mesh.vtk"):
        shutil.copy(VALID, tmp_path / place)
    shutil.copy(TANGLED, tmp_path / "tangled.vtk")
    for line in examples(COMMANDS[name]):
        done = subprocess.run(
            ["bash", "-o", "pipefail", "-c", line], capture_output=True, check=False, cwd=tmp_path,
            env={**os.environ, "PATH": BINARIES}, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        expected = 3 if name in ("", "quality") and "tangled.vtk" in line and "untangle" not in line else 0
        assert (done.returncode, b"Error" in done.stderr) == (expected, False), line
