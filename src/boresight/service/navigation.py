"""Where the antenna's platform is and how it is turned: from what of its navigation has arrived."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np

from boresight.frames.array_face import enu_from_face
from boresight.frames.local import ecef_from_enu
from boresight.frames.pose import PoseTrack, pose_track
from boresight.io.jsonlines import Fix
from boresight.pointing.pointer import Place, Pointer
from boresight.types import FloatArray, PlatformTrack

FRD_FROM_RFU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
WINDOW = 2.5  # s of stamps that are kept …
FEWEST = 8  # … at least so many …
MOST = 1000  # … at most so many


def place_at(pointer: Pointer, known: PoseTrack | None, t: float, coast: float) -> Place:
    """Return the antenna's place at the time it aims for, from the platform's stamps up to `t` (s).

    Attitude goes on with its rate until its last stamp is `coast` (s) old; then it is lost: the place turns NaN, so
    that nobody steers a mount by it. Position goes on as long with its velocity, then stays.
    """
    if known is None or not len(known.t):
        here = ecef_from_enu(0.0, 0.0, 0.0, pointer.site)
        return Place(np.array(here), np.full((3, 3), np.nan), np.full((3, 3), np.nan))
    reach = coast + pointer.lead
    aim = min(t + pointer.lead, float(known.t[-1]) + reach)
    lost = not known.has_attitude or t - known.t_attitude[-1] > coast
    if lost:
        known = replace(known, t_attitude=known.t_attitude[:0])
    pose = replace(known, max_extrapolation=reach + 1.0, max_gap=np.inf).at(aim)
    e, n, u = (float(v) for v in pose.position)
    enu_from_rfu = np.full((3, 3), np.nan) if lost else pose.enu_from_body @ FRD_FROM_RFU
    return Place(
        np.array(ecef_from_enu(e, n, u, pointer.site)), enu_from_rfu @ enu_from_face(*pointer.face), enu_from_rfu
    )


class Navigation:
    """The last stamps of one platform, as they come in."""

    def __init__(self, name: str, pointer: Pointer, coast: float) -> None:
        self.name, self.pointer, self.coast = name, pointer, coast
        self.rows: deque[tuple[float, FloatArray]] = deque(maxlen=MOST)
        self._track: PoseTrack | None = None

    def take(self, fix: Fix) -> bool:
        """Keep a stamp of the platform; false, and left out, if it is not later than the last."""
        if self.rows and not fix.t > self.rows[-1][0]:
            return False
        self.rows.append((fix.t, fix.row))
        while len(self.rows) > FEWEST and self.rows[1][0] < fix.t - WINDOW:
            self.rows.popleft()
        self._track = None
        return True

    def track(self) -> PoseTrack | None:
        """Return what is known of the platform; None before its first position."""
        if self._track is None and self.rows:
            t = np.array([r[0] for r in self.rows])
            rows = np.stack([r[1] for r in self.rows])
            if np.isfinite(rows[:, :3]).all(axis=1).any():
                unknown = np.full(len(t), np.nan)
                one = PlatformTrack(self.name, t, rows[:, :3], rows[:, 3:6], rows[:, 6:], unknown, unknown)
                reach = self.coast + self.pointer.lead
                self._track = pose_track(one, self.pointer.site, max_extrapolation=reach)
        return self._track

    def age(self, t: float) -> float:
        """Return how old the last attitude is (s), infinite before the first."""
        known = self.track()
        return t - float(known.t_attitude[-1]) if known is not None and known.has_attitude else np.inf

    def place(self, t: float) -> Place:
        """Return the antenna's place for a command at `t` (s) (`place_at`)."""
        return place_at(self.pointer, self.track(), t, self.coast)
