"""What of sharp edges and volumes is left of surfaces: `python benchmarks/features.py MESH...`.

Each surface among the meshes is untangled by the command, with default options, and its sharp edges before and after
are found by the angles between the normals of elements alone, beside boundaries and edges of more than two elements.
Edges that are sharper than the feature angle by SLACK at least, in one of the two, are told by their largest distance
from those of the other one that are sharper than it without: one way tells what is new, the other what was rounded
off. In mean edge lengths. Then by how many degrees a sharp edge is less bent at most, as the elements beside it have
moved, and by which share of itself the volume of a closed surface has changed. Where elements of the input are inverted
that is said: folds are sharp, too. With --options, others than the default ones.
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from exact_surfaces import Points
from process import MESHFIX
from rich.console import Console
from rich.table import Table
from surface_bodies import Cells
from surface_measures import farthest, samples

from meshfix_cli import MeshfixError, read
from meshfix_cli.mesh.mesh import Mesh

FEATURE_ANGLE, SLACK = 40.0, 10.0  # degrees
APART, GROWN = 1e-3, 1e-3  # mean edge lengths, and shares of volumes, that are told apart
LONGEST = 300  # seconds of a run
PARTS = 4  # of an edge, at the ends of which distances are taken
VALID, INVALID = (0, 3)  # exit codes of the command with an output


@dataclass(frozen=True, eq=False)
class Sides:
    """The sides of elements: their edges (e, 2), of how many sides each is, and how much it is bent.

    Attributes
    ----------
    edges : (e, 2) int64
    count : (e,) int64
    angles : (e,) float64
        Between the normals of the two elements, in degrees; 180 where there are not two.
    volume : float
        Inside, where the surface is closed.
    closed : bool
        Each edge is of two elements, which are numbered alike.
    """

    edges: Cells
    count: Cells
    angles: Points
    volume: float
    closed: bool

    def sharper(self, angle: float) -> Cells:
        """Return the edges (k, 3) that are bent by more than an angle, the second vertex twice."""
        ends = self.edges[self.angles > angle]
        return np.column_stack([ends, ends[:, 1]])


def sides_of(mesh: Mesh) -> Sides:
    """Find the sides of a mesh, by the vertices of its elements and their places alone."""
    start, end, owner, normals, volume = [], [], [], [], 0.0
    points, known = mesh.points - mesh.points[mesh.topology.used].mean(axis=0), 0
    for block in mesh.topology.blocks:
        corners = block.vertices.astype(np.int64)
        turned = np.where(mesh.topology.flipped[block.rows][:, None], corners[:, ::-1], corners)
        here, after = points[turned], points[np.roll(turned, -1, axis=1)]
        normal = np.cross(here, after).sum(axis=1) / 2
        volume += float((normal * here.mean(axis=1)).sum()) / 3
        start.append(turned.ravel())
        end.append(np.roll(turned, -1, axis=1).ravel())
        owner.append(known + np.repeat(np.arange(len(turned)), turned.shape[1]))
        normals.append(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300))
        known += len(turned)
    a, b, which = np.concatenate(start), np.concatenate(end), np.concatenate(owner)
    edges, number, count = np.unique(
        np.sort(np.column_stack([a, b]), axis=1), axis=0, return_inverse=True, return_counts=True
    )
    order = np.argsort(number.ravel(), kind="stable")
    first = (np.cumsum(count) - count)[count == 2]
    one, other = order[first], order[first + 1]
    alike = np.where(a[one] == b[other], 1.0, -1.0)
    unit = np.concatenate(normals)
    m, n = unit[which[one]], unit[which[other]] * alike[:, None]
    angles = np.full(len(edges), 180.0)
    angles[count == 2] = np.degrees(np.arctan2(np.linalg.norm(np.cross(m, n), axis=1), (m * n).sum(axis=1)))
    closed = bool((count == 2).all() and (alike > 0).all())
    return Sides(edges, count, angles, volume, closed)


def off(points: Points, edges: Cells, others: Points, near: Cells) -> float:
    """Return how far edges (k, 3) are from others at most, in model units; infinite where there are no others."""
    if not len(edges):
        return 0.0
    return farthest(samples(points, edges, PARTS), others, near) if len(near) else np.inf


@dataclass(frozen=True)
class Change:
    """What has changed between two surfaces.

    Attributes
    ----------
    new, rounded : float
        How far sharp edges are at most that were not there, and that are there no more, in mean edge lengths.
    blunted : float
        Degrees, by which a sharp edge is less bent at most.
    volume : float or None
        By which share it has grown; None: the surface is not closed.
    """

    new: float
    rounded: float
    blunted: float
    volume: float | None

    @property
    def is_large(self) -> bool:
        """Whether it is more than what is told apart."""
        return max(self.new, self.rounded) > APART or abs(self.volume or 0.0) > GROWN


def change(before: Mesh, after: Mesh, feature_angle: float = FEATURE_ANGLE) -> Change:
    """Compare two surfaces of the same elements."""
    one, other = sides_of(before), sides_of(after)
    h, beyond = before.mean_edge_length(), feature_angle + SLACK
    new = off(after.points, other.sharper(beyond), before.points, one.sharper(feature_angle))
    rounded = off(before.points, one.sharper(beyond), after.points, other.sharper(feature_angle))
    sharp = one.angles > beyond
    blunted = float((one.angles - other.angles)[sharp].max(initial=0.0))
    volume = other.volume / one.volume - 1 if one.closed and one.volume else None
    return Change(new / h, rounded / h, blunted, volume)


def compared(path: Path, options: list[str], folder: Path) -> Iterator[str]:
    """Yield the cells of the row of a mesh, none where it is no surface; the last one names what is wrong."""
    try:
        before = read(path).mesh
    except MeshfixError:
        return
    if before.surface is None:
        return
    target = folder / f"out{path.suffix}"
    words = [*MESHFIX, "untangle", "--quiet", *options, str(path), str(target)]
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=LONGEST, check=False)
    except subprocess.TimeoutExpired:
        yield from (path.name, f"{before.topology.m:,}", "", "", "", "", "", "", "takes too long")
        return
    inverted, count = before.check()[0], f"{before.topology.m:,}"
    if done.returncode not in (VALID, INVALID):
        yield from (path.name, count, f"{inverted}", "", "", "", "", "", done.stderr.strip().split("\n")[-1])
        return
    after = read(target).mesh
    found, left = change(before, after), after.check()[0]
    edges = sides_of(before).sharper(FEATURE_ANGLE + SLACK)
    volume = "-" if found.volume is None else f"{found.volume:+.1e}"
    wrong = "folded" if inverted else "CHANGED" if found.is_large else ""
    yield from (path.name, count, f"{inverted} {left}", f"{len(edges):,}", f"{found.new:.1e}", f"{found.rounded:.1e}")
    yield from (f"{found.blunted:.1f}", volume, wrong)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("meshes", nargs="+", type=Path, metavar="MESH")
    parser.add_argument("--options", default="", help="of meshfix untangle")
    given = parser.parse_args()
    table = Table("file", "elements", "inverted", "sharp", "new", "rounded", "blunted", "volume", "")
    with tempfile.TemporaryDirectory() as name:
        for path in given.meshes:
            for old in Path(name).iterdir():
                old.unlink()
            row = list(compared(path, shlex.split(given.options), Path(name)))
            if row:
                table.add_row(*row)
    Console(width=140, file=sys.stdout).print(table)


if __name__ == "__main__":
    main()
