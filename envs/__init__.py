"""The quadruped and its world: simulation, scene, observations and rewards, without learning."""
