"""Which sensors leave a target's height open, and for how many rows of the tracks nobody has told it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from boresight.kernels.tracker_place import TOP
from boresight.tracking.core import leaves_height_open
from boresight.types import Recording, TrackRows

TOLD = 0.2  # of the prior's standard deviation: a height known no better is not observed


def height_not_observed(
    recording: Recording, tracks: TrackRows, sensors: Sequence[str] | None = None
) -> NDArray[np.bool_]:
    """Return for each row (n,) whether its height is little more than the prior: of a σ above `TOLD` times its own.

    The prior is the widest that the sensors without elevation have, declared (`height_m`) or of all heights at which
    aircraft fly. All False where no sensor in use (ids; all) leaves the height open, and in two dimensions.
    """
    prior = [
        sensor.height[1] if sensor.height is not None else TOP / np.sqrt(12.0)
        for sensor in recording.sensors
        if (sensors is None or sensor.id in sensors) and leaves_height_open(sensor)
    ]
    if recording.dimensions == 2 or not prior:
        return np.zeros(len(tracks.t), np.bool_)
    out: NDArray[np.bool_] = np.sqrt(tracks.covariance[:, 2, 2]) > TOLD * max(prior)
    return out


def told_of_heights(recording: Recording, tracks: TrackRows, sensors: Sequence[str] | None = None) -> list[str]:
    """Return a line for each sensor in use that leaves the height open, and one on the rows where nobody told it."""
    if recording.dimensions == 2:
        return []
    lines = []
    for sensor in recording.sensors:
        if (sensors is None or sensor.id in sensors) and leaves_height_open(sensor):
            told = "anything from the ground to 14 km within its coverage (declare `height_m = [mean, sigma]`)"
            if sensor.height is not None:
                told = f"{sensor.height[0]:g} ± {sensor.height[1]:g} m above the ellipsoid, as declared"
            lines.append(f"{sensor.id}: height not observed (no elevation): taken as {told}")
    if lines and len(tracks.t):
        share = float(height_not_observed(recording, tracks, sensors).mean())
        lines.append(
            f"height not observed in {100.0 * share:.0f} % of the rows: up is the prior's, with its covariance"
        )
    return lines
