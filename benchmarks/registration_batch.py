"""Registration off line: `python -m benchmarks.registration_batch [--runs 200] [--real] [--json]`.

Simulated: the recordings of `benchmarks.registration` (time offset, range bias and heading drawn anew in every run,
coloured azimuths), relative to the radar that is right; and a camera beside a radar, where nothing shows the radar's
range. Printed: how often each estimate's own 95 % band holds the truth. Real (`--real`): the Autoferry recordings,
radar and camera, and all four sensors. The time offset is held against the one fitted with truth, in the same way:
the true paths, seen every second by a sensor of 0.5 m, are the reference there; a target's antenna may lie `extent_m`
from the point of it that is reported.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
from typing import Any

import numpy as np

from benchmarks.registration import CONFIG, case
from benchmarks.scoreboard import DATA, configuration, recordings
from boresight._version import __version__
from boresight.cli.register import DEFAULT_Q, EXTENT, PRIOR, fit, rows_of
from boresight.register.batch import BatchConfig, Coloured, estimate
from boresight.register.observe import observed_of
from boresight.register.residuals import Observed
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.tracking.run import tracker_for
from boresight.types import Axes, Component, Recording, Sensor, SensorKind

NEAR, AWAY = 25.0, math.radians(5.0)  # m, rad: reports this close to a true path are taken for its target's
FOR_GOOD = 1000.0  # s: an antenna stays where it is on its boat


def with_camera(seed: int) -> tuple[Recording, dict[str, float]]:
    """A recording whose right radar is a camera in the same place: it reports azimuth alone."""
    recording, truth = case(seed)
    right = recording.sensor_index("right")
    sigma = np.full(7, np.nan)
    sigma[Component.AZIMUTH] = recording.sensors[right].sigma[Component.AZIMUTH]
    camera = dataclasses.replace(recording.sensors[right], id="camera", kind=SensorKind.INFRARED, sigma=sigma)
    z, s = recording.detections.z.copy(), recording.detections.sigma.copy()
    mine = recording.detections.sensor == right
    z[mine, Component.RANGE], s[mine, Component.RANGE] = np.nan, np.nan
    detections = dataclasses.replace(recording.detections, z=z, sigma=s)
    sensors = tuple(camera if i == right else one for i, one in enumerate(recording.sensors))
    return dataclasses.replace(recording, sensors=sensors, detections=detections), truth


def simulated(runs: int, camera: bool = False) -> list[dict[str, Any]]:
    """One row for each parameter."""
    found: dict[str, list[tuple[float, float, str]]] = {}
    for seed in range(runs):
        recording, truth = (with_camera if camera else case)(seed)
        estimated, _ = fit(recording, CONFIG, None, recording.sensor_index("camera" if camera else "right"))
        for row in rows_of(recording, estimated):
            error = row["value"] - truth.get(row["parameter"], 0.0)
            found.setdefault(row["parameter"], []).append((error, row["sigma"], row["verdict"]))
    out = []
    for parameter, all_ in found.items():
        error, sigma = (np.array([v[k] for v in all_]) for k in (0, 1))
        words = [v[2] for v in all_]
        out.append(
            {
                "case": "camera and radar" if camera else "two radars",
                "parameter": parameter,
                "runs": len(error),
                "in_band_95": float(np.mean(np.abs(error) <= 1.96 * sigma)),
                "rms_error": float(np.sqrt(np.mean(error**2))),
                "sigma_median": float(np.median(sigma)),
                "verdict": max(set(words), key=words.count),
            }
        )
    return out


def with_truth(recording: Recording, settings: TrackerConfig) -> dict[str, tuple[float, float]]:
    """Return the time offset (s) of each sensor and its sigma, by the true paths."""
    tracker = tracker_for(recording, settings)
    alike = {i: settings.sensors.get(s.id, SensorErrors()).decorrelation for i, s in enumerate(recording.sensors)}
    everything = observed_of(
        recording, np.ones(len(recording.detections), np.int64), tracker.poses, tracker.used, alike
    )
    keep, target = _near(recording, everything)
    true = len(recording.sensors)
    sigma = np.full(7, np.nan)
    sigma[Component.EAST : Component.UP + 1] = 0.5
    sensors = (*recording.sensors, Sensor("truth", SensorKind.POSITION, axes=Axes.SITE_ENU, sigma=sigma))
    parts = [(target[keep], *(getattr(everything, n)[keep] for n in ("sensor", "t", "z", "R", "fix", "alike")))]
    for k, path in enumerate(recording.truth):
        t = np.arange(path.t[0], path.t[-1], 1.0)
        position = np.stack([np.interp(t, path.t, path.position[:, a]) for a in range(3)], axis=1)
        z, R = np.full((len(t), 7), np.nan), np.full((len(t), 7, 7), np.nan)
        z[:, Component.EAST : Component.UP + 1] = np.nan_to_num(position)
        R[:, 4:, 4:] = np.eye(3) * 0.25
        parts.append((np.full(len(t), k), np.full(len(t), true), t, z, R, np.nan_to_num(position), np.ones(len(t))))
    columns = [np.concatenate(c) for c in zip(*parts, strict=True)]
    observed = Observed._make([*columns, (*everything.poses, None), len(recording.truth)])
    coloured = {}
    for i, one in enumerate(recording.sensors):
        e = settings.sensors.get(one.id, SensorErrors())
        wander = np.array([e.bias_range, e.bias_azimuth, e.bias_elevation, 0.0, *[e.bias_position] * 3])
        coloured[i] = Coloured(wander, e.bias_time)
    extent = settings.extent or EXTENT
    coloured[true] = Coloured(np.array([0.0, 0.0, 0.0, 0.0, *[extent] * 3]), FOR_GOOD)
    batch = BatchConfig(settings.q or DEFAULT_Q[2], np.array(PRIOR), coloured, extent=extent)
    got = estimate(observed, sensors, batch, true, True)
    return {
        sensors[int(got.sensor[k])].id: (float(got.value[k]), math.sqrt(got.covariance[k, k]))
        for k in range(len(got.value))
        if got.parameter[k] == 0
    }


def _near(recording: Recording, o: Observed) -> tuple[np.ndarray, np.ndarray]:
    """Which reports lie near a true path, and near which."""
    from boresight.frames.pose import sensor_pose

    gap = np.full((len(o.t), len(recording.truth)), np.inf)
    for i, pose in enumerate(o.poses):
        mine = np.flatnonzero(o.sensor == i)
        if not len(mine):
            continue
        place, _, _ = sensor_pose(recording.sensors[i], pose, o.t[mine])
        for k, path in enumerate(recording.truth):
            p = np.stack([np.interp(o.t[mine], path.t, path.position[:, a]) for a in range(2)], axis=1)
            inside = (o.t[mine] >= path.t[0]) & (o.t[mine] <= path.t[-1])
            off = np.hypot(*(o.fix[mine, :2] - p).T) / NEAR
            bearing = np.arctan2(*(p - place[:, :2]).T)
            turn = np.abs(np.angle(np.exp(1j * (o.z[mine, Component.AZIMUTH] - bearing)))) / AWAY
            gap[mine, k] = np.where(inside, np.where(np.isfinite(off), off, turn), np.inf)
    target = gap.argmin(axis=1)
    return gap.min(axis=1) < 1.0, target


def real() -> list[dict[str, Any]]:
    """One row for each recording, combination of sensors and late sensor."""
    out = []
    for number, recording in recordings(DATA).items():
        settings = configuration(recording)
        true = with_truth(recording, settings)
        known = [s.id for s in recording.sensors]
        for ids in (["radar", "ir"], ["radar", "lidar", "ir", "eo"]):
            base = "lidar" if "lidar" in ids else "ir"
            got, _ = fit(recording, settings, ids, known.index(base))
            for row in rows_of(recording, got):
                if row["parameter"] != "time_offset_s":
                    continue
                expected = true[row["sensor"]][0] - true[base][0]
                spread = math.hypot(true[row["sensor"]][1], true[base][1])
                out.append(
                    {
                        "scenario": number,
                        "sensors": ",".join(ids),
                        "sensor": row["sensor"],
                        "relative_to": base,
                        "time_offset_s": row["value"],
                        "sigma_s": row["sigma"],
                        "with_truth_s": expected,
                        "with_truth_sigma_s": spread,
                        "in_band_95": bool(abs(row["value"] - expected) <= 1.96 * row["sigma"]),
                        "verdict": row["verdict"],
                    }
                )
    return out


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--real", action="store_true", help="the real recordings in ../shared/data")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    runs = max(1, arguments.runs)
    rows = real() if arguments.real else simulated(runs) + simulated(max(1, runs // 10), camera=True)
    if arguments.json:
        about = {"command": "registration_batch", "version": __version__, "parameters": vars(arguments)}
        print(json.dumps({**about, "rows": rows}, indent=1))
        return 0
    for row in rows:
        print("  ".join(f"{v:.3f}" if isinstance(v, float) else str(v) for v in row.values()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
