"""What is said of vertices that do not slide."""

from __future__ import annotations

import meshio
import numpy as np

from meshfix_cli import untangle


def disc_with_a_spike(height: float) -> meshio.Mesh:
    """Triangles from the middle of a disc to its rim, and one upon a side of that, by its height."""
    angle = 2 * np.pi * np.arange(16) / 16
    rim = np.column_stack([np.cos(angle), np.sin(angle)])
    middle = (rim[0] + rim[1]) / 2
    points = np.vstack([rim, [[0.0, 0.0]], middle * (1 + height)])
    cells = [*((16, i, (i + 1) % 16) for i in range(16)), (1, 0, 17)]
    return meshio.Mesh(np.column_stack([points, np.zeros(len(points))]), [("triangle", np.array(cells))])


def test_elements_left_at_edges_of_the_shape_are_told() -> None:
    result = untangle(disc_with_a_spike(-0.3), slide="curved")
    assert (result.report.facts or {})["sliding"]["curves"] > 10
    assert result.summary.inverted == 1
    (note,) = [note for note in result.report.notes if "--feature-angle" in note]
    assert note.startswith("1 element that remains inverted is at edges or corners of the shape")
    assert note.endswith("with a larger --feature-angle than 40 there are fewer of these")
    assert result.report.obstacles.inverted.tolist() == [16]


def test_nothing_is_told_where_nothing_is_left() -> None:
    result = untangle(disc_with_a_spike(0.3), slide="curved")
    assert result.valid
    assert not [note for note in result.report.notes if "slide" in note]
