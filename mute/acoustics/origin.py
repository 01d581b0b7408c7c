"""Where modelled levels come from: the policy, the calibration, the commit and the machine."""

from __future__ import annotations

from pathlib import Path

from mute.acoustics.body import CALIBRATION_FILE
from mute.support.provenance import current_commit, file_sha256, machine_kind, place_of

__all__ = ["policy_origin", "sound_origin"]


def sound_origin(policy: Path | None = None) -> dict[str, str]:
    """Return what modelled levels rest on, as plain data: policy, calibration, commit and machine.

    Ask before measuring: a file may be replaced while that runs.

    Args:
        policy: File of the policy, None where there is none, of which nothing is returned then.

    Raises:
        MuteError: If the policy or the calibration cannot be read.
    """
    known = {} if policy is None else policy_origin(policy)
    return known | {
        "calibration_sha256": file_sha256(CALIBRATION_FILE),
        "commit": current_commit(),
        "machine": machine_kind(),
    }


def policy_origin(policy: Path) -> dict[str, str]:
    """Return which file a policy is, and its digest.

    Raises:
        MuteError: If it cannot be read.
    """
    return {"policy": place_of(policy), "policy_sha256": file_sha256(policy)}
