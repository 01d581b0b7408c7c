"""The long walk over floors of several kinds: its course, the way along it, and its map."""
