# mypy: ignore-errors
"""What somebody who has read the first page would write in a notebook, from top to bottom; no line may surprise."""

import meshio
import numpy as np
import pyvista as pv

from meshfix_cli import Mesh, Repairer, perturb, quality, untangle

rng = np.random.default_rng(0)


def tangled(points, inside, scale):
    """Move the points inside at random."""
    points = np.array(points)
    points[inside] += rng.normal(scale=scale, size=(inside.sum(), points.shape[1]))
    return points


def within(points, low, high):
    """Mark the points that are on no side of a box."""
    return ((points > np.add(low, 1e-6)) & (points < np.subtract(high, 1e-6))).all(axis=1)


# %% numpy: triangles in the plane, in two columns or in three
x, y = (axis.ravel() for axis in np.meshgrid(np.arange(9.0), np.arange(7.0), indexing="ij"))
corner = (np.arange(8)[:, None] * 7 + np.arange(6)).ravel()
quads = np.column_stack([corner, corner + 7, corner + 8, corner + 1])
triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
flat = tangled(np.column_stack([x, y]), within(np.column_stack([x, y]), 0, [8, 6]), 0.6)
kept = flat.copy()
result = untangle((flat, triangles))
points, cells = result.mesh
assert quality((flat, triangles)).inverted > 0 and result.valid and quality(result.mesh).inverted == 0
assert (flat == kept).all() and cells is triangles and points.shape == flat.shape
spatial = np.column_stack([flat, np.zeros(len(flat))])
assert untangle((spatial, triangles)).valid and (untangle((spatial, triangles)).points[:, 2] == 0).all()
assert untangle((flat, quads)).valid and untangle((spatial, {"quad": quads})).valid
assert untangle((flat.tolist(), triangles.tolist())).valid
assert untangle((flat.astype("f4"), triangles)).points.dtype == np.float32

# %% numpy: hold some points, by their numbers or by a mask
some = np.flatnonzero(within(flat, 0, [8, 6]))[:2]
grid = np.column_stack([x, y])
for fixed in (some, list(some), np.isin(np.arange(len(grid)), some)):
    moved = perturb((grid, triangles), 50, "h", fixed=fixed).points
    assert (moved[some] == grid[some]).all() and (
        untangle((moved, triangles), fixed=fixed).points[some] == grid[some]
    ).all()
mesh = Mesh.build(grid, {"triangle": triangles}, fixed=some)
assert not mesh.movable[some].any()

# %% PyVista: hexahedra of a structured grid, and the same as voxels and as cells of any kind
axis = np.linspace(0, 1, 7)
structured = pv.StructuredGrid(*np.meshgrid(axis, axis, axis, indexing="ij"))
structured["temperature"] = np.arange(structured.n_points)
structured.cell_data["number"] = np.arange(structured.n_cells)
structured.points = tangled(structured.points, within(structured.points, 0, 1), 0.1)
for given in (structured, structured.cast_to_unstructured_grid()):
    before = given.copy()
    result = untangle(given)
    after = result.mesh
    assert type(after) is type(given) and given == before and result.valid and quality(given).inverted > 0
    assert (after["temperature"] == given["temperature"]).all() and (after["number"] == given["number"]).all()
    assert after.n_cells == given.n_cells and tuple(after.bounds) == (0, 1, 0, 1, 0, 1)
    assert after.compute_cell_sizes()["Volume"].min() > 0
voxels = pv.ImageData(dimensions=(6, 6, 6)).cast_to_unstructured_grid()
voxels.points = tangled(voxels.points, within(voxels.points, 0, 5), 0.5)
assert untangle(voxels).valid and untangle((voxels.points, voxels.cells_dict)).valid

# %% PyVista: surfaces, flat and curved, and tetrahedra
plane = pv.Plane(i_resolution=12, j_resolution=12).triangulate()
plane.points = tangled(plane.points, within(plane.points[:, :2], -0.5, 0.5), [0.06, 0.06, 0])
assert quality(plane).inverted > 0 and untangle(plane).valid and isinstance(untangle(plane).mesh, pv.PolyData)
sphere = pv.Icosphere(radius=2, nsub=3)
result = perturb(sphere, 20, "h")
assert result.mesh.n_points == sphere.n_points
tets = voxels.triangulate()
assert set(tets.celltypes) == {pv.CellType.TETRA}
assert untangle(tets).valid and untangle(tets, smooth="best", require="min_angle > 5").met

# %% meshio: tetrahedra and hexahedra, with data and sets
blocks = {"tetra": tets.cells_dict[pv.CellType.TETRA]}
mesh = meshio.Mesh(np.array(tets.points), blocks, {"T": np.arange(tets.n_points)},
                   {"number": [np.arange(tets.n_cells)]}, point_sets={"wall": np.arange(9)})  # fmt: skip
before = mesh.points.copy()
result = untangle(mesh, fix="wall")
assert result.valid and isinstance(result.mesh, meshio.Mesh) and (mesh.points == before).all()
assert (result.mesh.point_data["T"] == mesh.point_data["T"]).all() and list(result.mesh.point_sets) == ["wall"]
assert (result.mesh.cell_data["number"][0] == np.arange(tets.n_cells)).all()
assert untangle((mesh.points, mesh.cells)).valid
print(result)

# %% a mesh that moves: repaired at each step of a loop
valid = meshio.Mesh(result.points, mesh.cells)
repair = Repairer(valid, towards=True)
for step in range(3):
    points = repair(valid.points + np.array([0.1 * step, 0, 0]))
    assert repair.outcome.valid and isinstance(points, np.ndarray)
