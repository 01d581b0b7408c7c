"""One interface for everything that can drive the robot."""

from mute.controllers.controller import Controller
from mute.controllers.learned import LearnedController, load_policy

__all__ = ["Controller", "LearnedController", "load_policy"]
