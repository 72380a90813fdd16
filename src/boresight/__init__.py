"""boresight: from radar, infrared and optical reports to tracks and pointing commands."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from boresight._version import __version__

if TYPE_CHECKING:
    from boresight.door import Track, Tracker, read_recording, sensor, track
    from boresight.filters.adaptive import AdaptiveNoise
    from boresight.filters.bearings import BearingsOnly
    from boresight.filters.ekf import predict, update
    from boresight.filters.extended import ExtendedKalman
    from boresight.filters.imm import InteractingModels
    from boresight.filters.late import LateReports
    from boresight.filters.msc import MscFilter
    from boresight.filters.ukf import UnscentedKalman
    from boresight.models import (
        CoordinatedTurn,
        Infrared,
        KnownTurn,
        NearlyConstantAcceleration,
        NearlyConstantJerk,
        NearlyConstantVelocity,
        Position,
        Radar,
        SensorPose,
        Singer,
    )
    from boresight.models.own import own_motion, own_sensor
    from boresight.pointing.guide import GuideFilter, GuideSource
    from boresight.pointing.pointer import Pointer
    from boresight.tracking.config import TrackerConfig
    from boresight.types import GaussianState, Pose, Results, Sensor, Site, UpdateInfo

# Where each public name lives: nothing heavy is imported before it is asked for.
_HOME = {
    "AdaptiveNoise": "boresight.filters.adaptive",
    "BearingsOnly": "boresight.filters.bearings",
    "CoordinatedTurn": "boresight.models",
    "ExtendedKalman": "boresight.filters.extended",
    "GaussianState": "boresight.types",
    "GuideFilter": "boresight.pointing.guide",
    "GuideSource": "boresight.pointing.guide",
    "Infrared": "boresight.models",
    "InteractingModels": "boresight.filters.imm",
    "KnownTurn": "boresight.models",
    "LateReports": "boresight.filters.late",
    "MscFilter": "boresight.filters.msc",
    "NearlyConstantAcceleration": "boresight.models",
    "NearlyConstantJerk": "boresight.models",
    "NearlyConstantVelocity": "boresight.models",
    "Pointer": "boresight.pointing.pointer",
    "Pose": "boresight.types",
    "Position": "boresight.models",
    "Radar": "boresight.models",
    "Results": "boresight.types",
    "Sensor": "boresight.types",
    "SensorPose": "boresight.models",
    "Singer": "boresight.models",
    "Site": "boresight.types",
    "Track": "boresight.door",
    "Tracker": "boresight.door",
    "TrackerConfig": "boresight.tracking.config",
    "UnscentedKalman": "boresight.filters.ukf",
    "UpdateInfo": "boresight.types",
    "own_motion": "boresight.models.own",
    "own_sensor": "boresight.models.own",
    "predict": "boresight.filters.ekf",
    "read_recording": "boresight.door",
    "sensor": "boresight.door",
    "track": "boresight.door",
    "update": "boresight.filters.ekf",
}

__all__ = [
    "AdaptiveNoise",
    "BearingsOnly",
    "CoordinatedTurn",
    "ExtendedKalman",
    "GaussianState",
    "GuideFilter",
    "GuideSource",
    "Infrared",
    "InteractingModels",
    "KnownTurn",
    "LateReports",
    "MscFilter",
    "NearlyConstantAcceleration",
    "NearlyConstantJerk",
    "NearlyConstantVelocity",
    "Pointer",
    "Pose",
    "Position",
    "Radar",
    "Results",
    "Sensor",
    "SensorPose",
    "Singer",
    "Site",
    "Track",
    "Tracker",
    "TrackerConfig",
    "UnscentedKalman",
    "UpdateInfo",
    "__version__",
    "own_motion",
    "own_sensor",
    "predict",
    "read_recording",
    "sensor",
    "track",
    "update",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'boresight' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value  # found without this function from now on
    return value
