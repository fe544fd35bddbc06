"""What a mesh is: its elements, its topology, its points."""
