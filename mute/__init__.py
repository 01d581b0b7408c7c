"""MUTE: quiet quadruped locomotion with a knob; the method and the tools around it.

Importing the package registers `MUTE/Go1-v0` with Gymnasium. It imports no torch, so that
`mute.support.threads` can act before it is loaded.
"""

import gymnasium

__version__ = "0.1.0"

_ID = "MUTE/Go1-v0"

if _ID not in gymnasium.registry:  # as it is where the package is loaded once more
    gymnasium.register(
        id=_ID,
        entry_point="mute.envs.gym:Go1Env",
        vector_entry_point="mute.envs.gym:Go1VectorEnv",
    )
