"""Files of VTK: legacy .vtk, and .vtu and .pvtu in XML, which share their cells and arrays."""
