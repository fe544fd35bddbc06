"""Plots for papers: files that are what they are named, the same each time, and refused before any work."""

from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from places import SAMPLES
from reports import built, report_on

from meshfix_cli.cli import main
from meshfix_cli.report.figures import figures
from meshfix_cli.report.plot import plot

TANGLED = str(SAMPLES / "plate_tangled.vtk")
START = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [*map(str, arguments)])


@pytest.mark.parametrize("suffix", START)
def test_formats_and_the_same_bytes_each_time(suffix: str, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    for name in ("a", "b"):
        done = run("untangle", "-q", "--plot", tmp_path / f"{name}{suffix}", TANGLED, tmp_path / "out.vtk")
        assert (done.exit_code, done.output) == (0, "")
    first, second = ((tmp_path / f"{name}{suffix}").read_bytes() for name in ("a", "b"))
    assert first.startswith(START[suffix])
    assert first == second


def red(path: Path) -> list[int]:
    """Pixels in the colour of inverted elements, by thirds of the upper half of a picture."""
    image = pytest.importorskip("matplotlib.image").imread(path)
    strip = image[: len(image) // 3, ..., :3]
    return [int((third[..., 0] > third[..., 1:].max(axis=-1) + 0.25).sum()) for third in np.array_split(strip, 3, 1)]


def test_the_picture_before_is_red_and_those_after_are_not(tmp_path: Path) -> None:
    run("untangle", "-q", "--smooth", 0, "--plot", tmp_path / "p.png", TANGLED, tmp_path / "out.vtk")
    before, untangled, _ = red(tmp_path / "p.png")
    assert before > 20_000
    assert untangled < before / 10


@pytest.mark.parametrize("command", ["quality", "perturb"])
@pytest.mark.parametrize("sample", ["plate.vtk", "bracket_tangled.vtk"])
def test_other_commands_and_solids(command: str, sample: str, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    more = [tmp_path / "o.vtk", "--percent", 5, "--dist", "h"] if command == "perturb" else []
    done = run(command, "-q", "--plot", tmp_path / "p.svg", SAMPLES / sample, *more)
    assert done.exit_code == (3 if command == "quality" and "tangled" in sample else 0)
    assert b"</svg>" in (tmp_path / "p.svg").read_bytes()


@pytest.mark.parametrize("name", ["quad plate", "quads and triangles", "hexes beside tets"])
def test_elements_of_every_type(name: str, tmp_path: Path) -> None:
    """Each element of a plane mesh is a polygon of its corners, which ends where it begins."""
    pytest.importorskip("matplotlib")
    report = report_on(built(name))
    plot(report, figures(report), tmp_path / "p.svg")
    text = (tmp_path / "p.svg").read_text()
    assert "scaled Jacobian" in text
    outlines = re.findall(r' d="([^"]*)" clip-path="[^"]*" style="fill: none', text)
    corners = Counter(one.count("L") for one in outlines if one.rstrip().endswith("z"))
    blocks = report.mesh.topology.blocks if report.mesh.dimension == 2 else ()
    assert corners == {block.element.nodes: len(block.rows) for block in blocks}


def test_what_is_missing_is_named_before_any_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for command in (["untangle", TANGLED, tmp_path / "out.vtk"], ["quality", TANGLED]):
        done = run(command[0], "--plot", tmp_path / "p.png", *command[1:])
        assert (done.exit_code, list(tmp_path.iterdir())) == (1, [])
        assert "plots need matplotlib: pip install matplotlib" in done.output
        assert done.output.count("\n") == 1


def test_settings_of_the_user_change_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = []
    for name, settings in (("a", ""), ("b", "figure.facecolor: black\naxes.grid: True\nsavefig.bbox: tight\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "matplotlibrc").write_text(settings)
        monkeypatch.setenv("MATPLOTLIBRC", str(tmp_path / name / "matplotlibrc"))
        command = [
            sys.executable,
            "-m",
            "meshfix_cli",
            "quality",
            "-q",
            "--plot",
            str(tmp_path / f"{name}.svg"),
            TANGLED,
        ]
        subprocess.run(command, check=False)
        files.append((tmp_path / f"{name}.svg").read_bytes())
    assert files[0] == files[1]
    monkeypatch.setenv("MPLBACKEND", "nonsense")
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "matplotlib does not start" in done.stderr
