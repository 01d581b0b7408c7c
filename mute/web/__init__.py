"""What the page in `web/` takes from Python: the scene, the policy, the floors, reference walks."""
