"""What options ask for together, what their help tells, and what programs read of the report."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest
from click.testing import CliRunner
from commands import MESHFIX, TANGLED, VALID, error_line, run

from meshfix_cli.cli import main
from meshfix_cli.quality.metrics import METRICS, NUMBERS


@pytest.mark.parametrize(
    "arguments",
    [
        ["untangle", VALID, "o.vtk"],
        ["perturb", "--percent", "1", "--dist", "h", VALID, "o.vtk"],
        ["quality", VALID],
        ["batch", VALID, "--output-dir", "out"],
    ],
)
def test_quiet_and_json_exclude_each_other(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A program that asks for JSON would get nothing, and not know why."""
    monkeypatch.chdir(tmp_path)
    assert error_line(*arguments, "-q", "--json", code=2) == "Error: --quiet and --json exclude each other"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", ["untangle", "quality", "batch"])
def test_the_help_names_what_a_condition_can_compare(command: str) -> None:
    text = CliRunner().invoke(main, [command, "--help"]).output
    told = set(re.findall(r"\w+", text.partition("--require CONDITION")[2].partition("--fix NAME")[0]))
    assert set(NUMBERS) <= told
    assert set(METRICS) <= set(re.findall(r"\w+", text))


def test_no_summary_of_a_command_is_cut_short() -> None:
    listed = CliRunner().invoke(main, ["--help"]).output.partition("Commands:\n")[2].splitlines()
    assert len(listed) == len(main.commands)  # one line each
    assert all(line.endswith(".") and not line.endswith("...") for line in listed)


def test_the_numbers_of_the_result_are_at_the_top_of_the_json() -> None:
    facts = json.loads(run("quality", "--json", TANGLED, code=3).stdout)
    assert facts["inverted"] == 89
    assert facts["elements"] == 332
    assert all(facts[name] == facts["quality"]["mesh"][name] for name in NUMBERS if name != "elements")
    facts = json.loads(run("untangle", "--json", "--dry-run", TANGLED).stdout)
    assert facts["inverted"] == 0
    assert facts["min_angle"] == facts["quality"]["smoothed"]["min_angle"] > 25
    assert facts["schema"] == 1


def test_without_arguments_the_help_is_shown() -> None:
    done = subprocess.run([MESHFIX], capture_output=True, check=False)
    assert "\nCommands:\n  batch " in (done.stdout + done.stderr).decode()
