"""A walk to watch and to steer, in a window at the speed of real time."""
