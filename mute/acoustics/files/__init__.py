"""Sound in files, read and written in blocks."""
