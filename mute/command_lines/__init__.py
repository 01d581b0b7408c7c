"""The command lines behind the scripts at the top of the repository."""
