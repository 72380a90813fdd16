"""The closed vocabularies of recordings and results. The values are what stands in the files."""

from __future__ import annotations

from enum import IntEnum, StrEnum


class SensorKind(StrEnum):
    """What a sensor is."""

    RADAR = "radar"
    INFRARED = "infrared"
    OPTICAL = "optical"
    LIDAR = "lidar"
    POSITION = "position"


class Axes(StrEnum):
    """The axes in which a sensor's measurements are given."""

    SITE_ENU = "site_enu"
    PLATFORM_ENU = "platform_enu"  # north-aligned, at the platform
    BODY = "body"  # forward, right, down
    MOUNT = "mount"  # the body turned by the sensor's mounting angles


class Reporting(StrEnum):
    """What one look of a sensor tells of."""

    SCAN = "scan"  # of all targets in its coverage: what is not in it was missed
    SINGLE = "single"  # of one target, which reports by itself (transponder, AIS, MLAT, another tracker): of no other


class TrackStatus(StrEnum):
    """Where a track stands in its life."""

    TENTATIVE = "tentative"
    CONFIRMED = "confirmed"
    COASTING = "coasting"


class Fate(StrEnum):
    """What became of one row of the detections. Every row gets exactly one."""

    UPDATED = "updated"  # it updated a track
    INITIATED = "initiated"  # it began a track
    UNASSOCIATED = "unassociated"  # inside no gate or left over by the assignment; may have fed a clutter estimate
    GATED = "gated"  # nearest track was outside the gate, and the sensor cannot begin a track
    SCREENED = "screened"  # implausible by itself, before any track was asked
    LATE = "late"  # older than the tracker's window
    DUPLICATE = "duplicate"  # the same row stood earlier in the file
    OUT_OF_COVERAGE = "out_of_coverage"  # outside the coverage that the sensor declares
    NO_DETECTION = "no_detection"  # the row says that a look saw nothing
    NOT_SELECTED = "not_selected"  # its sensor was left out by --sensors
    ALIGNED = "aligned"  # it went into a value with others, and counts there once
    UNUSED = "unused"  # a pipeline stage had no use for it


class Component(IntEnum):
    """Column of a measured component in every detection array (`z[:, Component.RANGE]`)."""

    RANGE = 0  # m
    AZIMUTH = 1  # rad
    ELEVATION = 2  # rad
    RANGE_RATE = 3  # m/s
    EAST = 4  # m  in the sensor's local axes: east-like (right in body axes)
    NORTH = 5  # m  north-like (forward in body axes)
    UP = 6  # m  up-like (minus down in body axes)


N_COMPONENTS = len(Component)
