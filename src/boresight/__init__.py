"""boresight: from radar, infrared and optical reports to tracks and pointing commands."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from boresight._version import __version__

if TYPE_CHECKING:
    from boresight.filters.ekf import predict, update
    from boresight.models import (
        Infrared,
        NearlyConstantAcceleration,
        NearlyConstantVelocity,
        Position,
        Radar,
        SensorPose,
    )
    from boresight.types import GaussianState, Pose, UpdateInfo

# Where each public name lives: nothing heavy is imported before it is asked for.
_HOME = {
    "GaussianState": "boresight.types",
    "Infrared": "boresight.models",
    "NearlyConstantAcceleration": "boresight.models",
    "NearlyConstantVelocity": "boresight.models",
    "Pose": "boresight.types",
    "Position": "boresight.models",
    "Radar": "boresight.models",
    "SensorPose": "boresight.models",
    "UpdateInfo": "boresight.types",
    "predict": "boresight.filters.ekf",
    "update": "boresight.filters.ekf",
}

__all__ = [
    "GaussianState",
    "Infrared",
    "NearlyConstantAcceleration",
    "NearlyConstantVelocity",
    "Pose",
    "Position",
    "Radar",
    "SensorPose",
    "UpdateInfo",
    "__version__",
    "predict",
    "update",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'boresight' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)
