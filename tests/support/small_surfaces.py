"""Small ones of the bodies that benchmarks have, of a few hundred triangles, and with the same kinds of surfaces."""

from __future__ import annotations

from collections.abc import Callable

import surface_bodies
from surface_bodies import Body, worsened

SMALL: dict[str, Callable[[], Body]] = {
    "ellipsoid": lambda: surface_bodies.ellipsoid(2),
    "torus": lambda: surface_bodies.torus(32, 12),
    "bumps": lambda: surface_bodies.bumps(15, 0.15, (2.0, 1.6)),
    "cylinder": lambda: worsened(surface_bodies.cylinder(0.35), 0.5, 8.0),
    "part": lambda: worsened(surface_bodies.part(0.25), 0.5, 8.0),
}
