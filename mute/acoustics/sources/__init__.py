"""What sounds of a robot: landings, scuffing, drives and the fan."""
