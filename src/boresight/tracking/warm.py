"""Load (or compile) the tracker's kernels before they are needed."""

from __future__ import annotations

import numpy as np

from boresight.io.scans import iter_scans
from boresight.tracking.config import TrackerConfig
from boresight.tracking.run import tracker_for
from boresight.tracking.tracker import Tracker
from boresight.types import Component, Recording, Scan, Sensor, SensorKind


def warm(dimensions: int, blobs: bool = False) -> None:
    """Take one look through a tracker of `dimensions`, so that its kernels are compiled and loaded.

    With `blobs` also through one that looks for second targets in a blob, whose kernel is another.
    """
    for share in (0.0, 0.1) if blobs else (0.0,):
        _look(TrackerConfig(blob_share=share), dimensions)


def warm_poses(recording: Recording) -> None:
    """Place the sensors of the first look of each, for the same reason: that is done before the tracker's kernel."""
    tracker, first = tracker_for(recording, TrackerConfig()), dict[int, Scan]()
    for scan in iter_scans(recording):
        first.setdefault(scan.sensor, scan)
    tracker.looks(list(first.values()))


def _look(config: TrackerConfig, dimensions: int) -> None:
    sigma = np.full(7, np.nan)
    sigma[[Component.RANGE, Component.AZIMUTH]] = 1.0, 0.01
    tracker = Tracker(config, (Sensor("warm", SensorKind.RADAR, sigma=sigma),), dimensions)
    state = tracker.init()
    z = np.full((1, 7), np.nan)
    z[0, [Component.RANGE, Component.AZIMUTH]] = 1000.0, 0.0
    R = np.full((1, 7, 7), np.nan)
    R[0, :2, :2] = np.diag([1.0, 1e-4])
    for k in range(2):
        t = float(k)
        state, _ = tracker.step(state, Scan(0, t, t, np.array([t]), z, R, np.array([k])))
