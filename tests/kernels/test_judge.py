"""Elements of every type: the kernels' table, and their verdicts against sampling, gmsh and VTK."""

from __future__ import annotations

import numpy as np
import pytest
from isoparametric import (
    CODES,
    REGULAR,
    Array,
    grid,
    jacobians,
    judged,
    perturbed,
    regular,
    smallest_jacobian,
)
from numpy.typing import NDArray
from programs import gmsh_session

from meshfix_cli import kernels
from meshfix_cli.mesh.elements import ELEMENTS, JUDGED
from meshfix_cli.quality import simplices

VALID, INSIDE, CORNER = 0, 1, 2
CORNERED = ("quad", "pyramid", "wedge", "hexahedron")  # all that is not a simplex
every = pytest.mark.parametrize("key", list(CODES))
layered = pytest.mark.parametrize("key", ["wedge", "hexahedron"])
cornered = pytest.mark.parametrize("key", CORNERED)


def twisted(key: str, angles: Array, squeeze: float = np.sqrt(2)) -> Array:
    """Regular wedges or hexahedra (k, n, 3) with tops that are turned, in radians, and squeezed across their bottoms.

    Up to the angle with cos = -2 / (squeeze^2 + squeeze^-2) they are valid, then not so in their middle. Nothing is
    ever bad at their corners: both triangles or quads have their full areas.
    """
    nodes = np.repeat(regular(key)[None], len(angles), axis=0)
    top = nodes[0, :, 2] > 0.5
    centre = nodes[0, top].mean(axis=0) * [1, 1, 0]
    turn = np.zeros((len(angles), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angles)
    turn[:, 0, 1], turn[:, 1, 0] = np.sin(angles), -np.sin(angles)
    turn[:, 2, 2] = 1
    nodes -= centre
    nodes[:, ~top] *= [squeeze, 1 / squeeze, 1]
    nodes[:, top] *= [1 / squeeze, squeeze, 1]
    nodes[:, top] = nodes[:, top] @ turn
    return nodes


def assert_sampling_agrees(key: str, nodes: Array) -> NDArray[np.uint8]:
    """No sampled det J of a valid element is negative, and some of one that is invalid only inside is; the verdicts."""
    verdicts = judged(nodes, key)[0]
    at = grid(key, np.linspace(0, 1, 7))
    for some in np.array_split(np.arange(len(nodes)), len(nodes) // 200 + 1):
        smallest = jacobians(key, nodes[some], at).min(axis=1)
        assert (smallest[verdicts[some] == VALID] > 0).all()
    corners = jacobians(key, nodes, grid(key, np.array([0.0, 1.0]))).min(axis=1)
    assert (corners[verdicts == CORNER] <= 0).all()
    assert (corners[verdicts != CORNER] > 0).all()
    for element in nodes[verdicts == INSIDE]:
        assert smallest_jacobian(key, element) <= 1e-9
    return verdicts


def gmsh_min_jacobian(key: str, nodes: Array) -> Array:
    """The smallest det J (m,) of elements (m, n, d) as gmsh bounds it."""
    m, n, d = nodes.shape
    points = np.zeros((m * n, 3))
    points[:, :d] = nodes.reshape(-1, d)
    tags = np.arange(1, m + 1)
    with gmsh_session() as gmsh:
        entity = gmsh.model.addDiscreteEntity(d)
        gmsh.model.mesh.addNodes(d, entity, np.arange(1, m * n + 1), points.ravel())
        gmsh.model.mesh.addElementsByType(entity, ELEMENTS[key].gmsh, tags, np.arange(1, m * n + 1))
        return np.array(gmsh.model.mesh.getElementQualities(tags, "minDetJac"))


def assert_gmsh_agrees(key: str, nodes: Array) -> int:
    """How often gmsh's bound is decisive; in a plane, it sees an inverted element from the other side."""
    smallest, (verdicts, measure, _) = gmsh_min_jacobian(key, nodes), judged(nodes, key)
    decisive = (np.abs(smallest) > 1e-3) & ((measure > 0) | (nodes.shape[2] == 3))
    np.testing.assert_array_equal((verdicts == VALID)[decisive], (smallest > 0)[decisive])
    return int(decisive.sum())


@pytest.mark.parametrize("code", list(CODES.values()), ids=list(CODES))
def test_the_table_is_that_of_the_elements(code: int) -> None:
    shape = JUDGED[code].shape
    dimension, nodes, simplices, facets, mirrored, weight = kernels.SHAPES[code]
    assert (dimension, nodes) == (shape.dimension, shape.corners)
    assert simplices == [list(row) for row in shape.simplices]
    assert facets == [list(row) for row in shape.facets]
    assert weight == pytest.approx(shape.weight, rel=1e-15)
    assert mirrored == list(shape.mirrored)
    assert len(kernels.SHAPES) == len(JUDGED)
    facets_of = {frozenset(facet) for facet in facets}
    assert {frozenset(mirrored[node] for node in facet) for facet in facets} == facets_of
    assert judged(regular(JUDGED[code].key)[None, mirrored], JUDGED[code].key)[1] < 0


@every
def test_the_regular_element_is_valid_and_of_quality_one(key: str) -> None:
    verdict, measure, quality = judged(regular(key)[None], key)
    assert verdict == VALID
    assert measure > 0
    expected = {"triangle": np.sqrt(3) / 2, "tetra": np.sqrt(8) / 3}
    assert quality == pytest.approx(expected.get(key, 1), rel=1e-14)


@cornered
def test_verdicts_against_sampling(random: np.random.Generator, key: str) -> None:
    assert {VALID, CORNER} <= set(assert_sampling_agrees(key, perturbed(random, key, 1000)).tolist())


@cornered
def test_verdicts_against_gmsh(random: np.random.Generator, key: str) -> None:
    assert assert_gmsh_agrees(key, perturbed(random, key, 1000)) > 900


@layered
def test_elements_that_only_their_corners_call_valid(random: np.random.Generator, key: str) -> None:
    limit = np.arccos(-0.8)
    angles = np.array([0, 2, limit - 1e-9, limit + 1e-9, 3, np.pi])
    nodes = twisted(key, angles)
    assert judged(nodes, key)[0].tolist() == [VALID, VALID, VALID, INSIDE, INSIDE, INSIDE]
    assert_gmsh_agrees(key, nodes)
    skew = nodes[:, None] @ random.uniform(-1, 1, (1, 20, 3, 3)) + 0.1 * random.standard_normal(
        (6, 20, *nodes[0].shape)
    )
    assert set(assert_sampling_agrees(key, skew.reshape(-1, *nodes[0].shape)).tolist()) == {VALID, INSIDE, CORNER}


@every
def test_mirrored(random: np.random.Generator, key: str) -> None:
    nodes, order = perturbed(random, key, 300), kernels.SHAPES[CODES[key]][4]
    before = judged(nodes, key)
    mirrored = nodes * ([-1.0] + [1.0] * (nodes.shape[2] - 1))
    inverted = judged(mirrored, key)
    assert (inverted[0][before[0] == VALID] == CORNER).all()
    np.testing.assert_allclose(inverted[1], -before[1], atol=1e-13)
    again = judged(mirrored[:, order], key)
    np.testing.assert_array_equal(again[0], before[0])
    for k in (1, 2):
        np.testing.assert_allclose(again[k], before[k], atol=1e-13)


@every
def test_nan_is_never_valid(key: str) -> None:
    element = regular(key)
    nodes = np.repeat(element[None], element.size, axis=0)
    nodes.reshape(element.size, -1)[np.diag_indices(element.size)] = np.nan
    verdicts, _, quality = judged(nodes, key)
    assert (verdicts == CORNER).all()
    assert np.isfinite(quality).all()


@every
def test_no_size(key: str) -> None:
    verdicts, measure, quality = judged(np.zeros((1, *regular(key).shape)), key)
    assert (verdicts[0], measure[0], quality[0]) == (CORNER, 0, 0)


@every
def test_an_edge_without_length_has_quality_zero(random: np.random.Generator, key: str) -> None:
    nodes = perturbed(random, key, 50, (0.0, 0.05))
    nodes[:, 1] = nodes[:, 0]
    verdicts, _, quality = judged(nodes, key)
    assert (verdicts == CORNER).all()
    assert (quality <= 0).all()
    assert (quality == 0).any()


@every
@pytest.mark.parametrize("exponent", [-60, 60])
def test_scale_changes_nothing(random: np.random.Generator, key: str, exponent: int) -> None:
    nodes = perturbed(random, key, 300)
    scale = 2.0**exponent
    before, after = judged(nodes, key), judged(nodes * scale, key)
    np.testing.assert_array_equal(after[0], before[0])
    np.testing.assert_array_equal(after[1], before[1] * scale ** nodes.shape[2])
    np.testing.assert_array_equal(after[2], before[2])


@every
def test_a_far_offset_changes_nothing(random: np.random.Generator, key: str) -> None:
    nodes = np.round(perturbed(random, key, 300) * 2**16) / 2**16
    before, after = judged(nodes, key), judged(nodes + 2.0**34, key)
    for k in range(3):
        np.testing.assert_array_equal(after[k], before[k])


@every
def test_thin_layers_are_valid(random: np.random.Generator, key: str) -> None:
    nodes = perturbed(random, key, 100, (0.0, 0.02))
    for axis in range(nodes.shape[2]):
        for thickness in (1e-4, 1e-8, 1e-10):
            thin = nodes.copy()
            thin[..., axis] *= thickness
            verdicts, _, quality = judged(thin, key)
            assert (verdicts == VALID).all()
            assert (quality > 0).all()


@layered
def test_tapered_elements_are_valid(key: str) -> None:
    """Bounds are of each coefficient's own edges: those of a small top are small."""
    for taper in (1e-4, 1e-8, 1e-12):
        nodes = regular(key)
        nodes[nodes[:, 2] > 0.5, :2] *= taper
        assert judged(nodes[None], key)[0] == VALID


@layered
def test_what_is_not_proved_is_not_valid(key: str) -> None:
    """Where det J is zero in the middle, or positive by less than its rounding; it is proved for a little more."""
    touching = twisted(key, np.pi + np.array([0, 1e-8, -1e-8]), squeeze=1)
    assert (judged(touching, key)[0] == INSIDE).all()
    assert judged(twisted(key, np.array([np.pi - 1e-5]), squeeze=1), key)[0] == VALID


@cornered
def test_quality_is_the_smallest_scaled_jacobian(random: np.random.Generator, key: str) -> None:
    nodes, shape = perturbed(random, key, 200), ELEMENTS[key].shape
    rows = np.array(shape.simplices)
    edges = nodes[:, rows[:, 1:]] - nodes[:, rows[:, :1]]
    unit = edges / np.linalg.norm(edges, axis=3, keepdims=True)
    expected = shape.weight * np.linalg.det(unit).min(axis=1)
    np.testing.assert_allclose(judged(nodes, key)[2], expected, atol=1e-13)


@pytest.mark.parametrize("key", ["triangle", "tetra"])
def test_quality_of_simplices_is_the_smallest_sine(random: np.random.Generator, key: str) -> None:
    nodes = perturbed(random, key, 200)
    _, measure, quality = judged(nodes, key)
    edges = nodes[:, 1:] - nodes[:, :1]
    np.testing.assert_allclose(np.abs(quality), simplices.min_sine(edges, np.abs(measure)), rtol=1e-9)
    np.testing.assert_array_equal(np.sign(quality), np.sign(measure))


def centre_jacobian(nodes: Array) -> Array:
    """Scaled Jacobians (m,) at the centres of hexahedra (m, 8, 3)."""
    sides = [nodes[:, facet].sum(axis=1) for facet in ELEMENTS["hexahedron"].shape.facets]
    axes = np.stack([sides[k + 1] - sides[k] for k in (0, 2, 4)], axis=1)
    return np.linalg.det(axes / np.linalg.norm(axes, axis=2, keepdims=True))


def test_scaled_jacobian_is_that_of_vtk(random: np.random.Generator) -> None:
    """Which looks at the centre of a hexahedron too."""
    quality = pytest.importorskip("vtkmodules.vtkFiltersVerdict").vtkMeshQuality
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    functions = {"quad": "QuadScaledJacobian", "wedge": "WedgeScaledJacobian", "hexahedron": "HexScaledJacobian"}
    for key, name in functions.items():
        nodes = perturbed(random, key, 50, (0.0, 0.3))
        expected = judged(nodes, key)[2]
        if key == "hexahedron":
            expected = np.minimum(expected, centre_jacobian(nodes))
        for element, value in zip(nodes, expected, strict=True):
            cell = model.vtkGenericCell.InstantiateCell(ELEMENTS[key].vtk)
            for i, p in enumerate(element):
                cell.GetPoints().SetPoint(i, *p, *[0.0] * (3 - len(p)))
            assert getattr(quality, name)(cell) == pytest.approx(value, rel=1e-12, abs=1e-12)


def test_equal_bits_for_any_number_of_threads(random: np.random.Generator) -> None:
    """All types of a dimension in one call, and more of them than an item of work has."""
    keys = ["tetra", "pyramid", "wedge", "hexahedron"]
    blocks = [perturbed(random, key, 10_000) for key in keys]
    points = np.concatenate([block.reshape(-1, 3) for block in blocks])
    sizes = np.repeat([len(REGULAR[key]) for key in keys], 10_000)
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int32)
    codes = np.repeat([CODES[key] for key in keys], 10_000).astype(np.uint8)
    nodes = np.arange(len(points), dtype=np.int32)
    expected = [np.concatenate(parts) for parts in zip(*map(judged, blocks, keys), strict=True)]
    for threads in (1, 2, 5):
        for found, wanted in zip(kernels.judge(points, codes, offsets, nodes, threads), expected, strict=True):
            np.testing.assert_array_equal(found, wanted)
