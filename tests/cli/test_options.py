"""What options ask for together, what their help tells, and what programs read of the report."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import meshio
import pytest
from click.testing import CliRunner
from commands import MESHFIX, TANGLED, VALID, error_line, run
from places import SAMPLES

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
    told = set(re.findall(r"\w+", text.partition("--require CONDITION")[2].partition("--metric [")[0]))
    assert set(NUMBERS) <= told
    assert set(METRICS) <= set(re.findall(r"\w+", text))


def test_no_summary_of_a_command_is_cut_short() -> None:
    commands = CliRunner().invoke(main, ["--help"]).output.partition("Commands:\n")[2].partition("\n\n")[0]
    listed = commands.splitlines()
    assert len(listed) == len(main.commands)  # one line each
    assert all(line.endswith(".") and not line.endswith("...") for line in listed)


def test_a_reference_gives_elements_their_shapes_back(tmp_path: Path) -> None:
    """In any format that is read; the report tells by how much, and nobody else's does."""
    converted, out = tmp_path / "before.vtu", tmp_path / "o.vtk"
    meshio.read(VALID).write(converted)
    facts = json.loads(run("untangle", "--json", "--reference", converted, TANGLED, out).stdout)
    ratios = {stage: summary["to_reference"] for stage, summary in facts["quality"].items()}
    assert ratios["before"]["smallest"] == 0.0
    assert ratios["smoothed"] == {"smallest": pytest.approx(1.0), "mean": pytest.approx(1.0)}
    assert facts["sweeps"][1]["phase"] == "following the boundary"
    table = run("untangle", "--reference", VALID, TANGLED, out).stdout.decode()
    row = next(line for line in table.splitlines() if "mean ratio to the reference" in line)
    assert re.findall(r"[\d.]+ / [\d.]+", row) == ["0.000 / 0.545", "1.000 / 1.000", "1.000 / 1.000"]
    assert meshio.read(out).points == pytest.approx(meshio.read(VALID).points, abs=1e-12)
    assert "to_reference" not in run("untangle", "--json", TANGLED, out).stdout.decode()
    again = run("untangle", "--reference", VALID, VALID, out).stdout.decode()
    assert "note: no element is inverted: nothing was moved" in again


def test_what_is_no_reference_is_refused_in_one_line(tmp_path: Path) -> None:
    out, bracket = tmp_path / "o.vtk", str(SAMPLES / "bracket.vtk")
    said = error_line("untangle", "--reference", bracket, TANGLED, out, code=1)
    assert said.endswith(
        "as a reference: it has 1,863 points and 7,968 tetrahedra, and the mesh 207 points and 332 triangles"
    )
    assert error_line("untangle", "--reference", TANGLED, TANGLED, out, code=1).endswith(
        "89 triangles of it are inverted"
    )
    assert error_line("untangle", "--reference", tmp_path / "no.vtk", TANGLED, out, code=1).endswith(
        "No such file or directory"
    )
    for more in (["--only-invalid"], ["--threshold", "20"]):
        said = error_line("untangle", "--reference", VALID, *more, TANGLED, out, code=2)
        assert said == f"Error: --reference and {more[0]} exclude each other"
    assert (
        error_line("untangle", "--reference", "-", TANGLED, out, code=2)
        == "Error: --reference is a file: stdin is INPUT's"
    )
    assert not out.exists()


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


@pytest.mark.parametrize(
    "words", [("untangle",), ("perturb", "--percent", "5", "--dist", "h", "--seed", "1"), ("quality", "--all")]
)
def test_the_report_is_written_as_json_as_it_is_printed(words: tuple[str, ...], tmp_path: Path) -> None:
    """Also where nothing is printed, and with all that is asked for."""
    written, printed = tmp_path / "r.json", tmp_path / "p.json"
    out = [] if words[0] == "quality" else [tmp_path / "o.vtk"]
    code = 3 if words[0] == "quality" else 0
    run(*words, "--quiet", "--report-json", written, TANGLED, *out, code=code)
    printed.write_bytes(run(*words, "--json", TANGLED, *out, code=code).stdout)
    told, expected = (json.loads(path.read_text()) for path in (written, printed))
    for facts in (told, expected):
        for record in facts["sweeps"]:
            del record["seconds"]
    assert told == expected
    assert len(told["first_inverted"]) == (89 if words[0] == "quality" else min(10, told["inverted"]))
    link = tmp_path / "link.json"
    link.symlink_to(TANGLED)
    assert "is the name of a mesh" in error_line(*words, "--report-json", link, TANGLED, *out, code=2)
