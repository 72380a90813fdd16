"""Load (or compile) the tracker's kernels before they are needed."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from boresight.tracking.cache import seldom_collected
from boresight.tracking.config import TrackerConfig
from boresight.tracking.tracker import Tracker
from boresight.types import Component, Scan, Sensor, SensorKind


def warm(dimensions: int, blob_shares: tuple[float, ...] = (0.0,)) -> None:
    """Do what `warm_tracker` does for trackers of `dimensions` with default settings but for `blob_share`."""
    sigma = np.full(7, np.nan)
    sigma[[Component.RANGE, Component.AZIMUTH]] = 1.0, 0.01
    radar = Sensor("warm", SensorKind.RADAR, sigma=sigma)
    with seldom_collected():
        for share in blob_shares:
            warm_tracker(Tracker(TrackerConfig(blob_share=share), (radar,), dimensions))


def warm_tracker(tracker: Tracker) -> None:
    """Let a moment pass for a tracker without tracks: its settings say which of the kernels is its own."""
    tracker.tick(tracker.init(), 0.0)


def warm_poses(tracker: Tracker, scans: Iterable[Scan]) -> None:
    """Place the sensors of the first look of each, which is done before the tracker's kernel, by others."""
    first: dict[int, Scan] = {}
    for scan in scans:
        first.setdefault(scan.sensor, scan)
    if first:
        tracker.looks(list(first.values()))
