"""Curved elements by their shapes: the smallest scaled Jacobians are raised, step by step.

To the energy of coefficients comes one of the scaled Jacobians at the nodes, with a floor a little above the smallest.
"""

from __future__ import annotations

import math
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
NEARLY = 1 - 1e-9  # of what held nodes let an element be, where rounding has a part in it
WELL = 0.98  # a scaled Jacobian from which on none is raised
LEAST = 0.5  # share of that to which those that are lower are to rise
TINY = 0.1  # a scaled Jacobian below which a gain is a share of this
LEAST_EPS = 0.05  # that a region begins with; otherwise what is aimed at


class _Effort(NamedTuple):
    """How much is tried.

    Attributes
    ----------
    gains : tuple of float
        By which the smallest is to rise, of itself: each for as long as it does.
    rings : tuple of int
        Around what is below.
    minimisations : int
        In one region.
    """

    gains: tuple[float, ...]
    rings: tuple[int, ...]
    minimisations: int


QUICK, THOROUGH = _Effort((0.5, 0.1), (1,), 2), _Effort((0.2, 0.03), (1, 2), 3)
TURNS = 5  # of the latter: after each, elements that do not rise are left out, and others raised


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
        Go on with small gains, in larger regions, and with other elements where some do not rise or are held low.
    """
    now, left = _Seen(points, mesh.judge(points, limits.threads)), mesh.with_one(nodes)
    held = NEARLY * mesh.kernel.ceilings(points, limits.free.astype(np.uint8), limits.threads)
    highest = min(highest, WELL)

    def below(gain: float) -> Mask:
        jacobians = now.judged.scaled_jacobians
        some = left & (jacobians < held)
        worst = float(jacobians[some].min(initial=highest))
        if not thorough and NEARLY * jacobians[left & ~some].min(initial=math.inf) <= worst:
            return np.zeros_like(some)  # held nodes keep the worst where it is
        return some & (jacobians < min(_aim(worst, gain), highest))

    for effort in (QUICK, *(THOROUGH,) * TURNS) if thorough else (QUICK,):
        for gain in effort.gains:
            while (low := below(gain)).any() and (found := _raised(mesh, now, limits, low, held, gain, effort)):
                now = found
                yield now.points
        if not low.any():
            return
        if effort is THOROUGH:
            left = left & ~low


def _raised(
    mesh: Quadratic, now: _Seen, limits: Limits, low: Mask, held: Array, gain: float, effort: _Effort
) -> _Seen | None:
    """Return points where the worst of some elements are better, and no other becomes as bad, if they are found.

    That is as high as they are asked to rise, or as held nodes let them (m,).
    """
    worst = float(now.judged.scaled_jacobians[low].min())
    rise = _aim(worst, gain) - worst
    least = np.minimum(worst + REACHED * rise, held)
    sizes = mesh.kernel.sizes(now.points, limits.threads) * np.clip(now.judged.smallest / KEPT, LEAST, 1.0)
    for rings in effort.rings:
        region = limits.free & mesh.near(low, rings)
        energy = limits.energy(mesh, now.points, now.points, sizes, region)
        eps, best = max(worst + rise, LEAST_EPS), -1.0
        for _ in range(effort.minimisations):
            energy.minimise(eps, worst + rise, ITERATIONS, KEPT)
            points = energy.points(now.points.shape[1])
            found = _Seen(points, mesh.judge_again(now.judged, region, points, limits.threads))
            if _is_better(now.judged, found.judged, low, least):
                return found
            smallest = float(found.judged.scaled_jacobians[low].min())
            if smallest <= best:
                break
            eps, best = eps * SHRINK, smallest
    return None


def _aim(worst: float, gain: float) -> float:
    """Return how far the worst are to rise, at most half of what they can."""
    return min(worst + gain * max(worst, TINY), (1 + worst) / 2)


def _is_better(before: Judgement, after: Judgement, low: Mask, least: Array) -> bool:
    """Whether some elements are well enough, all are valid, and what has changed for the worse is still well enough."""
    jacobians, coefficients = after.scaled_jacobians, after.smallest
    worse, flatter = jacobians < before.scaled_jacobians, coefficients < before.smallest
    valid = (after.verdicts == VALID).all() and (coefficients[flatter] >= KEPT).all()
    return bool(valid and (jacobians >= least)[low | worse].all())
