"""How loud a robot walks: a simulated microphone, and a sound level meter for any recording."""
