"""rsl_rl's runner and PPO with the estimator in their loop; ranks, logs and displays."""

from mute.support.quiet_git import import_git

import_git()  # before rsl_rl does, which needs no git program either
