"""How a mesh is untangled and smoothed, or tangled."""
