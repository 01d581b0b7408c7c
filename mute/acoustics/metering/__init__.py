"""How loud a sound is: weighting, detector, readings, spectrum, for robots and recordings alike.

`recordings` measures files, with `spans` and `wav_levels`; `calibrator` finds what their full scale
is in Pa. All else knows neither files nor robots.
"""
