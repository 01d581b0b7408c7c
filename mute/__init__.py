"""MUTE: quiet quadruped locomotion with a knob; the method and the tools around it.

Importing the package imports no torch, so that `mute.support.threads` can act before it is loaded.
"""

__version__ = "0.1.0"
