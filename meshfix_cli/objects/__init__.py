"""Meshes of other libraries in, and meshes of the same kind out."""
