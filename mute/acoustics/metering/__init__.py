"""How loud a sound is: weighting, detector, readings, for robots and recordings alike."""
