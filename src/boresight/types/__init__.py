"""The few types that everything else is made of."""

from boresight.types.enums import N_COMPONENTS, Axes, Component, Fate, Reporting, SensorKind, TrackStatus
from boresight.types.recording import Detections, Ignore, PlatformTrack, Recording, Truth
from boresight.types.results import (
    COVARIANCE,
    ENU,
    FATES,
    NO_TRACK,
    STATUSES,
    VELOCITY,
    DecisionRows,
    RegistrationRows,
    Results,
    TrackRows,
    no_tracks,
)
from boresight.types.scan import Scan, address_code, addresses_of
from boresight.types.sensor import Coverage, FloatArray, Mount, Sensor, Site, Station
from boresight.types.state import GaussianState, Pose, UpdateInfo

__all__ = [
    "COVARIANCE",
    "ENU",
    "FATES",
    "NO_TRACK",
    "N_COMPONENTS",
    "STATUSES",
    "VELOCITY",
    "Axes",
    "Component",
    "Coverage",
    "DecisionRows",
    "Detections",
    "Fate",
    "FloatArray",
    "GaussianState",
    "Ignore",
    "Mount",
    "PlatformTrack",
    "Pose",
    "Recording",
    "RegistrationRows",
    "Reporting",
    "Results",
    "Scan",
    "Sensor",
    "SensorKind",
    "Site",
    "Station",
    "TrackRows",
    "TrackStatus",
    "Truth",
    "UpdateInfo",
    "address_code",
    "addresses_of",
    "no_tracks",
]
