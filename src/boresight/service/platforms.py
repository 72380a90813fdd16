"""Live navigation of platforms as the tracker takes poses: the stamps of the last while, as they came in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from boresight.frames.pose import PoseTrack, pose_track
from boresight.io.jsonlines import Fix
from boresight.io.logged import platform_track
from boresight.tracking.run import NAVIGATION_AHEAD, NAVIGATION_GAP
from boresight.types import Site

FEWEST = 16  # stamps that are kept however old they are


class LivePoses(Mapping[str, PoseTrack]):
    """Pose tracks by platform, of the stamps of the last `kept` (s) before the newest.

    `sigmas` are the declared errors of one stamp by platform: position (m), attitude (rad); NaN where none is.
    """

    def __init__(self, site: Site, kept: float, sigmas: Mapping[str, tuple[float, float]]) -> None:
        self.site, self.kept, self.sigmas = site, kept, sigmas
        self.fixes: dict[str, list[Fix]] = {}
        self._tracks: dict[str, PoseTrack | None] = {}

    def take(self, fix: Fix) -> None:
        """Keep a stamp; they come with ascending times."""
        rows = self.fixes.setdefault(fix.platform, [])
        rows.append(fix)
        if len(rows) > 2 * FEWEST and rows[len(rows) // 2].t < fix.t - self.kept:
            del rows[: len(rows) // 2 - FEWEST // 2]
        self._tracks[fix.platform] = None

    def __getitem__(self, name: str) -> PoseTrack:
        track = self._tracks[name]
        if track is None:
            rows = self.fixes[name]
            values = np.stack([r.row for r in rows])
            if not np.isfinite(values[:, :3]).all(axis=1).any():
                raise KeyError(name)
            one = platform_track(name, rows, self.sigmas.get(name))
            track = pose_track(one, self.site, max_extrapolation=NAVIGATION_AHEAD, max_gap=NAVIGATION_GAP)
            self._tracks[name] = track
        return track

    def __iter__(self) -> Iterator[str]:
        return iter(self.fixes)

    def __len__(self) -> int:
        return len(self.fixes)

    def saved(self) -> dict[str, Any]:
        """Return plain values from which `restore` goes on."""
        return {
            name: [[f.t, f.t_recv, f.sigma_position, f.sigma_attitude, *f.row.tolist()] for f in rows]
            for name, rows in self.fixes.items()
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Take up what `saved` gave."""
        for name, rows in saved.items():
            self.fixes[name] = [Fix(name, r[0], r[1], np.array(r[4:], dtype=np.float64), r[2], r[3]) for r in rows]
            self._tracks[name] = None
