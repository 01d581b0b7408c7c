"""MUTE: quiet quadruped locomotion with a knob; the method and the tools around it.

Importing the package imports nothing else, so that `mute.threads` can act before torch is loaded.
"""

__version__ = "0.1.0"
