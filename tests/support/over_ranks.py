"""What the tests run in several processes: `mpiexec -n 3 python over_ranks.py CASE...`.

Each case is solved by the processes and by one alone; the root prints its name, and whether the bits and the counts of
the records are the same.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path += [str(Path(__file__).parents[2] / name) for name in ("sample_meshes", "benchmarks", "tests/support")]
import elements
import generate
from building import Blocks
from layered import Points, body_of, layered, left_behind
from meshes import sliding, sliding_on_curves, tangle, with_a_rough_boundary, with_an_inverted_fixed_simplex

from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.reference import reference_points
from meshfix_cli.repair import Method
from meshfix_cli.solve.perturb import Distance
from meshfix_cli.solve.records import Outcome
from meshfix_cli.workers.distributed import ROOT, Root, serve

REACH = Distance(3.0, in_h=True)
# Those of elements that are not simplices alone; the second is of one block.
ELEMENTS: dict[str, Callable[[], tuple[Points, Blocks]]] = {
    "hexes": partial(elements.box_of_hexahedra, 5000),
    "fewsolids": elements.every_solid,
    "solids": elements.hexahedra_and_wedges,
    "quads": elements.quad_plate,
}
METHODS = {
    "auto": Method(),
    "best": Method(smooth="best"),
    "bestofvalid": Method(smooth="best"),
    "finished": Method(smooth="best"),
    "US": Method("US", sweeps=5),
    "CS": Method("CS"),
    "LUS": Method("LUS"),
    "LS": Method("LS", sweeps=2, smooth=0),
    "FF": Method("FF"),
    "onlyinvalid": Method(only_invalid=True),
    "onlyinvalidFF": Method("FF", only_invalid=True),
    "back": Method(only_invalid=True, smooth=0),
    "impossible": Method(),
    "near": Method(max_move=REACH),
    "nearFF": Method("FF", max_move=REACH),
    "plane": Method(),
    "planebest": Method(smooth="best"),
    "small": Method(),
    "smallbest": Method(smooth="best"),
    "hexes": Method(),
    "hexesFF": Method("FF"),
    "hexesimpossible": Method(),
    "hexesonlyinvalid": Method(only_invalid=True),
    "solids": Method(smooth="best"),
    "fewsolids": Method(smooth="best"),
    "quads": Method(smooth="best"),
    "solidsreference": Method(),
    "sliding": Method(),
    "slidingbest": Method(smooth="best"),
    "slidingFF": Method("FF"),
    "slidingonlyinvalid": Method(only_invalid=True),
    "curved": Method(),
    "curvedbest": Method(smooth="best"),
    "curvedFF": Method("FF"),
    "curvednear": Method(max_move=REACH),
    "curvedreference": Method(),
    "layers": Method(),
    "reference": Method(),
}


@cache
def large() -> Mesh:
    """Return a valid mesh of 11 blocks in 7 colours."""
    return Mesh.build(*generate.bracket(0.08, 10))


def mesh_of(case: str) -> Mesh:
    """Return a mesh of 11 blocks; of "plane" 2-D, of FF and "small" of two or one; of `ELEMENTS` of up to six."""
    if case.startswith("plane"):
        return tangle(Mesh.build(*generate.plate(0.035)))
    for name, made in ELEMENTS.items():
        if case.startswith(name):
            valid = Mesh.build(*made())
            if case.endswith("impossible"):
                return with_a_rough_boundary(valid, 0.55, 0)
            return bent(valid) if case.endswith("reference") else tangle(valid, 25, 1 if "only" in case else 2)
    if case.startswith("small"):
        return tangle(Mesh.build(*generate.plate(0.18)))
    if case.startswith("sliding"):
        return tangle(sliding(Mesh.build(*generate.bracket(0.06, 10))), 25, 1)
    if case.startswith("curved"):
        return tangle(sliding_on_curves(Mesh.build(*generate.bracket(0.06, 10))), 25, 1)
    if case.endswith("FF"):
        return tangle(Mesh.build(*generate.bracket(0.18, 8)), 25, 2)
    if case == "layers":
        return left_behind(layered(3), body_of(layered(3)) + 0.01)
    valid = large()
    if case == "bestofvalid":
        return valid
    if case == "impossible":
        return with_an_inverted_fixed_simplex(tangle(valid, 25, 2))
    if case == "finished":  # nothing is left to be gained
        return Method(smooth="best").solve(Method(smooth="best").solve(valid, np.inf, 2).after, np.inf, 2).after
    if case == "reference":
        return bent(valid)
    return tangle(valid, 25, 1 if case == "onlyinvalid" else 2)


def bent(valid: Mesh) -> Mesh:
    """Return a solid whose boundary has moved."""
    moved = valid.points + 0.3 * np.sin(2 * valid.points[:, [1, 2, 0]])
    return valid.with_points(np.where(valid.movable[:, None], valid.points, moved))


def reference_of(case: str, mesh: Mesh) -> Points | None:
    """Return where the vertices of a mesh were before its boundary moved, where that is the case."""
    if not case.endswith("reference"):
        return None
    if case == "curvedreference":
        return reference_points(mesh, Mesh.build(*generate.bracket(0.06, 10)))
    made = ELEMENTS["solids"]() if case == "solidsreference" else generate.bracket(0.08, 10)
    return reference_points(mesh, Mesh.build(*made))


def facts(outcome: Outcome) -> tuple[Any, ...]:
    """Return what must be the same: the bits of all three meshes, which of them are one, and the records."""
    meshes = outcome.before, outcome.untangled, outcome.after
    same = tuple(a is b for a in meshes for b in meshes)
    records = tuple(replace(record, seconds=0.0) for record in outcome.records)
    return tuple(mesh.points.tobytes() for mesh in meshes), same, records


def main(cases: list[str]) -> None:
    """Run the cases."""
    from mpi4py import MPI  # the tests read METHODS also where it is not installed

    comm = MPI.COMM_WORLD
    for case in cases:
        method = METHODS[case]
        if comm.rank != ROOT:
            wait_for_all(comm)
            serve(comm, method, 1)
            continue
        mesh = mesh_of(case)
        reach, reference = method.reach(mesh, 1), reference_of(case, mesh)
        expected = facts(method.solve(mesh, reach, 2, reference=reference))
        wait_for_all(comm)
        root = Root(comm, method, 1)
        found = facts(root.solve(mesh, reach, reference))
        root.dismiss(0)
        print(case, found == expected, flush=True)


def wait_for_all(comm: Any) -> None:
    """Sleep until all are here: those that wait as MPI does take the cores from the root, which works alone."""
    here = comm.Ibarrier()
    while not here.Test():
        time.sleep(0.01)


if __name__ == "__main__":
    main(sys.argv[1:])
