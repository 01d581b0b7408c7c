"""How loud a sound is: weighting, detector, readings, for robots and recordings alike.

`wav_levels` measures recordings in files, and `calibrator` finds what their full scale is in Pa;
all else knows neither files nor robots.
"""
