"""rsl_rl's runner and PPO with the estimator in their loop; ranks, logs and displays."""
