"""How good a mesh is, and what keeps it from being better."""
