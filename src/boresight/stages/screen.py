"""Screening as a stage: each report against the history it would continue."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from boresight.screen.hampel import HampelScreen
from boresight.screen.plausible import PlausibilityScreen
from boresight.screen.prediction import PredictionScreen, Verdict
from boresight.stages.follow import distances, pair
from boresight.stages.protocol import Belief, Note, Stepped
from boresight.stages.scene import Scene, local, spread
from boresight.types import Fate, FloatArray, Scan

PASS = (Verdict.GOOD, Verdict.UNTESTED, Verdict.REOPENED)
REASON = {
    Verdict.JUMP: "jump: off what its source's last reports predict",
    Verdict.STALE: "stale: older than its source's last report",
    Verdict.DUPLICATE: "duplicate: its source has a report of this time",
    Verdict.OUT_OF_RANGE: "out_of_range: nearer or farther than a target can be",
    Verdict.OUT_OF_ELEVATION: "out_of_elevation: lower or higher than a target can be",
    Verdict.TOO_FAST: "too_fast: no target gets there in that time",
}
ESTABLISHED = 3  # reports after which a history may call a report a jump


@dataclass(slots=True, eq=False)
class History:
    """The reports of one object as one sensor sees it."""

    t: float
    xyz: FloatArray  # (3,) the last one let through
    state: Any  # of the screen
    passed: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class ScreenStage:
    """Judge every report of `sensors` with `screen`, per sensor and object, before anything is averaged.

    A sensor may see several objects. Each history takes the nearest report within reach (`speed` m/s, `rate` rad/s
    and `gate` standard deviations since its last one). A report that none takes is judged by the nearest established
    history that is left, whose report it would be; where none is left it begins a history, and passes. So a report
    can only be a jump in place of one that is missing, and a new object is at most held up until the screen re-opens.
    Reports that are out of order in time are not judged: the tracker knows what to do with them.
    """

    scene: Scene
    screen: PredictionScreen | HampelScreen | PlausibilityScreen
    sensors: frozenset[int]
    speed: float
    rate: float
    gate: float = 4.0
    memory: float = 12.0

    def init(self) -> dict[int, list[History]]:
        """Return the state before the first look: no history of any sensor."""
        return {}

    def step(self, state: dict[int, list[History]], scan: Scan, belief: Belief) -> tuple[Any, Stepped]:
        """Judge a look's reports; the look goes on without those rejected."""
        if scan.sensor not in self.sensors or len(scan.t) == 0:
            return state, Stepped((scan,))
        points = self._points(scan)
        if points is None:
            return state, Stepped((scan,))
        xyz, sigma, direction = points
        t = self.scene.valid(scan)
        histories = [h for h in state.get(scan.sensor, []) if float(t.max()) - h.t <= self.memory]
        state[scan.sensor] = histories
        reach = self.rate if direction else self.speed
        verdicts = self._judge(histories, t, xyz, sigma, reach)
        bad = np.array([v not in PASS for v in verdicts])
        notes = tuple(Note(int(scan.row[i]), Fate.SCREENED, REASON[verdicts[i]]) for i in np.flatnonzero(bad))
        if bad.any():
            keep = ~bad
            scan = Scan(
                scan.sensor, scan.t_look, scan.t_recv, scan.t[keep], scan.z[keep], scan.covariance[keep],
                scan.row[keep], scan.empty_rows, None if scan.address is None else scan.address[keep],
            )  # fmt: skip
        return state, Stepped((scan,), notes)

    def finish(self, state: dict[int, list[History]]) -> tuple[Note, ...]:
        """Nothing is held."""
        return ()

    def _points(self, scan: Scan) -> tuple[FloatArray, FloatArray, bool] | None:
        """Positions in the world (about the sensor for plausibility), or unit directions; None without a pose."""
        xyz, directions = local(scan.z)
        place = self.scene.place(scan.sensor, self.scene.valid(scan), scan.t_recv)
        if place is None or (directions.any() and not directions.all()):
            return None
        sigma = spread(scan.z, scan.covariance, xyz)
        turned: FloatArray = np.einsum("kij,kj->ki", place.axes, xyz)
        about_sensor = directions.all() or isinstance(self.screen, PlausibilityScreen)
        return (turned if about_sensor else turned + place.position), sigma, bool(directions.all())

    def _judge(
        self, histories: list[History], t: FloatArray, xyz: FloatArray, sigma: FloatArray, reach: float
    ) -> list[Verdict]:
        verdicts = [Verdict.UNTESTED] * len(t)
        open_ = [i for i in range(len(t)) if not self._alone(verdicts, i, xyz[i])]
        before = len(histories)
        if before and open_:
            age = t[open_][:, None] - np.array([h.t for h in histories])[None, :]
            gap = distances(xyz[open_], np.array([h.xyz for h in histories]))
            limit = reach * age + self.gate * math.sqrt(2.0) * sigma[open_][:, None]
            taken = pair(gap, np.where(age > 0.0, limit, -1.0))
            left = np.array([j not in taken and h.passed >= ESTABLISHED for j, h in enumerate(histories)])
            rest = pair(gap, np.where((age > 0.0) & left & (taken < 0)[:, None], gap + 1.0, -1.0))
            late = (age <= 0.0).all(axis=1)
            for k, i in enumerate(open_):
                j = int(taken[k] if taken[k] >= 0 else rest[k])
                if j >= 0:
                    verdicts[i] = self._step(histories[j], t[i], xyz[i], sigma[i])
                elif not late[k]:
                    histories.append(self._begin(t[i], xyz[i], sigma[i]))
        else:
            histories.extend(self._begin(t[i], xyz[i], sigma[i]) for i in open_)
        return verdicts

    def _alone(self, verdicts: list[Verdict], i: int, xyz: FloatArray) -> bool:
        """Judge by limits that need no history; True where that settles it."""
        if not isinstance(self.screen, PlausibilityScreen):
            return False
        far = float(np.linalg.norm(xyz))
        low, high = self.screen.range_limits
        if abs(far - 1.0) > 1e-9 and not low <= far <= high:  # a direction has length 1
            verdicts[i] = Verdict.OUT_OF_RANGE
            return True
        elevation = math.asin(max(-1.0, min(1.0, xyz[2] / max(far, 1e-9))))
        low, high = self.screen.elevation_limits
        if not low - 1e-9 <= elevation <= high + 1e-9:
            verdicts[i] = Verdict.OUT_OF_ELEVATION
            return True
        return abs(far - 1.0) <= 1e-9  # speed of a direction is nothing

    def _begin(self, t: float, xyz: FloatArray, sigma: float) -> History:
        history = History(float(t), xyz, self.screen.init())
        self._step(history, t, xyz, sigma)
        return history

    def _step(self, history: History, t: float, xyz: FloatArray, sigma: float) -> Verdict:
        if isinstance(self.screen, PlausibilityScreen):
            history.state, verdict = self.screen.step(history.state, float(t), xyz)
        else:
            history.state, verdict = self.screen.step(history.state, float(t), xyz, float(sigma))
        if verdict in PASS:
            history.t, history.xyz, history.passed = float(t), xyz, history.passed + 1
        return verdict
