"""boresight: from radar, infrared and optical reports to tracks and pointing commands."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from boresight._version import __version__

if TYPE_CHECKING:
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
    from boresight.types import GaussianState, Pose, UpdateInfo

# Where each public name lives: nothing heavy is imported before it is asked for.
_HOME = {
    "AdaptiveNoise": "boresight.filters.adaptive",
    "BearingsOnly": "boresight.filters.bearings",
    "CoordinatedTurn": "boresight.models",
    "ExtendedKalman": "boresight.filters.extended",
    "GaussianState": "boresight.types",
    "Infrared": "boresight.models",
    "InteractingModels": "boresight.filters.imm",
    "KnownTurn": "boresight.models",
    "LateReports": "boresight.filters.late",
    "MscFilter": "boresight.filters.msc",
    "NearlyConstantAcceleration": "boresight.models",
    "NearlyConstantJerk": "boresight.models",
    "NearlyConstantVelocity": "boresight.models",
    "Pose": "boresight.types",
    "Position": "boresight.models",
    "Radar": "boresight.models",
    "SensorPose": "boresight.models",
    "Singer": "boresight.models",
    "UnscentedKalman": "boresight.filters.ukf",
    "UpdateInfo": "boresight.types",
    "own_motion": "boresight.models.own",
    "own_sensor": "boresight.models.own",
    "predict": "boresight.filters.ekf",
    "update": "boresight.filters.ekf",
}

__all__ = [
    "AdaptiveNoise",
    "BearingsOnly",
    "CoordinatedTurn",
    "ExtendedKalman",
    "GaussianState",
    "Infrared",
    "InteractingModels",
    "KnownTurn",
    "LateReports",
    "MscFilter",
    "NearlyConstantAcceleration",
    "NearlyConstantJerk",
    "NearlyConstantVelocity",
    "Pose",
    "Position",
    "Radar",
    "SensorPose",
    "Singer",
    "UnscentedKalman",
    "UpdateInfo",
    "__version__",
    "own_motion",
    "own_sensor",
    "predict",
    "update",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'boresight' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value  # found without this function from now on
    return value
