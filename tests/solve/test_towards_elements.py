"""Towards a reference, of elements that are not simplices alone."""

from __future__ import annotations

import numpy as np
import pytest
from elements import HOLES, MESHES, turned
from layered import turn
from meshes import tangle
from sampling import jacobians

from meshfix_cli import Mesh, kernels, untangle
from meshfix_cli.errors import InvalidMeshError
from meshfix_cli.mesh.reference import reference_points
from meshfix_cli.quality.relative import worst_and_mean_to
from meshfix_cli.solve.region import Region

CUBE = np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
PRISM = CUBE[[0, 1, 3, 4, 5, 7]] + 2.0
# Valid at its corners, and inverted in its middle: the top is turned half round, each end squeezed another way.
HOURGLASS = (CUBE - 0.5) * np.repeat([[2.0**0.5, 0.5**0.5, 1], [-(0.5**0.5), -(2.0**0.5), 1]], 4, axis=0)


def ratio(mesh: Mesh, reference: Mesh) -> tuple[float, float]:
    return worst_and_mean_to(mesh, reference_points(mesh, reference))


def assert_valid_by_sampling(mesh: Mesh) -> None:
    for block in mesh.topology.blocks:
        assert (jacobians(mesh.points, block.element.key, block.vertices) > 0).all()


@pytest.mark.parametrize("name", ["quads and triangles", "every solid"])
def test_a_rigid_motion_of_everything_is_given_back(name: str) -> None:
    mesh = Mesh.build(*MESHES[name]())
    rotation = turn(100, mesh.dimension).T
    exact, tangled = mesh.points @ rotation + 3.0, tangle(mesh, 100, 2).points @ rotation + 3.0
    moved = mesh.with_points(np.where(mesh.movable[:, None], tangled, exact))
    outcome = untangle(moved, reference=mesh)
    assert outcome.valid
    assert np.abs(outcome.after.points - exact).max() < 1e-13
    assert ratio(outcome.after, mesh) == pytest.approx((1.0, 1.0), abs=1e-10)


@pytest.mark.parametrize(
    ("name", "degrees", "smallest", "mean"),
    [
        ("quad rings", 20, 0.9, 0.9),
        ("quad rings", 60, 0.7, 0.7),  # sheared by that much in all rings alike
        ("hex shell", 20, 0.7, 0.78),
        ("hex shell", 60, 0.1, 0.25),
    ],
)
def test_around_a_hole_that_turned_elements_keep_their_shapes(
    name: str, degrees: float, smallest: float, mean: float
) -> None:
    reference = Mesh.build(*MESHES[name]())
    moved = reference.with_points(turned(reference.points, HOLES[name](reference.points), degrees))
    outcome = untangle(moved, reference=reference)
    assert outcome.valid
    assert_valid_by_sampling(outcome.after)
    found = ratio(outcome.after, reference)
    assert found[0] > smallest
    assert found[1] > mean
    assert found[1] > ratio(outcome.untangled, reference)[1] - 1e-3


def test_any_number_of_threads_gives_the_same_bits() -> None:
    reference = Mesh.build(*MESHES["hexes and wedges"]())
    bent = reference.points + 0.1 * np.sin(4 * reference.points[:, [1, 2, 0]])
    moved = reference.with_points(np.where(reference.movable[:, None], tangle(reference, 100, 1).points, bent))
    outcomes = [untangle(moved, reference=reference, threads=threads) for threads in (1, 2, 3)]
    assert outcomes[0].valid
    assert outcomes[0].after is not moved
    assert len({outcome.after.points.tobytes() for outcome in outcomes}) == 1


def test_what_is_inverted_inside_alone_goes_back_on_its_way() -> None:
    mesh = Mesh.build(CUBE, [("hexahedron", np.arange(8)[None])])
    stars = mesh.topology.stars()
    region = Region(stars, np.ones(8, dtype=bool))
    assert len(kernels.check(HOURGLASS, stars.simplices, 1)[0]) == 0
    found = region.retreated(CUBE, HOURGLASS, -np.inf, 1)
    assert_valid_by_sampling(mesh.with_points(found))
    share = np.linalg.norm(found - CUBE, axis=1) / np.linalg.norm(HOURGLASS - CUBE, axis=1)
    assert share == pytest.approx(share[0])
    before = CUBE + 2 * share[0] * (HOURGLASS - CUBE)
    assert jacobians(before, "hexahedron", np.arange(8, dtype=np.int32)[None]).min() <= 0
    assert region.retreated(CUBE, found, -np.inf, 1) is found
    mirrored = CUBE[[0, 3, 2, 1, 4, 7, 6, 5]]
    assert region.retreated(CUBE, mirrored, 1.0, 1) is CUBE


def test_only_a_mesh_whose_elements_join_the_same_vertices_is_a_reference() -> None:
    points = np.concatenate([CUBE, PRISM])
    cells = {"wedge": np.arange(8, 14)[None], "hexahedron": np.arange(8)[None]}
    mesh = Mesh.build(points, list(cells.items()))
    for order in ([4, 7, 6, 5, 0, 3, 2, 1], [1, 2, 3, 0, 5, 6, 7, 4], [0, 3, 7, 4, 1, 2, 6, 5]):
        other = Mesh.build(points, [("wedge", cells["wedge"]), ("hexahedron", cells["hexahedron"][:, order])])
        assert reference_points(mesh, other) is not None
    twisted = cells["hexahedron"][:, [0, 1, 2, 3, 5, 6, 7, 4]]
    with pytest.raises(InvalidMeshError, match=r"^its hexahedron 1 has the vertices \[.*\], and that of the mesh \["):
        reference_points(mesh, Mesh.build(points, [("wedge", cells["wedge"]), ("hexahedron", twisted)]))
    with pytest.raises(InvalidMeshError, match=r"^its hexahedron 0 has the vertices \[.*\], and that of the mesh \["):
        reference_points(mesh, Mesh.build(points, list(reversed(cells.items()))))
    with pytest.raises(InvalidMeshError, match=r"^it has 14 points and 1 wedge, and the mesh 14 points and 2 elements"):
        reference_points(mesh, Mesh.build(points, [("wedge", cells["wedge"])]))
    with pytest.raises(InvalidMeshError, match=r"^1 element of it is inverted$"):
        reference_points(mesh, mesh.with_points(np.concatenate([HOURGLASS, PRISM])))
