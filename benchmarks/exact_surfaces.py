"""Surfaces given by formulas: where the closest point is, and which way the normal points there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Surface(Protocol):
    """A smooth surface, with or without a boundary."""

    def project(self, points: Points) -> Points:
        """Return points (k, 3) of the surface beside points (k, 3) near it; the closest ones, but on a graph."""

    def normal(self, points: Points) -> Points:
        """Return the unit normals (k, 3), outwards, at points (k, 3) of the surface."""

    def inside(self, points: Points, margin: float) -> Mask:
        """Mark the points (k,) of the surface that are farther from its boundary than a margin in model units."""


def unit(vectors: Points) -> Points:
    """Return vectors (k, 3) with length 1."""
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


class Closed:
    """A surface that has no boundary."""

    def inside(self, points: Points, margin: float) -> Mask:
        """Mark all."""
        return np.ones(len(points), dtype=bool)


@dataclass(frozen=True)
class Ellipsoid(Closed):
    """Around the origin, with three half axes."""

    axes: tuple[float, float, float]

    def project(self, points: Points) -> Points:
        """Return the points p a²/(a² + t) with the root t of the equation of the surface, by Newton's method.

        The left side falls and is convex where t is larger than the negative of the smallest a²: from the left of the
        root the steps do not pass it, and from the right the first one lands at its left.
        """
        squares = np.square(self.axes)
        t = np.zeros((len(points), 1))
        for _ in range(60):
            scaled = np.square(points) * squares / (squares + t) ** 2
            value = scaled.sum(axis=1, keepdims=True) - 1
            slope = -2 * (scaled / (squares + t)).sum(axis=1, keepdims=True)
            t = np.maximum(t - value / slope, -0.999 * squares.min())
        return points * squares / (squares + t)

    def normal(self, points: Points) -> Points:
        """Return the gradient."""
        return unit(points / np.square(self.axes))


@dataclass(frozen=True)
class Torus(Closed):
    """Around the z axis, with a ring of radius 1."""

    tube: float

    def project(self, points: Points) -> Points:
        """Go from the ring towards the point."""
        ring = self._ring(points)
        return ring + self.tube * unit(points - ring)

    def normal(self, points: Points) -> Points:
        """Point away from the ring."""
        return unit(points - self._ring(points))

    def _ring(self, points: Points) -> Points:
        return unit(points * (1.0, 1.0, 0.0))


@dataclass(frozen=True)
class Bumps:
    """The graph of a product of two waves over the unit square."""

    height: float
    waves: tuple[float, float]

    def over(self, plane: Points) -> Points:
        """Return the points (k, 3) over points (k, 2 or more) of the plane."""
        x, y = np.sin(plane[:, :2] * self._turns).T
        return np.column_stack([plane[:, :2], self.height * x * y])

    def project(self, points: Points) -> Points:
        """Return the points above or below: on the surface, and nearly the closest where it is nearly flat."""
        return self.over(points)

    def normal(self, points: Points) -> Points:
        """Return the upper side."""
        angles = points[:, :2] * self._turns
        slopes = self.height * self._turns * np.cos(angles) * np.sin(angles[:, ::-1])
        return unit(np.column_stack([-slopes, np.ones(len(points))]))

    def inside(self, points: Points, margin: float) -> Mask:
        """Look at the square alone."""
        return np.abs(points[:, :2] - 0.5).max(axis=1) < 0.5 - margin

    @property
    def _turns(self) -> Points:
        return np.pi * np.asarray(self.waves)


@dataclass(frozen=True)
class Piece:
    """A line in the plane, or an arc of a circle where there is a centre; what it bounds lies at its left."""

    start: tuple[float, float]
    end: tuple[float, float]
    centre: tuple[float, float] | None = None
    turn: float = 0.0  # radians, of an arc; positive: anticlockwise

    @property
    def length(self) -> float:
        """In model units."""
        if self.centre is None:
            return float(np.hypot(*np.subtract(self.end, self.start)))
        return float(abs(self.turn) * np.hypot(*np.subtract(self.start, self.centre)))

    def at(self, share: Points) -> tuple[Points, Points]:
        """Return points and unit normals (k, 2), to the right, at shares (k,) of the length."""
        start, end = np.asarray(self.start), np.asarray(self.end)
        if self.centre is None:
            along = (end - start) / self.length
            return start + np.outer(share, end - start), np.tile([along[1], -along[0]], (len(share), 1))
        arm = start - self.centre
        c, s = np.cos(share * self.turn)[:, None], np.sin(share * self.turn)[:, None]
        arms = c * arm + s * np.array([-arm[1], arm[0]])
        return self.centre + arms, np.sign(self.turn) * arms / np.hypot(*arm)

    def closest(self, points: Points) -> Points:
        """Return the shares (k,) of the length, from 0 to 1, that are closest to points (k, 2)."""
        start = np.asarray(self.start)
        if self.centre is None:
            edge = np.asarray(self.end) - start
            return np.clip((points - start) @ edge / (edge @ edge), 0.0, 1.0)
        arm, arms = start - self.centre, points - self.centre
        angle = np.arctan2(arm[0] * arms[:, 1] - arm[1] * arms[:, 0], arms @ arm) * np.sign(self.turn)
        over = abs(self.turn) + (2 * np.pi - abs(self.turn)) / 2  # beyond it, the start is closer than the end
        angle = np.where(angle < over - 2 * np.pi, angle + 2 * np.pi, angle)
        return np.clip(angle / abs(self.turn), 0.0, 1.0)


def circle(x: float, y: float, radius: float, turn: float = 2 * np.pi) -> tuple[Piece, ...]:
    """Return a whole circle, anticlockwise where the turn is positive."""
    start = (x + radius, y)
    return (Piece(start, start, (x, y), turn),)


@dataclass(frozen=True)
class Wall:
    """What a smooth chain of pieces sweeps from z = 0 to a height."""

    chain: Sequence[Piece]
    height: float

    @cached_property
    def _starts(self) -> Points:
        return np.cumsum([0.0, *(piece.length for piece in self.chain)])

    @property
    def length(self) -> float:
        """Of the chain, in model units."""
        return float(self._starts[-1])

    @property
    def closed(self) -> bool:
        """Whether the chain ends where it starts."""
        return bool(np.allclose(self.chain[0].start, self.chain[-1].end))

    def along(self, s: Points) -> tuple[Points, Points]:
        """Return points and unit normals (k, 2) at distances (k,) along the chain."""
        which = np.clip(np.searchsorted(self._starts, s, side="right") - 1, 0, len(self.chain) - 1)
        points, normals = np.empty((len(s), 2)), np.empty((len(s), 2))
        for number, piece in enumerate(self.chain):
            here = which == number
            points[here], normals[here] = piece.at((s[here] - self._starts[number]) / piece.length)
        return points, normals

    def where(self, points: Points) -> Points:
        """Return the distances (k,) along the chain closest to points (k, 2 or more)."""
        shares = np.array([piece.closest(points[:, :2]) for piece in self.chain])
        found = np.array([piece.at(share)[0] for piece, share in zip(self.chain, shares, strict=True)])
        nearest = np.linalg.norm(found - points[:, :2], axis=2).argmin(axis=0)
        lengths = np.array([piece.length for piece in self.chain])
        return self._starts[nearest] + shares[nearest, np.arange(len(points))] * lengths[nearest]

    def swept(self, flat: Points) -> Points:
        """Return the points (k, 3) at distances along the chain and heights (k, 2)."""
        return np.column_stack([self.along(flat[:, 0])[0], flat[:, 1]])

    def project(self, points: Points) -> Points:
        """Keep the height, and go to the chain."""
        return self.swept(np.column_stack([self.where(points), points[:, 2]]))

    def normal(self, points: Points) -> Points:
        """Return the side at the right of the chain."""
        return np.column_stack([self.along(self.where(points))[1], np.zeros(len(points))])

    def inside(self, points: Points, margin: float) -> Mask:
        """Look at the heights and, where the chain has ends, at the distances from these."""
        inside = np.abs(points[:, 2] - self.height / 2) < self.height / 2 - margin
        if not self.closed:
            inside &= np.abs(self.where(points) - self.length / 2) < self.length / 2 - margin
        return inside


@dataclass(frozen=True)
class Lid:
    """A region of a plane of constant z that walls bound."""

    walls: Sequence[Wall]
    z: float
    up: float  # 1 or -1: where its normal points

    def project(self, points: Points) -> Points:
        """Change z alone."""
        return np.column_stack([points[:, :2], np.full(len(points), self.z)])

    def normal(self, points: Points) -> Points:
        """Return one and the same."""
        return np.tile([0.0, 0.0, self.up], (len(points), 1))

    def inside(self, points: Points, margin: float) -> Mask:
        """Ask the closest wall which side it is, and how far away."""
        distances, sides = [], []
        for wall in self.walls:
            closest, normals = wall.along(wall.where(points))
            apart = points[:, :2] - closest
            distances.append(np.linalg.norm(apart, axis=1))
            sides.append((apart * normals).sum(axis=1))
        nearest = np.argmin(distances, axis=0), np.arange(len(points))
        return (np.asarray(sides)[nearest] < 0) & (np.asarray(distances)[nearest] > margin)
