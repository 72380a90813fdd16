"""The chosen stages, made for a recording's sensors."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from boresight.engine.pipeline import Pipeline
from boresight.errors import UserError, did_you_mean
from boresight.frames.pose import PoseTrack
from boresight.screen.hampel import HampelScreen
from boresight.screen.plausible import PlausibilityScreen
from boresight.screen.prediction import PredictionScreen
from boresight.stages.align import AlignStage
from boresight.stages.fuse import FuseStage
from boresight.stages.scene import Scene, bearing_only
from boresight.stages.screen import ScreenStage
from boresight.stages.smooth import SmoothStage
from boresight.types import Recording, SensorKind

DEG = math.pi / 180.0
REACH = {2: (30.0, 3.0), 3: (600.0, 10.0)}  # m/s, °/s, by dimensions: what a target may move between two reports


def make_pipeline(
    chosen: Mapping[str, Any], recording: Recording, poses: Mapping[str, PoseTrack], use: Collection[int], where: str
) -> Pipeline:
    """Return the stages that `take_pipeline` gave, for a recording and the sensors in use; raises UserError."""
    build = Builder(Scene(recording.sensors, poses), recording.dimensions, frozenset(use), where)
    try:
        return Pipeline(tuple(getattr(build, stage)(options, chosen) for stage, options in chosen.items()))
    except UserError as error:
        text = str(error)
        raise UserError(text if text.startswith(where) else f"{where}: {text}") from None


@dataclass(frozen=True, slots=True)
class Builder:
    """Turns options into stages."""

    scene: Scene
    dimensions: int
    use: frozenset[int]
    where: str

    def screen(self, o: Mapping[str, Any], _: Any) -> ScreenStage:
        """Make the screen of a kind."""
        speed, rate = self._reach(o)
        common = _given(o, gate="gate", memory="memory_s")
        screen: PredictionScreen | HampelScreen | PlausibilityScreen
        if o["kind"] == "prediction":
            screen = PredictionScreen(**common, **_given(o, reopen="reopen"))
        elif o["kind"] == "hampel":
            screen = HampelScreen(**common, **_given(o, window="window"))
        else:
            low, high = o.get("elevation_deg", (-90.0, 90.0))
            screen = PlausibilityScreen(
                tuple(o.get("range_m", (0.0, math.inf))), (low * DEG, high * DEG), speed, o.get("slack_m", 50.0),
                **_given(o, reopen="reopen"),
            )  # fmt: skip
        follow = _given(o, memory="memory_s", gate="gate")
        if o["kind"] == "hampel":
            follow.setdefault("memory", screen.memory)  # type: ignore[union-attr]
        return ScreenStage(self.scene, screen, self._sensors(o, "screen"), speed, rate, **follow)

    def smooth(self, o: Mapping[str, Any], _: Any) -> SmoothStage:
        """Make the smoother."""
        speed, rate = self._reach(o)
        more = _given(o, samples="samples", order="order", gate="gate", memory="memory_s")
        return SmoothStage(self.scene, self._sensors(o, "smooth"), speed, rate, **more)

    def align(self, o: Mapping[str, Any], _: Any) -> AlignStage:
        """Make the alignment."""
        slow, fast = self._pair(o)
        more = _given(o, gate="gate", hold="hold_s", past="past", future="future", time_distance="time_distance")
        order: dict[str, Any] = {"order": o["order"] or None} if "order" in o else {}
        return AlignStage(self.scene, o["kind"], slow, fast, self._reach(o)[1], **more, **order)

    def fuse(self, o: Mapping[str, Any], chosen: Mapping[str, Any]) -> FuseStage:
        """Make the fusion, of the sensors that were aligned."""
        slow, fast = self._pair(chosen["align"])
        return FuseStage(self.scene, o["kind"], slow, fast, **_given(o, gate="gate", wait="wait_s"))

    def _reach(self, o: Mapping[str, Any]) -> tuple[float, float]:
        speed, rate = REACH[self.dimensions]
        return o.get("max_speed_m_s", speed), o.get("max_rate_deg_s", rate) * DEG

    def _sensors(self, o: Mapping[str, Any], stage: str) -> frozenset[int]:
        if "sensors" not in o:
            return self.use
        return frozenset(self._index(name, f"{stage}.sensors") for name in o["sensors"])

    def _index(self, name: str, key: str) -> int:
        known = [s.id for s in self.scene.sensors]
        if name not in known:
            near = did_you_mean(name, known)
            raise UserError(f"{self.where}: {key}: no sensor '{name}'{near}; the recording has {', '.join(known)}")
        return known.index(name)

    def _pair(self, o: Mapping[str, Any]) -> tuple[int, frozenset[int]]:
        """The slow sensor and the fast: as named, else the ranging one with the longest period, and bearings."""
        sensors = self.scene.sensors
        if "slow" in o:
            slow = self._index(o["slow"], "align.slow")
            if slow not in self.use:
                raise UserError(f"{self.where}: align.slow = '{o['slow']}' is left out by --sensors; choose another")
        else:
            ranging = [i for i in sorted(self.use) if not bearing_only(sensors[i])]
            if not ranging:
                raise UserError(f"{self.where}: align: no sensor in use measures range; name one as align.slow")
            slow = max(ranging, key=lambda i: (sensors[i].kind == SensorKind.RADAR, sensors[i].period or 0.0))
        if "fast" in o:
            fast = frozenset(self._index(name, "align.fast") for name in o["fast"]) & self.use
            for i in fast:
                if not bearing_only(sensors[i]):
                    raise UserError(f"{self.where}: align.fast: '{sensors[i].id}' reports more than directions")
        else:
            fast = frozenset(i for i in self.use if bearing_only(sensors[i]))
        fast = fast - {slow}
        if not fast:
            raise UserError(f"{self.where}: align: no sensor in use reports directions alone; nothing to align")
        return slow, fast


def _given(o: Mapping[str, Any], **keys: str) -> dict[str, Any]:
    return {name: o[key] for name, key in keys.items() if key in o}
