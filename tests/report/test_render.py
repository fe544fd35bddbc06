"""What pyvista draws of a result, where it can."""

from __future__ import annotations

import sys
from base64 import b64decode

import numpy as np
import pytest
from places import SAMPLES

from meshfix_cli import perturb, untangle
from meshfix_cli.report import render

pyvista = pytest.importorskip("pyvista")


@pytest.mark.parametrize(("name", "quality"), [
    ("bracket_tangled.vtk", "min_angle"), ("mixed_tangled.msh", "scaled_jacobian"), ("plate_tangled.vtk", "min_angle"),
    ("shell_tangled.obj", "min_angle"),
])  # fmt: skip
def test_the_mesh_before_and_after_is_drawn_by_quality(name: str, quality: str) -> None:
    result = untangle(SAMPLES / name)
    plot = result.plot(off_screen=True)
    meshes = [actor.mapper.dataset for part in plot.renderers for actor in part.actors.values()
              if hasattr(actor, "mapper") and hasattr(actor.mapper, "dataset")]  # fmt: skip
    assert [quality in mesh.array_names for mesh in meshes] == [True] * 3  # the rest, what is inverted; and after
    before = next(iter(result.report.stages.values()))
    assert [int(mesh["inverted"].sum()) for mesh in meshes] == [0, before.inverted, 0]
    solid = result.after.points.shape[1] == 3 and result.after.dimension == 3
    assert (meshes[2].n_cells < result.summary.elements) == solid  # cut open
    if not solid:
        np.testing.assert_allclose(meshes[2][quality], meshes[2].cell_quality(quality)[quality], atol=1e-6)
    plot.close()


def test_a_notebook_shows_a_picture_to_those_who_use_pyvista(monkeypatch: pytest.MonkeyPatch) -> None:
    result = perturb(SAMPLES / "plate.vtk", 25, "2h")
    picture = render.png(result.report)
    if picture is None:
        pytest.skip("VTK before 9.4 draws only where there is a display")
    assert picture.startswith(b"\x89PNG")
    html = result._repr_html_()
    assert b64decode(html.partition("base64,")[2].partition('"')[0]).startswith(b"\x89PNG")
    assert html.startswith("<pre") and html.endswith('">')
    monkeypatch.delitem(sys.modules, "pyvista")
    assert "<img" not in result._repr_html_()


def test_without_pyvista_there_is_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    result = untangle(SAMPLES / "plate_tangled.vtk")
    with pytest.raises(ImportError, match="a picture needs pyvista: pip install pyvista"):
        result.plot()
    assert "<img" not in result._repr_html_()


def test_without_a_picture_the_table_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    result = untangle(SAMPLES / "plate_tangled.vtk")

    def fails(*_: object, **__: object) -> None:
        raise RuntimeError("no driver")

    with monkeypatch.context() as patch:
        patch.setattr(render, "MOST_DRAWN", 10)
        assert render.png(result.report) is None
    monkeypatch.setattr(render, "plotter", fails)
    html = result._repr_html_()
    assert "valid: no element is inverted" in html and "<img" not in html
