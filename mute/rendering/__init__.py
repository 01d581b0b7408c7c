"""Pictures of a walk: which OpenGL works here, films, and the sound that goes into them."""
