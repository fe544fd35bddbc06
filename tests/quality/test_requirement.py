"""Metrics that some of the elements do not have: what is judged, and what is said of it."""

from __future__ import annotations

import numpy as np
import pytest
from elements import MESHES
from reports import built, document_of, report_on

from meshfix_cli.errors import RequirementError
from meshfix_cli.quality.formulas import evaluate, evaluate_at, worst_and_mean
from meshfix_cli.quality.metrics import ANGLES, METRICS, NUMBERS, having
from meshfix_cli.quality.requirement import Requirement
from meshfix_cli.quality.summary import summarise
from meshfix_cli.repair.judge import Judge
from meshfix_cli.report.as_json import to_json
from meshfix_cli.report.facts import quality_rows, required

EVERY = ("scaled_jacobian", "shape", "mean_ratio")


SOME = "wedges on tets"  # have angles
NONE = "hex box"


@pytest.mark.parametrize("name", METRICS)
def test_each_block_is_judged_by_itself(name: str) -> None:
    mesh = built(SOME)
    values = evaluate(name, mesh)
    for block in mesh.topology.blocks:
        if block.element.key in METRICS[name].elements:
            expected = evaluate_at(name, block.element, mesh.points[block.vertices])
            np.testing.assert_array_equal(values[block.rows], expected)
        else:
            assert np.isnan(values[block.rows]).all()
    first, (key, tets) = MESHES[SOME]()[1]
    assert key == "tetra"
    defined = values if name in EVERY else values[len(first[1]) :]
    assert len(defined) == (mesh.topology.m if name in EVERY else len(tets))
    worst = defined.max() if METRICS[name].worst == "max" else defined.min()
    assert worst_and_mean(name, mesh) == (worst, defined.mean())
    assert having(name, mesh) == len(defined)


def test_what_some_have_is_required_of_these() -> None:
    mesh = built(SOME)
    tets, worst = len(MESHES[SOME]()[1][1][1]), np.nanmax(evaluate("aspect_ratio", mesh))
    angle = np.nanmin(evaluate("min_angle", mesh))
    asked = ("aspect_ratio", "<=", 1.01 * worst), ("shape", ">", 0.99), ("min_angle", ">=", 0.99 * angle)
    report = report_on(mesh, judge=Judge(requirements=tuple(Requirement(*one) for one in asked)))
    (met, words), (unmet, others), (angles_met, angles) = required(report)
    assert (met, unmet, angles_met) == (True, False, True)
    share = f"{tets:,} of {mesh.topology.m:,} elements"
    assert words.endswith(f" (it is {worst:g}, among {share})")
    assert angles.endswith(f" (it is {angle:g}, among {share})")
    assert "among" not in others
    labels = [label for label, _ in quality_rows(report)]
    assert labels[-2:] == [f"aspect_ratio of {share}, worst / mean", "shape, worst / mean"]
    told = to_json(report)["quality"]["mesh"]["metrics"]
    assert told["aspect_ratio"]["elements"] == tets
    assert "elements" not in told["shape"]


def test_what_none_has_cannot_be_required() -> None:
    document = document_of(built(NONE))
    for name in (*NUMBERS, *METRICS):
        judge = Judge(requirements=(Requirement(name, ">=", 0.0),))
        if name in EVERY or (name in NUMBERS and name not in ANGLES):
            judge.check(document)
            continue
        with pytest.raises(RequirementError, match=f"no element has the {name} required; only triangles, quad") as told:
            judge.check(document)
        assert "\n" not in str(told.value)
        with pytest.raises(RequirementError):
            judge.report("quality", document, {"mesh": document.mesh})


def test_what_none_has_can_be_asked_for() -> None:
    mesh = built(NONE)
    assert all(np.isnan(summarise(mesh, ["radius_ratio"]).metrics["radius_ratio"]))
    report = report_on(mesh, judge=Judge(metrics=("radius_ratio",)))
    assert quality_rows(report)[-1] == ("radius_ratio of 0 of 1,000 elements, worst / mean", ["not defined"])
    told = to_json(report)["quality"]["mesh"]["metrics"]["radius_ratio"]
    assert told == {"worst": None, "mean": None, "elements": 0}
