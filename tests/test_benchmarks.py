"""The benchmarks run, and the samples are what their script makes."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import generate
import kernels
import pytest
import tables
from conftest import SAMPLES

from meshfix_cli.untangle import Move


def test_tables_of_a_tetrahedral_and_of_a_triangular_mesh(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, words in (
        ("bracket.vtk", ("Table 4.2", "Table 4.3")),
        ("plate.vtk", ("Table 4.1", "LS untangles 7 of 7")),
    ):
        monkeypatch.setattr(sys, "argv", ["tables.py", str(SAMPLES / name), "--output", str(tmp_path)])
        tables.main()
        printed = capsys.readouterr().out
        assert all(word in printed for word in words)
    rows = list(csv.DictReader((tmp_path / "figure_4_4_LUS.csv").read_text().splitlines()))
    assert int(rows[0]["inverted"]) > 0
    assert int(rows[-1]["inverted"]) == 0


def test_kernels_are_timed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["kernels.py", str(SAMPLES / "bracket.vtk"), "--repeats", "1"])
    kernels.main()
    printed = capsys.readouterr().out
    assert all(move.name.lower() in printed for move in Move)


def test_samples_are_what_the_script_makes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(generate, "__file__", str(tmp_path / "generate.py"))
    generate.main()
    made = sorted(p.name for p in tmp_path.iterdir())
    assert made == sorted(p.name for p in SAMPLES.iterdir() if p.suffix in (".vtk", ".msh", ".obj"))
    assert all(b"by generate.py" in (SAMPLES / name).read_bytes() for name in made)
    total = sum((SAMPLES / name).stat().st_size for name in made)
    assert total < 3e6
