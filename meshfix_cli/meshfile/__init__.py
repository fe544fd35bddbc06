"""From files to meshes and back: `reading` and `writing`, what both share, and one file or folder for each format."""
