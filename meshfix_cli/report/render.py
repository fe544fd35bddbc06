"""The mesh before and after as pyvista draws it, for a notebook. The only importer of pyvista.

Nothing of it is loaded where nobody asks for it.
"""

from __future__ import annotations

import io
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.quality.summary import BIN_WIDTH, BINS, by_element

if TYPE_CHECKING:
    from meshfix_cli.mesh.mesh import Mesh
    from meshfix_cli.report.facts import Report

MOST_DRAWN = 300_000  # elements of a mesh of which a notebook shows a picture without being asked
WINDOW = (1000, 420)  # pixels
RED = "#c2361a"
# From this version on VTK draws on Linux where there is no display; before, it ends the process.
DRAWS_ANYWHERE = (9, 4)


def plotter(report: Report, **options: Any) -> Any:
    """Return a plotter with the first and the last stage of a report, coloured by the quality of the elements.

    Inverted elements are red. Solids are cut open in the middle of their longest side, between elements.

    Parameters
    ----------
    report : Report
    options
        Of `pyvista.Plotter`.

    Raises
    ------
    ImportError
        There is no pyvista.
    """
    try:
        import pyvista
    except ImportError as error:
        raise ImportError("a picture needs pyvista: pip install pyvista") from error

    stages = list(report.meshes)
    shown = dict.fromkeys((stages[0], stages[-1]))
    plot = pyvista.Plotter(shape=(1, len(shown)), **{"window_size": WINDOW, **options})
    behind = _behind(report.mesh)
    for column, stage in enumerate(shown):
        plot.subplot(0, column)
        grid, name = _grid(report.meshes[stage])
        wrong = grid.cell_data["inverted"] > 0
        title = f"{stage}: {int(wrong.sum()):,} inverted"
        rest = grid.extract_cells(np.flatnonzero(behind & ~wrong))
        limits = [0.0, 1.0 if name == "scaled_jacobian" else BIN_WIDTH * BINS[report.mesh.dimension]]
        bar = {"title": name.replace("_", " "), "n_labels": 3}
        if rest.n_cells:
            plot.add_mesh(rest, scalars=name, clim=limits, cmap="viridis", show_edges=True, scalar_bar_args=bar)
        if wrong.any():
            plot.add_mesh(grid.extract_cells(np.flatnonzero(wrong)), color=RED, show_edges=True)
        plot.add_text(title, font_size=10)
        if report.mesh.points.shape[1] == 2:
            plot.view_xy()
    plot.link_views()
    return plot


def png(report: Report) -> bytes | None:
    """Return what a plotter draws as a picture; None: that would take long, or cannot be."""
    try:
        import pyvista
        from vtkmodules.vtkCommonCore import vtkVersion

        version = vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()
        anywhere = sys.platform == "linux" and version >= DRAWS_ANYWHERE
        if report.result.elements > MOST_DRAWN or not (anywhere or pyvista.system_supports_plotting()):
            return None
        with pyvista.vtk_verbosity("off"):  # it tells which ways to draw there are not
            plot, picture = plotter(report, off_screen=True), io.BytesIO()
            plot.screenshot(picture)
            plot.close()
        return picture.getvalue()
    except Exception:  # whatever drivers do: the table is there without it
        return None


def _grid(mesh: Mesh) -> tuple[Any, str]:
    """Return the elements, with their quality, and what that is."""
    import pyvista

    blocks = mesh.topology.blocks
    points = np.column_stack([mesh.points, np.zeros((len(mesh.points), 3 - mesh.points.shape[1]))])
    grid = pyvista.UnstructuredGrid({block.element.vtk: block.vertices for block in blocks}, points)
    order = _order(mesh)
    found = by_element(mesh)
    name = "min_angle" if "min_angle" in found else "scaled_jacobian"
    for one in (name, "inverted"):
        grid.cell_data[one] = found[one][order]
    return grid, name


def _order(mesh: Mesh) -> NDArray[np.integer[Any]]:
    """Return the rows (m,) of the elements in the order of the blocks."""
    return np.concatenate([block.rows for block in mesh.topology.blocks])


def _behind(mesh: Mesh) -> NDArray[np.bool_]:
    """Mark the elements (m,), in the order of the blocks, that are behind the middle of a solid; all others."""
    topology = mesh.topology
    if topology.dimension == 2:
        return np.ones(topology.m, dtype=bool)
    corners = mesh.points[topology.used]
    axis = int(np.argmax(np.ptp(corners, axis=0)))
    middle = (corners[:, axis].min() + corners[:, axis].max()) / 2
    return np.concatenate([mesh.points[block.vertices, axis].mean(axis=1) <= middle for block in topology.blocks])
