"""Pictures of a walk: off-screen video, and a window to watch and steer in."""
