"""Metrics that some of the elements do not have: what is judged, and what is said of it."""

from __future__ import annotations

import numpy as np
import pytest
from places import SAMPLES

from meshfix_cli import read
from meshfix_cli.errors import RequirementError
from meshfix_cli.mesh.elements import ELEMENTS
from meshfix_cli.mesh.topology import Block, Topology
from meshfix_cli.meshfile.document import Document
from meshfix_cli.quality.formulas import evaluate, evaluate_at, worst_and_mean
from meshfix_cli.quality.metrics import METRICS, having
from meshfix_cli.quality.requirement import Requirement
from meshfix_cli.quality.summary import summarise
from meshfix_cli.repair import Judge
from meshfix_cli.report.as_json import to_json
from meshfix_cli.report.facts import quality_rows, required

EVERY = ("scaled_jacobian", "shape", "mean_ratio")


def with_hexahedra(monkeypatch: pytest.MonkeyPatch, kept: int) -> Document:
    """The bracket, of which all but the first tetrahedra pass for hexahedra that have two of these as their faces."""
    document = read(SAMPLES / "bracket.vtk")
    topology = document.mesh.topology
    rows, tets = np.arange(topology.m, dtype=np.int32), topology.simplices
    hexahedra = np.concatenate([tets, np.roll(tets, 1, axis=0)], axis=1)
    blocks = (
        Block(ELEMENTS["tetra"], rows[:kept], tets[:kept]),
        Block(ELEMENTS["hexahedron"], rows[kept:], hexahedra[kept:]),
    )
    monkeypatch.setattr(Topology, "blocks", blocks)
    return document


@pytest.mark.parametrize("name", METRICS)
def test_each_block_is_judged_by_itself(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    mesh = with_hexahedra(monkeypatch, 100).mesh
    values = evaluate(name, mesh)
    for block in mesh.topology.blocks:
        if block.element.key in METRICS[name].elements:
            expected = evaluate_at(name, block.element, mesh.points[block.vertices])
            np.testing.assert_array_equal(values[block.rows], expected)
        else:
            assert np.isnan(values[block.rows]).all()
    defined = values if name in EVERY else values[:100]
    worst = defined.max() if METRICS[name].worst == "max" else defined.min()
    assert worst_and_mean(name, mesh) == (worst, defined.mean())
    assert having(name, mesh) == len(defined)


def test_what_some_have_is_required_of_these(monkeypatch: pytest.MonkeyPatch) -> None:
    document = with_hexahedra(monkeypatch, 100)
    worst = evaluate("aspect_ratio", document.mesh)[:100].max()
    judge = Judge(requirements=(Requirement("aspect_ratio", "<=", 1.01 * worst), Requirement("shape", ">", 0.99)))
    report = judge.report("quality", document, {"mesh": document.mesh})
    (met, words), (unmet, others) = required(report)
    assert (met, unmet) == (True, False)
    assert words.endswith(f" (it is {worst:g}, among 100 of {document.mesh.topology.m:,} elements)")
    assert "among" not in others
    labels = [label for label, _ in quality_rows(report)]
    assert labels[-2:] == ["aspect_ratio of 100 of 7,968 elements, worst / mean", "shape, worst / mean"]
    told = to_json(report)["quality"]["mesh"]["metrics"]
    assert told["aspect_ratio"]["elements"] == 100
    assert "elements" not in told["shape"]


def test_what_none_has_cannot_be_required(monkeypatch: pytest.MonkeyPatch) -> None:
    document = with_hexahedra(monkeypatch, 0)
    for name in METRICS:
        judge = Judge(requirements=(Requirement(name, ">=", 0.0),))
        if name in (*EVERY, "min_angle"):  # the last is a number of the summary
            judge.check(document)
            continue
        with pytest.raises(RequirementError, match=f"no element has the {name} required; only triangles, quad") as told:
            judge.check(document)
        assert "\n" not in str(told.value)
        with pytest.raises(RequirementError):
            judge.report("quality", document, {"mesh": document.mesh})


def test_what_none_has_can_be_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    document = with_hexahedra(monkeypatch, 0)
    assert all(np.isnan(summarise(document.mesh, ["radius_ratio"]).metrics["radius_ratio"]))
    report = Judge(metrics=("radius_ratio",)).report("quality", document, {"mesh": document.mesh})
    assert quality_rows(report)[-1] == ("radius_ratio of 0 of 7,968 elements, worst / mean", ["not defined"])
    told = to_json(report)["quality"]["mesh"]["metrics"]["radius_ratio"]
    assert told == {"worst": None, "mean": None, "elements": 0}
