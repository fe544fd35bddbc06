"""Towards a reference: the mesh before its boundary moved gives each element the shape that it should have.

The start is the reference, moved with the boundary: its elements turn, and are bent as little as may be. Source: O.
Sorkine and M. Alexa, "As-rigid-as-possible surface modeling", Symposium on Geometry Processing (2007), with simplices
for the cells, each of which counts the same, so that small ones are stiff. The foldover-free energy with the shapes of
the reference as its targets mends what is left, and is then minimised to the end.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.solve.foldover import Reach, minimisations_to

if TYPE_CHECKING:
    from meshfix_cli.mesh.freedom import Freedom

Array = NDArray[np.float64]

TURNS = 50  # of simplices, at most
GAIN = 1e-3  # share of the misfit by which a turn must lower it, to go on
EXACT = 1e-4  # residual of a system, of that at the start, each relative to the diagonal
STEPS = 1000  # of conjugate gradients, at most


def inverses(reference: Array, simplices: NDArray[np.int32]) -> Array:
    """Return the inverses (m, d, d) of the matrices of the simplices' edges in the reference.

    J = E W^-1, the columns of E and W the edges of a simplex and of its target, has rows k of W^-1 as its derivative by
    the k-th edge. Where the whole of a part is mirrored, so is the target.
    """
    corners = reference[simplices]
    matrices = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    found = np.asarray(np.linalg.inv(matrices), dtype=np.float64)
    found[np.linalg.det(matrices) < 0, :, 0] *= -1
    return found


def follow(
    max_move: float, threads: int, mesh: kernels.Connectivity, points: Array, start: Array, reference: Array,
    free: NDArray[np.bool_],
) -> Iterator[Array]:  # fmt: skip
    """Yield points (n, d) where the reference has followed the vertices that are held, as far as vertices may go."""
    del threads
    yield Reach(start, max_move).drawn_in(followed(points, mesh, reference, free))


def mend(
    max_move: float, threads: int, mesh: kernels.Connectivity, points: Array, start: Array, reference: Array,
    free: NDArray[np.bool_], freedom: Freedom | None = None,
) -> Iterator[Array]:  # fmt: skip
    """Yield points after each minimisation of the energy, until all is valid."""
    targets = inverses(reference, mesh.simplices)
    return minimisations_to(points, mesh, free, targets, Reach(start, max_move), threads, freedom=freedom)


def approach(
    max_move: float, threads: int, mesh: kernels.Connectivity, points: Array, start: Array, reference: Array,
    free: NDArray[np.bool_], freedom: Freedom | None = None,
) -> Iterator[Array]:  # fmt: skip
    """Yield valid points after each minimisation from valid ones."""
    targets = inverses(reference, mesh.simplices)
    return minimisations_to(points, mesh, free, targets, Reach(start, max_move), threads, False, freedom)


def followed(points: Array, mesh: kernels.Connectivity, reference: Array, free: NDArray[np.bool_]) -> Array:
    """Return the reference with the vertices that are held where they are in the points (n, d).

    A motion of everything as one rigid body is exact but for rounding.
    """
    held = ~free
    turn, moved = _rigid(reference, reference[held], points[held])
    as_one = np.array_equal(moved[held], points[held])
    moved[held] = points[held]
    if as_one or not free.any():
        return moved
    body = _Body(mesh.simplices, reference, free)
    rotations, misfit = np.broadcast_to(turn, body.inverses.shape), np.inf
    for _ in range(TURNS):
        moved[free] += body.relaxation(moved, rotations)
        rotations = body.rotations(moved)
        last, misfit = misfit, body.misfit(moved, rotations)
        if not misfit < (1 - GAIN) * last:
            break
    return moved


def _rigid(points: Array, here: Array, there: Array) -> tuple[Array, Array]:
    """Return a rotation (d, d) and the points (n, d) after the rigid motion that takes (k, d) nearest to (k, d).

    Source: W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta Crystallographica A32
    (1976).
    """
    if np.array_equal(here, there):
        return np.eye(points.shape[1]), points.copy()
    origin, target = here.mean(axis=0), there.mean(axis=0)
    turn = _rotations(np.einsum("ki,kj->ij", there - target, here - origin))
    return turn, (points - origin) @ turn.T + target


def _rotations(matrices: Array) -> Array:
    """Return the rotations (..., d, d) that are nearest to some matrices."""
    left, _, right = np.linalg.svd(matrices)
    left[..., -1] *= np.sign(np.linalg.det(left @ right))[..., None]
    return left @ right


class _Body:
    """The simplices with a free vertex, and how they resist: sum |J - R|^2, R the rotation that each has made.

    Attributes
    ----------
    inverses : (m, d, d) float64
        See `inverses`.
    slopes : (m, d+1, d) float64
        J is the sum over the corners x of the matrices x slope^T.
    matrix : (f, f)
        Half the second derivative by the free vertices, the same for each coordinate.
    """

    def __init__(self, simplices: NDArray[np.int32], reference: Array, free: NDArray[np.bool_]) -> None:
        from scipy.sparse import csr_matrix  # slow to import, and seldom needed

        self.free, self.simplices = free, simplices[free[simplices].any(axis=1)]
        self.inverses = inverses(reference, self.simplices)
        self.slopes = np.concatenate([-self.inverses.sum(axis=1, keepdims=True), self.inverses], axis=1)
        values = self.slopes @ np.swapaxes(self.slopes, 1, 2)
        rows = np.broadcast_to(self.simplices[:, :, None], values.shape)
        columns = np.broadcast_to(self.simplices[:, None, :], values.shape)
        whole = csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=(len(free), len(free)))
        self.matrix = whole[free][:, free]
        self.diagonal = self.matrix.diagonal()[:, None]

    def _jacobians(self, points: Array) -> Array:
        return np.swapaxes(points[self.simplices], 1, 2) @ self.slopes

    def rotations(self, points: Array) -> Array:
        """Return the rotations (m, d, d) that are nearest to what the simplices have made."""
        return _rotations(self._jacobians(points))

    def misfit(self, points: Array, rotations: Array) -> float:
        """Return the sum that the free vertices should make small."""
        return float(((self._jacobians(points) - rotations) ** 2).sum())

    def relaxation(self, points: Array, rotations: Array) -> Array:
        """Return the way (f, d) of the free vertices to where the sum is smallest, for these rotations."""
        shares = self.slopes @ np.swapaxes(rotations - self._jacobians(points), 1, 2)
        corners, n = self.simplices.ravel(), len(points)
        forces = [np.bincount(corners, share, n)[self.free] for share in shares.reshape(len(corners), -1).T]
        return self._solved(np.stack(forces, axis=1))

    def _solved(self, right: Array) -> Array:
        """Solve a system for all coordinates by conjugate gradients, preconditioned by the diagonal."""
        x, residual = np.zeros_like(right), right
        scaled = residual / self.diagonal
        direction, length2 = scaled, float((residual * scaled).sum())
        enough = EXACT * EXACT * length2
        for _ in range(STEPS):
            if not length2 > enough:
                break
            image = self.matrix @ direction
            step = length2 / float((direction * image).sum())
            x, residual = x + step * direction, residual - step * image
            scaled, last = residual / self.diagonal, length2
            length2 = float((residual * scaled).sum())
            direction = scaled + length2 / last * direction
        return x
