"""What `peer_program` steps and trains, a module for each peer.

Only `mute_itself` and `gymnasium_go1` run in MUTE's own environment and import MUTE. The others run
in environments that `benchmarks.make_peers` makes, which do not have it: they import their own
package, numpy and this one.
"""
