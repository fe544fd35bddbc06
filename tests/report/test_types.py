"""What is said of meshes that are not of simplices alone."""

from __future__ import annotations

import io
import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from elements import MESHES
from numpy.typing import NDArray
from reports import FIRST, built, document_of, report_on, tangled
from sampling import jacobians
from verdict import vtk_quality

from meshfix_cli.mesh.elements import counted
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.quality.formulas import evaluate
from meshfix_cli.quality.held import highest
from meshfix_cli.report.as_json import to_json
from meshfix_cli.report.facts import Report, centroids, kind_rows, names, quality_rows, title, verdict
from meshfix_cli.report.tally import Tally
from meshfix_cli.report.terminal import console, print_report, print_result, print_tally
from meshfix_cli.solve.untangle import untangle

every = pytest.mark.parametrize("name", MESHES)


def shown(report: Report, **options: Any) -> str:
    out = io.StringIO()
    print_report(report, console(out), **options)
    return out.getvalue()


def by_vtk(mesh: Mesh) -> list[NDArray[np.float64]]:
    """Scaled Jacobians of the elements of each block."""
    return [vtk_quality("scaled_jacobian", one.element, mesh.points[one.vertices]) for one in mesh.topology.blocks]


def cloud() -> Mesh:
    """Hexahedra by themselves, bent so much that some are invalid inside alone, or at corners."""
    random = np.random.default_rng(3)
    cube = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
    nodes = cube + 2.5 * np.arange(300)[:, None, None] * (1, 0, 0) + random.uniform(-0.45, 0.45, (300, 8, 3))
    return Mesh.build(nodes.reshape(-1, 3), [("hexahedron", np.arange(2400).reshape(300, 8))])


@every
def test_no_number_is_missing_or_not_one(name: str) -> None:
    mesh = built(name)
    report = report_on(tangled(name), mesh, command="untangle")
    text = shown(report, by_type=True)
    assert "nan" not in text.split()
    told = json.loads(json.dumps(to_json(report), allow_nan=False))
    has_angles = {block.element.key for block in mesh.topology.blocks} & {"triangle", "quad", "tetra"}
    assert (told["min_angle"] is None) == (told["percentile_1"] is None) == (not has_angles)
    stage = told["quality"]["smoothed"]
    assert stage["histogram"]["of"] == "scaled_jacobian"
    assert stage["histogram"]["bin_width"] * len(stage["histogram"]["counts"]) == pytest.approx(1)
    assert sum(stage["histogram"]["counts"]) == sum(one["count"] for one in stage["types"].values()) == mesh.topology.m


@every
def test_scaled_jacobians_are_verdicts(name: str) -> None:
    mesh = built(name)
    report, parts = report_on(mesh), by_vtk(mesh)
    values = np.concatenate(parts)
    rows = dict(quality_rows(report))
    assert rows["smallest scaled Jacobian"] == [f"{values.min():.3f}"]
    assert rows["mean scaled Jacobian"] == [f"{values.mean():.3f}"]
    assert rows["1st percentile"] == [f"{np.percentile(values, 1):.3f}"]
    told = to_json(report)["quality"]["mesh"]
    assert told["scaled_jacobian"] == pytest.approx(
        {"smallest": values.min(), "mean": values.mean(), "percentile_1": np.percentile(values, 1)}, abs=1e-12
    )
    for block, part in zip(mesh.topology.blocks, parts, strict=True):
        found = told["types"][block.element.key]
        assert (found["count"], found["inverted"], found["inside"]) == (len(part), 0, 0)
        assert found["scaled_jacobian"] == pytest.approx({"smallest": part.min(), "mean": part.mean()}, abs=1e-12)
    types, table = kind_rows(report)
    assert types == [block.element.shape.plural for block in mesh.topology.blocks] * (len(parts) > 1)
    if len(parts) > 1:
        assert dict(table)["smallest scaled Jacobian"] == [f"{part.min():.3f}" for part in parts]
        assert dict(table)["mean scaled Jacobian"] == [f"{part.mean():.3f}" for part in parts]


def test_elements_are_told_by_their_types() -> None:
    shapes = {"tetra": "tetrahedra", "pyramid": "pyramids", "wedge": "wedges", "hexahedron": "hexahedra"}
    numbers = {key: len(rows) for key, rows in MESHES["every solid"]()[1]}
    counts = ", ".join(f"{numbers[key]:,} {plural}" for key, plural in shapes.items())
    mesh = built("every solid")
    vertices = f"{len(mesh.points):,} vertices: {mesh.movable.sum():,} free"
    assert title(report_on(mesh)) == f"mesh: {counts}, {vertices}"
    assert "┃ hexahedra ┃" in shown(report_on(mesh), by_type=True)
    assert "┃ hexahedra ┃" not in shown(report_on(mesh))
    assert shown(report_on(built("hex box")), by_type=True) == shown(report_on(built("hex box")))


@pytest.mark.parametrize(
    ("name", "angle"),
    [("quads and triangles", "angle"), ("hexes beside tets", "dihedral angle of tetrahedra"), ("hex plate", None)],
)
def test_angles_are_told_of_those_that_have_them(name: str, angle: str | None) -> None:
    mesh = built(name)
    rows = dict(quality_rows(report_on(mesh)))
    if angle is None:
        assert not [label for label in rows if "°" in label]
        return
    assert rows[f"smallest {angle} [°]"] == [f"{np.nanmin(evaluate('min_angle', mesh)):.3f}"]
    assert f"largest {angle} [°]" in rows


def test_what_is_invalid_inside_alone() -> None:
    mesh = cloud()
    (block,) = mesh.topology.blocks
    corners = jacobians(mesh.points, "hexahedron", block.vertices, 1).min(axis=1)
    inside = (corners > 0) & (jacobians(mesh.points, "hexahedron", block.vertices, 12).min(axis=1) < 0)
    report = report_on(mesh)
    found = to_json(report)["quality"]["mesh"]["types"]["hexahedron"]
    rows = dict(quality_rows(report))
    assert 0 < inside.sum() <= found["inside"] < found["inverted"] == (corners <= 0).sum() + found["inside"]
    assert rows["of these invalid inside only"] == [str(found["inside"])]
    assert "of these invalid inside only" not in dict(quality_rows(report_on(built("hex box"))))


@pytest.mark.parametrize("name", ["every solid", "quads and triangles", "hex shell"])
def test_inverted_elements_are_named_by_number_and_type(name: str) -> None:
    mesh = tangled(name)
    report = replace(report_on(mesh), everything=True)
    points, cells = MESHES[name]()
    rows = [(key, row) for key, block in cells for row in block]
    words = {"tetra": "tetrahedron", "quad": "quadrilateral"}
    lines = verdict(report)[1:]
    assert len(lines) == report.result.inverted > 10
    for line, i in zip(lines, report.result.inverted_elements.tolist(), strict=True):
        key, row = rows[i]
        place = ", ".join(f"{x:.6g}" for x in mesh.points[row].mean(axis=0))
        assert line == f"  {words.get(key, key)} {FIRST + i} at ({place})"
    first = to_json(report)["first_inverted"][0]
    assert first["id"] == FIRST + report.result.inverted_elements[0]
    np.testing.assert_allclose(centroids(report, np.array([len(rows) - 1]))[0], mesh.points[rows[-1][1]].mean(axis=0))
    assert len(points) == len(mesh.points)


def test_obstacles_name_elements_by_number_and_type() -> None:
    """All vertices held: what is inverted cannot be mended."""
    mesh = tangled("every solid").with_fixed(np.ones(len(built("every solid").points), dtype=bool))
    report = report_on(mesh)
    (line,) = (line for line in verdict(report) if "without a free vertex" in line)
    first = report.obstacles.inverted[:10]
    named = [name.split() for name in names(report, first)]
    assert [int(number) for _, number in named] == (FIRST + first).tolist()
    assert len({word for word, _ in named}) == 1, "the first of the file are of one type"
    assert line.endswith(f"(hexahedra {', '.join(number for _, number in named)}, ...)")
    types = [mesh.topology.blocks[i].rows[0] for i in (3, 0)]
    few = replace(report, obstacles=replace(report.obstacles, inverted=np.array([*types, types[1] + 1])))
    (line,) = (line for line in verdict(few) if "without a free vertex" in line)
    expected = f"hexahedron {FIRST + types[0]}, tetrahedra {FIRST + types[1]}, {FIRST + types[1] + 1}"
    assert line.endswith(f"({expected})")
    pairs = replace(report.obstacles, crossing=np.array([types]))
    (line,) = (line for line in verdict(replace(report, obstacles=pairs)) if "crosses itself" in line)
    assert line.endswith(f"in 1 place (hexahedron {FIRST + types[0]} and tetrahedron {FIRST + types[1]})")


@pytest.mark.parametrize("name", ["hexes beside tets", "hex plate", "graded quads"])
def test_the_ceiling_is_a_scaled_jacobian(name: str) -> None:
    """That of the elements at the boundary which have no free vertex, by VTK, or what held edges allow others."""
    mesh = built(name)
    held = [~mesh.movable[block.vertices].any(axis=1) for block in mesh.topology.blocks]
    values = np.concatenate([part[stuck] for part, stuck in zip(by_vtk(mesh), held, strict=True)])
    report = report_on(mesh)
    expected = min(values.min(initial=np.inf), highest(mesh))
    if not len(values) and expected > 1 - 1e-9:
        assert report.ceiling is None
        assert "ceiling set by fixed vertices" not in dict(quality_rows(report))
    else:
        assert report.ceiling == pytest.approx(expected, abs=1e-12)
        assert dict(quality_rows(report))["ceiling set by fixed vertices"] == [f"{expected:.3f}"]


def test_a_run_is_told_from_sweep_to_result() -> None:
    outcome = untangle(tangled("hexes beside tets"))
    before, after = to_json(report_on(outcome.before)), to_json(report_on(outcome.after))
    assert outcome.valid
    assert after["valid"]
    smallest = [told["quality"]["mesh"]["scaled_jacobian"]["smallest"] for told in (before, after)]
    assert smallest[0] < 0 < smallest[1]
    report = replace(report_on(outcome.before, outcome.after, command="untangle"), records=outcome.records)
    text = shown(report)
    assert "Laplacian: " in text
    assert "smallest volume" in text
    assert text.endswith("valid: no element is inverted\n")


def batched(*files: tuple[str, ...]) -> str:
    """What a batch says of meshes, each made of another as by a repair."""
    out, tally = io.StringIO(), Tally()
    for name in files:
        told = to_json(report_on(tangled(*name), built(name[0]), command="batch"))
        result = {**told, "status": "valid", "seconds": 1.0, "error": None}
        print_result(result, console(out), as_json=False)
        tally.add(result)
    print_tally(tally, 1.0, console(out))
    return out.getvalue()


def test_batches_tell_scaled_jacobians() -> None:
    smallest = [f"{np.concatenate(by_vtk(built(name))).min():.3f}" for name in ("hex plate", "hexes beside tets")]
    text = batched(("hex plate",), ("hexes beside tets",))
    for line, number in zip(text.splitlines(), smallest, strict=False):
        assert line.split(", ")[2].startswith("smallest scaled Jacobian -")
        assert line.split(", ")[2].endswith(f" -> {number}")
    (last,) = (line for line in text.splitlines() if "smallest scaled Jacobian of all" in line)
    assert last.split()[-2] == min(smallest, key=float)
    (angles,) = (line for line in text.splitlines() if "smallest angle of all" in line)
    smallest_angle = np.nanmin(evaluate("min_angle", built("hexes beside tets")))
    assert float(angles.split()[-2]) == pytest.approx(smallest_angle, abs=1e-3)
    assert "Jacobian" not in shown(report_on(simplices()))


def simplices() -> Mesh:
    points, cells = MESHES["hexes beside tets"]()
    return Mesh.build(points, dict(cells)["tetra"])


def test_simplices_are_told_as_ever() -> None:
    mesh = simplices()
    told = to_json(report_on(mesh))
    stage = told["quality"]["mesh"]
    assert (stage["histogram"]["of"], stage["histogram"]["bin_width"]) == ("min_angle", 5.0)
    assert not {"scaled_jacobian", "types"} & set(stage)
    assert title(report_on(mesh)).startswith(f"mesh: {counted(mesh.topology.m, 'tetrahedron', 'tetrahedra')}, ")
    assert names(report_on(mesh), np.array([4])) == [f"element {FIRST + 4}"]
    assert math.isfinite(told["percentile_1"])
    assert document_of(mesh).mesh is mesh
