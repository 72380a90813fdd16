"""Two models of motion in the tracker: the textbook's on one target, honest in turns, carried wherever tracks are."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from filterpy.kalman import IMMEstimator, KalmanFilter
from scipy.linalg import expm

from boresight.config.tracker import read_tracker_config
from boresight.engine.track import run
from boresight.errors import UserError
from boresight.filters.imm import InteractingModels
from boresight.io.scans import iter_scans
from boresight.kernels.tracker import Tracks
from boresight.models import NearlyConstantVelocity, Radar
from boresight.tracking.config import SensorErrors, TrackerConfig
from boresight.tracking.run import track_rows, tracker_for
from boresight.tracking.saved import arrays_of_state, state_of_arrays
from boresight.tracking.tracker import Tracker
from boresight.types import Recording, Scan, Sensor, SensorKind

NAN = float("nan")
QUIET, MANOEUVRE, EVERY, LASTS = 0.01, 4.0, 30.0, 8.0
CONFIG = TrackerConfig(
    q=QUIET,
    q_manoeuvre=MANOEUVRE,
    manoeuvre_every=EVERY,
    manoeuvre_lasts=LASTS,
    gate_probability=0.999999,
    window=0.0,
    rest_time=1e12,
)


def weaving(t: float) -> np.ndarray:
    """Place (m) of a target that goes straight on for 20 s, then turns at 1.5 m/s² for 10 s."""
    s = max(t - 20.0, 0.0)
    return np.array([150.0 + 6.0 * t - 0.75 * min(s, 10.0) ** 2 - 15.0 * max(s - 10.0, 0.0), 80.0 + 2.0 * t])


def test_one_target_is_filterpys_imm() -> None:
    """Linear, at equal intervals, as FilterPy has it; every look updates the one track."""
    sigma = np.full(7, NAN)
    sigma[4:6] = 3.0
    tracker = Tracker(CONFIG, (Sensor("lidar", SensorKind.LIDAR, sigma=sigma),), 2)
    rng = np.random.default_rng(2)
    state, dt = tracker.init(), 0.8
    G = np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    imm = None
    most = 0.0
    for k in range(50):
        z, R = np.full((1, 7), NAN), np.full((1, 7, 7), NAN)
        z[0, 4:6] = weaving(dt * k) + 3.0 * rng.standard_normal(2)
        R[0, 4:6, 4:6] = 9.0 * np.eye(2)
        state, _ = tracker.step(state, Scan(0, dt * k, dt * k, np.array([dt * k]), z, R, np.array([k])))
        tr = state.window.tracks
        assert tr.live[0] == 1
        if imm is None:
            filters = []
            for q in (QUIET, MANOEUVRE):
                f = KalmanFilter(4, 2)
                f.x, f.P, f.R, f.H = tr.x[0].copy(), tr.P[0].copy(), 9.0 * np.eye(2), np.eye(2, 4)
                f.F, f.Q = np.kron([[1.0, dt], [0.0, 1.0]], np.eye(2)), q * np.kron(G, np.eye(2))
                filters.append(f)
            M = expm(dt * np.array([[-1.0 / EVERY, 1.0 / EVERY], [1.0 / LASTS, -1.0 / LASTS]]))
            imm = IMMEstimator(filters, np.array([EVERY, LASTS]) / (EVERY + LASTS), M)
            continue
        imm.predict()
        imm.update(z[0, 4:6])
        np.testing.assert_allclose(tr.mode[0], imm.mu, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(tr.x[0], imm.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(tr.P[0], imm.P, rtol=1e-9, atol=1e-9)
        most = max(most, tr.mode[0, 1])
    assert most > 0.9  # it saw the turn


def test_one_target_is_the_librarys_imm() -> None:
    """Range and azimuth at irregular times, against the single-target filter."""
    sigma = np.full(7, NAN)
    sigma[:2] = 3.0, 0.01
    tracker = Tracker(CONFIG, (Sensor("radar", SensorKind.RADAR, sigma=sigma),), 2)
    imm = InteractingModels((NearlyConstantVelocity(QUIET, 2), NearlyConstantVelocity(MANOEUVRE, 2)), (EVERY, LASTS))
    radar = Radar(3.0, 0.01, dimensions=2)
    rng = np.random.default_rng(3)
    state, alone, t = tracker.init(), None, 0.0
    for k in range(60):
        place = weaving(t)
        z, R = np.full((1, 7), NAN), np.full((1, 7, 7), NAN)
        z[0, :2] = np.hypot(*place) + 3.0 * rng.standard_normal(), np.arctan2(*place) + 0.01 * rng.standard_normal()
        R[0, :2, :2] = np.diag([9.0, 1e-4])
        state, _ = tracker.step(state, Scan(0, t, t, np.array([t]), z, R, np.array([k])))
        tr = state.window.tracks
        assert tr.live[0] == 1
        if alone is None:
            alone = imm.init(t, tr.x[0].copy(), tr.P[0].copy(), (0.0, 0.0), np.array([EVERY, LASTS]) / (EVERY + LASTS))
        else:
            alone, _ = imm.update(imm.predict(alone, t), radar, z[0, :2])
        np.testing.assert_allclose(tr.mode[0], alone.weights, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(tr.x[0], alone.x, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(tr.P[0], alone.P, rtol=1e-9, atol=1e-9)
        t += rng.uniform(0.3, 1.5)


TWO = TrackerConfig(q=0.02, q_manoeuvre=2.0, manoeuvre_every=20.0)


def whole_and_sure(tr: Tracks) -> None:
    """x and P are the moments of the models, whose probabilities add to one."""
    n = int(tr.live[0])
    w, X, P = tr.mode[:n], tr.mode_x[:n], tr.mode_P[:n]
    np.testing.assert_allclose(w.sum(axis=1), 1.0, rtol=1e-12)
    x = np.einsum("nj,njs->ns", w, X)
    gap = X - x[:, None]
    moments = np.einsum("nj,njab->nab", w, P + gap[..., :, None] * gap[..., None, :])
    np.testing.assert_allclose(tr.x[:n], x, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(tr.P[:n], moments, rtol=1e-8, atol=1e-7)


@pytest.mark.parametrize(
    "config",
    [
        TWO,
        dataclasses.replace(TWO, association="jpda"),
        dataclasses.replace(
            TWO, sensors={"radar": SensorErrors(offset_time=0.5, offset_azimuth=0.02, offset_range=5.0)}
        ),
        dataclasses.replace(TWO, blob_share=0.1, sensors={"radar": SensorErrors(resolution=25.0)}),
    ],
    ids=["nearest", "jpda", "constants", "blobs"],
)
def test_late_looks_and_saved_states_keep_the_models(config: TrackerConfig, harbour: Recording) -> None:
    """In all ways to move a track: moments of the models always, and the same however the looks come."""
    tracker, scans = tracker_for(harbour, config), list(iter_scans(harbour))
    state, _, _ = run(tracker, scans[:150], finish=False)
    whole_and_sure(state.window.tracks)
    saved = state_of_arrays(arrays_of_state(state), tracker)
    state, rows, _ = run(tracker, scans[150:], state)
    _, same, _ = run(tracker, scans[150:], saved)
    whole_and_sure(state.window.tracks)
    np.testing.assert_array_equal(track_rows(rows).position, track_rows(same).position)
    valid = [s.t_look - harbour.sensors[s.sensor].latency for s in scans]
    in_order = [
        dataclasses.replace(scans[i], t_recv=valid[i] + 1.3) for i in np.argsort(valid, kind="stable")
    ]  # the radar comes a second late above, and in its place here
    other, _, _ = run(tracker, in_order)
    a, b = state.window.tracks, other.window.tracks
    n = int(a.live[0])
    assert n == int(b.live[0]) > 1
    for name in ("birth", "mode", "mode_x", "mode_P", "x", "P"):
        np.testing.assert_allclose(getattr(a, name)[:n], getattr(b, name)[:n], rtol=1e-6, atol=1e-6, err_msg=name)
    plain = tracker_for(harbour, dataclasses.replace(config, q_manoeuvre=None, manoeuvre_every=None))
    with pytest.raises(UserError, match="other sensors or settings"):
        state_of_arrays(arrays_of_state(state), plain)


def errors(config: TrackerConfig, runs: int, dt: float = 0.8, looks: int = 75) -> tuple[np.ndarray, np.ndarray]:
    """Return squared position errors (m²) and NEES (runs, looks) of the track nearest to a weaving target."""
    sigma = np.full(7, NAN)
    sigma[4:6] = 3.0
    tracker = Tracker(config, (Sensor("lidar", SensorKind.LIDAR, sigma=sigma),), 2)
    square, nees = np.zeros((runs, looks)), np.zeros((runs, looks))
    for i in range(runs):
        rng, state = np.random.default_rng(i), tracker.init()
        for k in range(looks):
            truth, z, R = weaving(dt * k), np.full((1, 7), NAN), np.full((1, 7, 7), NAN)
            z[0, 4:6], R[0, 4:6, 4:6] = truth + 3.0 * rng.standard_normal(2), 9.0 * np.eye(2)
            state, _ = tracker.step(state, Scan(0, dt * k, dt * k, np.array([dt * k]), z, R, np.array([k])))
            tr = state.window.tracks
            off = tr.x[: tr.live[0], :2] - truth
            at = int(np.argmin((off**2).sum(axis=1)))
            square[i, k] = (off[at] ** 2).sum()
            nees[i, k] = off[at] @ np.linalg.solve(tr.P[at, :2, :2], off[at])
    return square, nees


def test_a_weaving_target() -> None:
    """Between the quiet and the wild model on the straight, nearly the wild one in the turn, and honest in both.

    40 runs of some 35 looks on the straight (11 in the turn), alike over some five: an RMS is good to 4 % (8).
    Measured: 2.2 m against 1.9 and 3.1 on the straight, 3.6 against 6.1 and 3.3 in the turn.
    """
    runs = 40
    alone = [TrackerConfig(q=q, gate_probability=CONFIG.gate_probability, window=0.0) for q in (QUIET, MANOEUVRE)]
    (both, nees), (quiet, off), (wild, _) = (errors(c, runs) for c in (CONFIG, *alone))
    straight, turn = np.r_[15:25, 50:75], np.r_[27:38]  # looks, every 0.8 s; it turns from 20 to 30 s
    rms = {name: (np.sqrt(e[:, straight].mean()), np.sqrt(e[:, turn].mean())) for name, e in
           (("both", both), ("quiet", quiet), ("wild", wild))}  # fmt: skip
    assert rms["both"][0] < 0.84 * rms["wild"][0]
    assert rms["both"][1] < 0.76 * rms["quiet"][1]
    assert rms["both"][1] < 1.25 * rms["wild"][1]
    assert 1.2 < nees[:, straight].mean() < 2.2  # 2 degrees of freedom
    assert nees[:, turn].mean() < 3.6 < off[:, turn].mean()  # it takes a look or two to notice


def test_the_file_switches_it_on(tmp_path: Path) -> None:
    path = tmp_path / "tracker.toml"
    path.write_text(
        "[tracker]\nmanoeuvre_noise_m2_s3 = 4.0\nmanoeuvre_every_s = 30.0\nmanoeuvre_lasts_s = 8.0\n", encoding="utf-8"
    )
    config = read_tracker_config(path, [])
    assert (config.q_manoeuvre, config.manoeuvre_every, config.manoeuvre_lasts) == (4.0, 30.0, 8.0)
    assert Tracker(config, (), 2).init().window.tracks.mode is not None
