"""The paper's comparison of methods, made anew in simulation."""
