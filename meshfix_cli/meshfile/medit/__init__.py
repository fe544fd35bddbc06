"""MEDIT's files, .mesh in text and .meshb in binary."""
