"""The check of sharp edges and volumes sees what changes them, and nothing where they are kept."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import features
import numpy as np
import pytest
from features import change, sides_of
from small_surfaces import SMALL
from surface_measures import volume
from surface_programs import write_off

from meshfix_cli import untangle
from meshfix_cli.mesh.mesh import Mesh


def built(name: str) -> Mesh:
    """A small body as a mesh."""
    body = SMALL[name]()
    return Mesh.build(body.points, body.cells)


@pytest.mark.parametrize("name", SMALL)
def test_sharp_edges_are_those_of_the_body(name: str) -> None:
    body = SMALL[name]()
    sides = sides_of(built(name))
    assert {tuple(one) for one in sides.sharper(features.FEATURE_ANGLE)[:, :2].tolist()} == {
        tuple(one) for one in np.sort(body.rims, axis=1).tolist()
    }
    assert sides.closed == (name != "bumps")
    if sides.closed:
        assert sides.volume == pytest.approx(volume(body.points, body.cells))


@pytest.mark.parametrize("name", SMALL)
def test_nothing_is_rounded_off_and_volumes_are_kept(name: str) -> None:
    mesh = built(name)
    found = change(mesh, untangle(mesh, smooth="best").after)
    assert found.new == pytest.approx(0, abs=1e-9)
    assert found.rounded == pytest.approx(0, abs=1e-9)


def test_what_is_rounded_off_is_seen() -> None:
    mesh = built("part")
    h, sharp = mesh.mean_edge_length(), sides_of(mesh).sharper(features.FEATURE_ANGLE)
    vertex = sharp[len(sharp) // 2, 0]
    points = mesh.points.copy()
    points[vertex] -= 0.3 * h * points[vertex] / np.linalg.norm(points[vertex])
    found = change(mesh, replace(mesh, points=points))
    assert found.is_large
    assert 0.1 < max(found.new, found.rounded) <= 0.31
    assert found.volume != 0


def test_the_script_tells_of_surfaces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    body = SMALL["part"]()
    write_off(tmp_path / "part.off", body.points, body.cells)
    monkeypatch.setattr(sys, "argv", ["features.py", str(tmp_path / "part.off")])
    features.main()
    printed = capsys.readouterr().out
    assert "part.off" in printed
    assert "CHANGED" not in printed
