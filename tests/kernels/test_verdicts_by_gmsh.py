"""Verdicts on elements of third and fourth order against gmsh's bounds of det J."""

from __future__ import annotations

import numpy as np
import pytest
from monomials import Array, perturbed
from numpy.typing import NDArray
from programs import gmsh_session

from meshfix_cli.mesh.judged import VALID
from meshfix_cli.mesh.quadratic import Quadratic
from meshfix_cli.meshfile.gmsh.cells import TYPES, order_of

TYPE = {  # gmsh bounds no wedges of these orders
    3: ("triangle10", "quad16", "tetra20", "hexahedron64"),
    4: ("triangle15", "quad25", "tetra35", "hexahedron125"),
}  # fmt: skip
COUNT = {3: 40, 4: 10}
NEAR = 1e-6  # zero: neither bound tells more


def bounds(key: str, points: Array, rows: NDArray[np.integer]) -> Array:
    """Return the smallest det J (m,) of elements as gmsh finds it."""
    numbers, d = {name: number for number, (name, _) in TYPES.items()}, points.shape[1]
    order = np.argsort(order_of(key) or range(rows.shape[1]))
    with gmsh_session() as gmsh:
        gmsh.model.addDiscreteEntity(d, 1)
        flat = np.column_stack([points, np.zeros((len(points), 3 - d))])
        gmsh.model.mesh.addNodes(d, 1, np.arange(len(flat)) + 1, flat.ravel())
        gmsh.model.mesh.addElementsByType(1, numbers[key], np.arange(len(rows)) + 1, (rows[:, order] + 1).ravel())
        return np.array(gmsh.model.mesh.getElementQualities(np.arange(len(rows)) + 1, "minDetJac"))


@pytest.mark.parametrize(("order", "key"), [(order, key) for order, keys in TYPE.items() for key in keys])
def test_verdicts_against_gmsh(random: np.random.Generator, order: int, key: str) -> None:
    sizes = np.geomspace(0.005, 0.3, COUNT[order])
    points = np.concatenate([perturbed(random, key, size) for size in sizes])
    rows = np.arange(len(points)).reshape(len(sizes), -1)
    found = Quadratic([(key, rows)], len(points)).judge(points, 1)
    smallest = bounds(key, points, rows)
    clear = np.abs(smallest) > NEAR
    valid = found.verdicts == VALID
    assert (valid == (smallest > 0))[clear].all()
    assert {*valid.tolist()} == {False, True}


@pytest.mark.parametrize("threads", [2, 3])
@pytest.mark.parametrize("key", ["quad16", "tetra20"])
def test_any_number_of_threads_judges_alike(random: np.random.Generator, key: str, threads: int) -> None:
    points = np.concatenate([perturbed(random, key, 0.05) for _ in range(200)])
    quadratic = Quadratic([(key, np.arange(len(points)).reshape(200, -1))], len(points))
    one, other = quadratic.judge(points, 1), quadratic.judge(points, threads)
    assert one.verdicts.tobytes() == other.verdicts.tobytes()
    assert one.smallest.tobytes() == other.smallest.tobytes()
