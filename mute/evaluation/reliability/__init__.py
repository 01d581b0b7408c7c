"""Whether one can rely on a walk: it starts, follows, stands in silence, and beta acts."""
