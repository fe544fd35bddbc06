"""Metrics of quadrilaterals, pyramids, wedges and hexahedra, against VTK's copy of Verdict."""

from __future__ import annotations

import numpy as np
import pytest
from isoparametric import REGULAR
from numpy.typing import NDArray
from verdict import NAMES, vtk_quality

from meshfix_cli.mesh.elements import JUDGED, SIMPLICES, Element
from meshfix_cli.quality.formulas import evaluate_at
from meshfix_cli.quality.metrics import METRICS

Array = NDArray[np.float64]
ELEMENTS = {element.key: element for element in JUDGED if element.judged_by != "determinant"}
TETRA = SIMPLICES[3]
PAIRS = [(name, key) for name, metric in METRICS.items() for key in metric.elements if key in ELEMENTS]
each = pytest.mark.parametrize(("name", "key"), PAIRS)

# Numberings of the same element.
AGAIN: dict[str, list[tuple[int, ...]]] = {
    "quad": [(1, 2, 3, 0), (2, 3, 0, 1)],
    "pyramid": [(1, 2, 3, 0, 4), (2, 3, 0, 1, 4)],
    "wedge": [(1, 2, 0, 4, 5, 3), (3, 5, 4, 0, 2, 1)],
    "hexahedron": [(1, 2, 3, 0, 5, 6, 7, 4), (3, 2, 6, 7, 0, 1, 5, 4)],
}


def ideal(key: str) -> Array:
    return np.array([REGULAR[key]], dtype=float)


def shaken(key: str, seed: int) -> Array:
    """Elements (600, nodes, d), from nearly ideal to wholly tangled, of which most are positive in the mean."""
    random = np.random.default_rng(seed)
    sizes = random.uniform(0.01, 1.0, (600, 1, 1))
    return (ideal(key) + sizes * random.normal(size=(600, *ideal(key).shape[1:])) / 2) * 10 ** random.uniform(-3, 3)


def worst_corner(element: Element, nodes: Array) -> Array:
    """The smallest determinant (k,) of the edges at a corner."""
    rows = np.array(element.shape.simplices)
    return np.linalg.det(nodes[:, rows[:, 1:]] - nodes[:, rows[:, :1]]).min(axis=1)


def counter_clockwise(quads: Array) -> Array:
    """Those of positive area: VTK's quadrilaterals lie in space, and none of them is mirrored."""
    x, y = quads[..., 0], quads[..., 1]
    return quads[(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) > 0]


@pytest.mark.parametrize(("name", "key"), [pair for pair in PAIRS if pair[0] in NAMES])
def test_metrics_are_verdicts(name: str, key: str) -> None:
    element, nodes = ELEMENTS[key], shaken(key, 1)
    if key == "quad":
        nodes = counter_clockwise(nodes)
    if key == "pyramid" and name in ("shape", "mean_ratio"):
        nodes = flat_pyramids()
    values, expected = evaluate_at(name, element, nodes), vtk_quality(name, element, nodes)
    valid = worst_corner(element, nodes) > 0
    assert 50 < valid.sum() < len(nodes) - 50
    if METRICS[name].worst == "max":
        assert (values[~valid] == np.inf).all()  # VTK gives concave ones what it gives convex ones
        values, expected = values[valid], expected[valid]
    if (name, key) == ("scaled_jacobian", "pyramid"):
        assert (values[~valid] < 0).all()  # VTK gives these 0
        expected[~valid] = values[~valid]
    np.testing.assert_allclose(values, expected, rtol=1e-9, atol=1e-12)


def flat_pyramids() -> Array:
    """Pyramids whose base is flat: VTK's normal of one that is warped depends on which corner is the first.

    They are numbered so that none of the first two sides is the longest: VTK takes the shorter one of these for it.
    """
    nodes = shaken("pyramid", 1)
    nodes[:, :4, 2] = 0
    sides = np.linalg.norm(nodes[:, :4] - np.roll(nodes[:, :4], -1, axis=1), axis=2).argmax(axis=1)
    turn = (np.arange(4) + sides[:, None] - 2) % 4
    nodes[:, :4] = np.take_along_axis(nodes[:, :4], turn[:, :, None], axis=1)
    return nodes


def test_the_centre_of_a_hexahedron_counts(random: np.random.Generator) -> None:
    """Turned by nearly half a turn, the corners are good, and the vectors between opposite faces are short."""
    element, nodes = ELEMENTS["hexahedron"], np.repeat(ideal("hexahedron"), 200, axis=0)
    nodes[:, 4:, :2] = 1 - nodes[:, 4:, :2]
    nodes += 0.05 * random.normal(size=nodes.shape)
    values = evaluate_at("scaled_jacobian", element, nodes)
    assert (worst_corner(element, nodes) > 0).all()
    assert (values < 0).any()
    np.testing.assert_allclose(values, vtk_quality("scaled_jacobian", element, nodes), rtol=1e-9, atol=1e-12)


def test_a_base_that_is_not_convex_has_no_shape() -> None:
    """Of the pyramid all corners are positive, and still the base, as its diagonals' normal sees it, is concave."""
    nodes = np.array([[[-0.4, 2.5, 1.0], [0.0, -0.3, -0.8], [2.9, 1.3, -1.3], [-1.6, -0.6, 0.6], [-0.8, -1.0, -0.6]]])
    assert worst_corner(ELEMENTS["pyramid"], nodes)[0] > 0
    assert evaluate_at("shape", ELEMENTS["pyramid"], nodes)[0] == 0
    assert vtk_quality("shape", ELEMENTS["pyramid"], nodes)[0] == 0


def test_pyramids_whose_tetrahedra_are_better_than_those_of_the_ideal_one() -> None:
    nodes = ideal("pyramid")
    nodes[:, :, 2] += [0.1, -0.1, 0.1, -0.1, 0.2]
    (value,) = evaluate_at("scaled_jacobian", ELEMENTS["pyramid"], nodes)
    corners = ELEMENTS["pyramid"].shape.simplices
    tetrahedra = np.sqrt(2) * min(vtk_quality("scaled_jacobian", TETRA, nodes[:, row])[0] for row in corners)
    assert 1 < tetrahedra == pytest.approx(2 - value)
    assert value == pytest.approx(vtk_quality("scaled_jacobian", ELEMENTS["pyramid"], nodes)[0])


def test_sines_of_interior_angles() -> None:
    nodes = shaken("quad", 1)
    z = nodes[..., 0] + 1j * nodes[..., 1]
    angles = np.angle((np.roll(z, 1, axis=1) - z) / (np.roll(z, -1, axis=1) - z))
    np.testing.assert_allclose(evaluate_at("min_sine", ELEMENTS["quad"], nodes), np.sin(angles).min(axis=1), atol=1e-9)


@each
def test_the_ideal_element_is_best(name: str, key: str) -> None:
    best = {"min_angle": 90.0}.get(name, 1.0)
    assert evaluate_at(name, ELEMENTS[key], ideal(key))[0] == pytest.approx(best)
    values = evaluate_at(name, ELEMENTS[key], shaken(key, 2))
    assert (values >= best).all() if METRICS[name].worst == "max" else (values <= best).all()


@each
def test_numbering_place_size_and_turn_do_not_matter(name: str, key: str, random: np.random.Generator) -> None:
    element, nodes = ELEMENTS[key], shaken(key, 3)
    expected = evaluate_at(name, element, nodes)
    d = nodes.shape[2]
    turn = np.linalg.qr(random.normal(size=(d, d)))[0]
    turn[0] *= np.linalg.det(turn)
    moved = 37 * nodes @ turn + 10 * random.normal(size=d)
    for same in (moved, *(nodes[:, list(again)] for again in AGAIN[key])):
        np.testing.assert_allclose(evaluate_at(name, element, same), expected, rtol=1e-6, atol=1e-9)


@each
def test_an_inverted_element_is_bad(name: str, key: str) -> None:
    """Mirrored, and with one corner that is not positive, whatever the others are."""
    element, mirrored = ELEMENTS[key], ideal(key) * ([-1] + [1] * (ideal(key).shape[2] - 1))
    nodes = shaken(key, 4)
    nodes = np.concatenate([mirrored, nodes[worst_corner(element, nodes) < 0]])
    values = evaluate_at(name, element, nodes)
    if name == "min_angle":  # which has no sign
        assert values[0] == pytest.approx(90)
    elif name in ("shape", "mean_ratio"):
        assert (values == 0).all()
    else:
        assert (values == np.inf if METRICS[name].worst == "max" else values < 0).all()


@each
def test_a_collapsed_element_has_the_worst_value(name: str, key: str) -> None:
    """VTK gives a hexahedron that is a point 1e30, and a quadrilateral 360 degrees."""
    point = ideal(key) * 0 + 1
    edge = ideal(key)
    edge[:, 1] = edge[:, 0]
    reflex = ideal(key)  # one corner has no edge, and another one is turned inside out
    reflex[:, 1] = reflex[:, 0]
    reflex[:, 2] = 2 * reflex[:, 3] - reflex[:, 2]
    for nodes, exact in ((point, True), (edge, True), (reflex, False)):
        value = evaluate_at(name, ELEMENTS[key], nodes)[0]
        assert value == np.inf if METRICS[name].worst == "max" else value == 0 if exact else value <= 0
    if name == "scaled_jacobian":
        assert value < 0
