"""The few types that everything else is made of."""

from boresight.types.enums import N_COMPONENTS, Axes, Component, Fate, SensorKind, TrackStatus
from boresight.types.recording import Detections, Ignore, PlatformTrack, Recording, Truth
from boresight.types.scan import Scan
from boresight.types.sensor import Coverage, FloatArray, Mount, Sensor, Site
from boresight.types.state import GaussianState, Pose, UpdateInfo

__all__ = [
    "N_COMPONENTS",
    "Axes",
    "Component",
    "Coverage",
    "Detections",
    "Fate",
    "FloatArray",
    "GaussianState",
    "Ignore",
    "Mount",
    "PlatformTrack",
    "Pose",
    "Recording",
    "Scan",
    "Sensor",
    "SensorKind",
    "Site",
    "TrackStatus",
    "Truth",
    "UpdateInfo",
]
