"""Curved elements by their shapes: the smallest scaled Jacobians are raised, step by step.

The energy of coefficients compares those of an element with its size. Where that is what the edges span at the node of
the smallest scaled Jacobian, the smallest coefficient is about this Jacobian, and rises with it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from meshfix_cli.mesh.judged import VALID

if TYPE_CHECKING:
    from meshfix_cli.mesh.quadratic import Array, Judgement, Mask, Quadratic
    from meshfix_cli.solve.limits import Limits

REACHED = 0.25  # share of a gain that is enough
ITERATIONS, SHRINK = 60, 0.3  # of a minimisation, and of eps from one to the next
KEPT = 0.2  # relative to the straight element: down to there coefficients may fall


class _Effort(NamedTuple):
    """How much is tried.

    Attributes
    ----------
    patience : int
        How often elements that do not rise are left out, and others raised; 1: these are the last.
    gains : tuple of float
        By which the smallest is to rise, of itself: each for as long as it does.
    rings : tuple of int
        Around what is below.
    minimisations : int
        In one region.
    """

    patience: int
    gains: tuple[float, ...]
    rings: tuple[int, ...]
    minimisations: int


THOROUGH, QUICK = _Effort(5, (0.5, 0.1, 0.03), (1, 3), 6), _Effort(1, (0.5,), (1,), 2)


class _Seen(NamedTuple):
    points: Array
    judged: Judgement


def better_shapes(
    mesh: Quadratic, points: Array, limits: Limits, nodes: Mask, highest: float, *, thorough: bool
) -> Iterator[Array]:
    """Yield points (n, d) of which each have a larger smallest scaled Jacobian than those before.

    Parameters
    ----------
    mesh : Quadratic
    points : (n, d) float64
        Where no element is invalid.
    limits : Limits
    nodes : (n,) bool
        Whose elements are looked at.
    highest : float
        The scaled Jacobian from which on an element is well.
    thorough : bool
        Go on with small gains, in larger regions, and with other elements where some do not rise.
    """
    now, left = _Seen(points, mesh.judge(points, limits.threads)), mesh.with_one(nodes)
    effort = THOROUGH if thorough else QUICK

    def below(gain: float) -> Mask:
        jacobians = now.judged.scaled_jacobians
        return left & (jacobians < min((1 + gain) * jacobians[left].min(initial=highest), highest))

    for _ in range(effort.patience):
        for gain in effort.gains:
            while (low := below(gain)).any() and (found := _raised(mesh, now, limits, low, gain, effort)):
                now = found
                yield now.points
        if not low.any():
            return
        left = left & ~low


def _raised(mesh: Quadratic, now: _Seen, limits: Limits, low: Mask, gain: float, effort: _Effort) -> _Seen | None:
    """Return points where the worst of some elements are better, and no other becomes as bad, if they are found."""
    jacobians, sizes = now.judged.scaled_jacobians, mesh.kernel.sizes(now.points, limits.threads)
    worst = float(jacobians[low].min())
    rise = gain * worst
    sizes = np.maximum(now.judged.smallest / np.maximum(jacobians, worst), KEPT) * sizes
    for rings in effort.rings:
        region = limits.free & mesh.near(low, rings)
        energy = limits.energy(mesh, now.points, now.points, sizes, region)
        eps, best = worst + rise, -1.0
        for _ in range(effort.minimisations):
            energy.minimise(eps, worst + rise, ITERATIONS)
            points = energy.points(now.points.shape[1])
            found = _Seen(points, mesh.judge(points, limits.threads))
            if _is_better(now.judged, found.judged, low, worst + REACHED * rise):
                return found
            smallest = float(found.judged.scaled_jacobians[low].min())
            if smallest <= best:
                break
            eps, best = eps * SHRINK, smallest
    return None


def _is_better(before: Judgement, after: Judgement, low: Mask, least: float) -> bool:
    """Whether some elements are well enough, all are valid, and what has changed for the worse is still well enough."""
    jacobians, coefficients = after.scaled_jacobians, after.smallest
    worse, flatter = jacobians < before.scaled_jacobians, coefficients < before.smallest
    valid = (after.verdicts == VALID).all() and (coefficients[flatter] >= KEPT).all()
    return bool(valid and (jacobians[low | worse] >= least).all())
