"""Settings for a recording that has none: of its own first part."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from boresight.tracking.defaults import consistency, declared, defaults_for

from boresight.config.scenario import read_scenario
from boresight.io.scans import iter_scans
from boresight.metrics.score import score
from boresight.sim.scenario import simulate
from boresight.tracking.config import TrackerConfig
from boresight.tracking.run import decision_rows, run, track_rows, tracker_for
from boresight.types import Detections, Recording, Reporting, Sensor, SensorKind, Site, Truth
from tests.tracking.test_messages import SEA

EXAMPLES = Path(__file__).parents[2] / "examples"


def walkers(
    q: float, speed: float, sigma: float, period: float, seed: int, looks: int = 200, still: bool = False
) -> Recording:
    """Four targets of nearly constant velocity, kept apart, seen in every look but one in ten."""
    rng = np.random.default_rng(seed)
    F = np.kron([[1.0, period], [0.0, 1.0]], np.eye(2))
    Q = q * np.kron([[period**3 / 3, period**2 / 2], [period**2 / 2, period]], np.eye(2))
    root = np.linalg.cholesky(Q)
    reach = speed * period * looks
    rows, truth = [], []
    for i in range(4):
        course = rng.uniform(0.0, 2.0 * np.pi)
        v = speed * np.array([np.sin(course), np.cos(course)])
        x = np.r_[[reach * (i % 2), reach * (i // 2)], 0.0 * v if still else v]
        path = np.zeros((looks, 4))
        for k in range(looks):
            path[k] = x
            if rng.random() < 0.9:
                rows.append((k * period, k, x[:2] + sigma * rng.standard_normal(2)))
            if not still:
                x = F @ x + root @ rng.standard_normal(4)
        flat = np.zeros((looks, 1))
        truth.append(
            Truth(f"{i}", period * np.arange(looks), np.hstack([path[:, :2], flat]), np.hstack([path[:, 2:], flat]))
        )
    rows.sort(key=lambda row: row[1])
    n = len(rows)
    z, t = np.full((n, 7), np.nan), np.array([row[0] for row in rows])
    z[:, 4:6] = [row[2] for row in rows]
    noise = np.full(7, np.nan)
    noise[4:6] = sigma
    lidar = Sensor("lidar", SensorKind.LIDAR, sigma=noise, period=period, clutter_per_scan=0.1)
    of = np.zeros(n, np.int64)
    detections = Detections(
        t, t, of, np.array([row[1] for row in rows]), z, np.where(np.isfinite(z), sigma, np.nan), {}
    )
    return Recording("walkers", 2, Site(0.8, 0.1, 0.0), (lidar,), detections, (), tuple(truth), (), np.zeros(n, bool))


@pytest.mark.parametrize(
    ("q", "speed", "sigma", "period"),
    [(0.1, 1.5, 0.1, 0.1), (0.05, 8.0, 10.0, 2.5), (1.0, 200.0, 60.0, 4.0), (200.0, 500.0, 5.0, 0.1)],
)
def test_process_noise_and_speed_are_found(q: float, speed: float, sigma: float, period: float) -> None:
    """From pedestrians to missiles: the noise within a factor of three, GOSPA as with the simulation's own."""
    recording = walkers(q, speed, sigma, period, 1)
    config, lines = defaults_for(recording)
    assert config.q is not None
    assert q / 3.0 < config.q < 3.0 * q
    assert config.speed_sigma is not None
    assert 0.5 * speed < config.speed_sigma < 3.0 * speed
    assert any(f"process_noise_m2_s3 = {config.q:.3g}" in line for line in lines)
    own = replace(declared(recording.sensors, sigma, 2), q=q, speed_sigma=speed)
    found = []
    for settings in (config, own):
        tracker = tracker_for(recording, settings)
        state, rows, _ = run(tracker, list(iter_scans(recording)))
        assert state.names.given <= 6
        found.append(float(score(recording, track_rows(rows), None, ["lidar"]).rows[0]["gospa_rms_m"]))
    assert found[0] < 1.15 * found[1]


@pytest.mark.parametrize("seed", [1, 5])
def test_three_aircraft_that_turn_are_three_tracks(seed: int) -> None:
    """The example as it comes, with settings of its own: 12 tracks where one quiet noise is taken for all."""
    scenario, _ = read_scenario(EXAMPLES / "aircraft.toml")
    recording = simulate(scenario, np.random.default_rng(seed))
    config, _ = defaults_for(recording)
    assert config.q_manoeuvre is not None
    tracker = tracker_for(recording, config)
    state, rows, _ = run(tracker, list(iter_scans(recording)))
    assert state.names.given == 3
    assert score(recording, track_rows(rows), None, ["radar", "irst", "transponder"]).rows[0]["identity_switches"] == 0


def test_what_stands_teaches_nothing() -> None:
    recording = walkers(0.1, 3.0, 2.0, 1.0, 2, still=True)
    config, lines = defaults_for(recording)
    assert config == declared(recording.sensors, 2.0, 2)
    assert lines == ["settings: as declared by the sensors; nothing that moves in the first part to learn more from"]


def test_without_positions_what_is_declared_decides() -> None:
    recording = walkers(0.1, 3.0, 2.0, 1.0, 2)
    z = np.full_like(recording.detections.z, np.nan)
    z[:, 1] = np.arctan2(recording.detections.z[:, 4], recording.detections.z[:, 5])
    sigma = np.full(7, np.nan)
    sigma[1] = 0.01
    eye = Sensor("eye", SensorKind.OPTICAL, sigma=sigma)
    detections = replace(recording.detections, z=z, sigma=np.where(np.isfinite(z), 0.01, np.nan))
    config, lines = defaults_for(replace(recording, sensors=(eye,), detections=detections))
    assert (config.q, config.speed_sigma, config.merge_distance) == (0.1, 8.0, 10.0)
    assert len(lines) == 1


def test_rates_decide_how_long_a_track_lives() -> None:
    slow = Sensor("radar", SensorKind.RADAR, period=12.0)
    quick = replace(slow, id="quick", period=0.1)
    assert declared((slow,), 100.0, 2).coast_after == 30.0
    assert declared((slow,), 100.0, 2).survival_time == 240.0
    assert declared((quick,), 0.1, 2).merge_distance == 0.3
    assert declared((quick,), 0.1, 2).static_q == pytest.approx(0.02**2 / 0.1)
    single = replace(quick, reporting=Reporting.SINGLE, coverage=SEA)
    assert declared((single,), 5.0, 2).hide_below < declared((quick,), 5.0, 2).hide_below


@pytest.mark.parametrize(("factor", "word"), [(1.0, None), (3.0, "more"), (0.3, "less")])
def test_a_covariance_that_the_innovations_refute_is_said(factor: float, word: str | None) -> None:
    """Noise three times, or a third of, what is declared."""
    recording = walkers(0.05, 5.0, 10.0, 2.0, 3)
    sigma = recording.sensors[0].sigma / factor
    lidar = replace(recording.sensors[0], sigma=sigma)
    detections = replace(recording.detections, sigma=recording.detections.sigma / factor)
    recording = replace(recording, sensors=(lidar,), detections=detections)
    tracker = tracker_for(recording, TrackerConfig(q=0.05, gate_probability=0.9999999))
    state, _, decisions = run(tracker, list(iter_scans(recording)))
    lines = consistency(recording, decision_rows(recording, tracker, decisions, state.names))
    assert len(lines) == (word is not None)
    if word is not None:
        assert lines[0].startswith("lidar: NIS per component")
        assert f"errs {word} than is declared" in lines[0]
