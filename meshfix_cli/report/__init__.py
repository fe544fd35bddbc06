"""What is said about a mesh, on a terminal, as JSON, as a page and as pictures."""
