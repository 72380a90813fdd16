"""A real recording of two minutes, radar and infrared, through a tracker built from Stone Soup's own parts."""

from __future__ import annotations

import datetime
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from boresight.frames.pose import pose_track
from boresight.types import Component, Recording, Scan

Q, SPEED = 0.1, 8.0  # m²/s³, m/s: as our tracker takes them in two dimensions
EPOCH = datetime.datetime(1970, 1, 1)


def stone_soup_scans(recording: Recording, scans: Sequence[Scan]) -> list[tuple[datetime.datetime, bool, set[Any]]]:
    """Return per look its time, whether it is the radar's, and its detections: laying out is not timed."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from stonesoup.models.measurement.linear import LinearGaussian
        from stonesoup.models.measurement.nonlinear import Cartesian2DToBearing
        from stonesoup.types.detection import Detection
    poses = {p.id: pose_track(p, recording.site) for p in recording.platforms}
    out = []
    for scan in sorted(scans, key=lambda s: s.t_look - recording.sensors[s.sensor].latency):
        sensor = recording.sensors[scan.sensor]
        valid = scan.t_look - sensor.latency
        own = poses[str(sensor.platform)].at(valid).position
        at = EPOCH + datetime.timedelta(seconds=valid)
        ranged = bool(np.isfinite(sensor.sigma[Component.EAST]))
        found = set()
        for z, R in zip(scan.z, scan.covariance, strict=True):
            if ranged:
                east = slice(Component.EAST, Component.NORTH + 1)
                model = LinearGaussian(4, (0, 2), R[east, east])
                vector = (z[east] + own[:2]).reshape(-1, 1)
            else:
                # their bearing runs from the first mapped axis to the second: map (north, east) for ours
                model = Cartesian2DToBearing(
                    4, (2, 0), np.array([[R[1, 1]]]), translation_offset=np.array([[own[1]], [own[0]]])
                )
                vector = np.array([[z[Component.AZIMUTH]]])
            found.add(Detection(vector, timestamp=at, measurement_model=model))
        out.append((at, ranged, found))
    return out


def stone_soup(looks: list[tuple[datetime.datetime, bool, set[Any]]]) -> int:
    """Track: nearest neighbours on every look, radar detections left over begin tracks, wide tracks end.

    Their JPDA enumerates joint hypotheses, which takes minutes here; this is the fastest associator that they have.
    Returns how many tracks there were.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
        from stonesoup.deleter.error import CovarianceBasedDeleter
        from stonesoup.hypothesiser.distance import DistanceHypothesiser
        from stonesoup.initiator.simple import SimpleMeasurementInitiator
        from stonesoup.measures import Mahalanobis
        from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
        from stonesoup.predictor.kalman import ExtendedKalmanPredictor
        from stonesoup.types.state import GaussianState
        from stonesoup.updater.kalman import ExtendedKalmanUpdater

        predictor = ExtendedKalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(Q)] * 2))
        updater = ExtendedKalmanUpdater(None, force_symmetric_covariance=True)
        nearest = GNNWith2DAssignment(DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=3.7))
        prior = GaussianState(np.zeros((4, 1)), np.diag([0.0, SPEED**2, 0.0, SPEED**2]))
        initiator, deleter = SimpleMeasurementInitiator(prior), CovarianceBasedDeleter(400.0)
        tracks: set[Any] = set()
        begun = 0
        for at, ranged, found in looks:
            used = set()
            for track, hypothesis in nearest.associate(tracks, found, at).items():
                if hypothesis:
                    track.append(updater.update(hypothesis))
                    used.add(hypothesis.measurement)
                else:
                    track.append(hypothesis.prediction)
            tracks -= deleter.delete_tracks(tracks)
            if ranged:
                new = initiator.initiate(found - used, at)
                tracks |= new
                begun += len(new)
        return begun
