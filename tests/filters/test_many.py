"""Tiles of interacting models and of the unscented filter against the filters that they stand for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit

from boresight.errors import UserError
from boresight.filters import ekf, packed, stream
from boresight.filters.imm import InteractingModels
from boresight.filters.many import run_many_imm, run_many_msc, run_many_ukf
from boresight.filters.msc import MscFilter
from boresight.filters.ukf import UnscentedKalman
from boresight.kernels.arctan import exponential
from boresight.kernels.imm import markov
from boresight.kernels.imm_tiles import transitions_of
from boresight.models import Infrared, NearlyConstantVelocity, Radar, SensorPose
from boresight.models.motion import KnownTurn

X0, P0 = np.array([900.0, 700, 300, -30, 10, 2]), np.diag([400.0, 400, 400, 100, 100, 100])
POSE = SensorPose(
    np.array([5.0, -3, 2]), np.zeros(3), np.array([[0.8, 0.48, 0.36], [-0.6, 0.64, 0.48], [0, -0.6, 0.8]])
)
SENSORS = (Radar(5.0, 0.01, 0.01), Infrared(2e-3, 2e-3), Radar(20.0, 0.02, 0.02, pose=POSE))
Problem = tuple[np.ndarray, np.ndarray, list, list[np.ndarray]]


def problem(n: int, k: int, missed: float) -> Problem:
    """Tracks of one path that turns; every track has noise and missed reports of its own."""
    rng = np.random.default_rng(k)
    t, sensors, z = np.cumsum(rng.uniform(0.0, 0.4, k)), [SENSORS[i % 3] for i in range(k)], []
    t[5] = t[4]
    for now, sensor in zip(t, sensors):
        truth = X0.copy()
        truth[:3] += now * X0[3:] + np.array([0.0, 1.5, 0.0]) * now**2
        z.append(sensor.h(truth) + rng.normal(size=(n, sensor.dimension)) * np.sqrt(np.diag(sensor.R(truth))))
        z[-1][rng.random(n) < missed] = np.nan
    return X0 + rng.normal(size=(n, 6)) * np.sqrt(np.diag(P0)), t, sensors, z


def test_exponential() -> None:
    compiled = njit(exponential.py_func)
    for x in np.linspace(-60, 60, 4001):
        assert compiled(x) == pytest.approx(math.exp(x), rel=4e-14)
    assert compiled(-1e300) == pytest.approx(math.exp(-60), rel=4e-14)


def test_transitions_are_those_of_the_markov_chain() -> None:
    models = InteractingModels((NearlyConstantVelocity(1.0), NearlyConstantVelocity(9.0)), (5.0, 2.0))
    dt = np.array([0.0, 1e-6, 0.3, 40.0])
    for P, d in zip(transitions_of(np.array([5.0, 2.0]), dt), dt):
        np.testing.assert_allclose(P, markov(models.rates, d), rtol=1e-12, atol=1e-15)


def test_imm_tiles_equal_the_imm() -> None:
    models = InteractingModels((NearlyConstantVelocity(0.1), NearlyConstantVelocity(20.0)), (5.0, 2.0))
    x0, t, sensors, z = problem(70, 60, 0.0)
    many = run_many_imm(models, 0.0, x0, P0, t, sensors, z, threads=1)
    weights = []
    for i in (0, 33, 69):
        one = models.run(models.init(0.0, x0[i], P0, [0.0, 0.0]), stream.stack(t, sensors, [row[i] for row in z]))
        np.testing.assert_allclose(many.x[i], one.x[-1], rtol=1e-9, atol=1e-8)
        np.testing.assert_allclose(many.P[i], one.P[-1], rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(many.weights[i], one.weights[-1], rtol=1e-7, atol=1e-10)
        weights.append(one.weights[:, 0])
    assert np.ptp(weights) > 0.3  # both models had their say


@pytest.mark.parametrize("scaling", [(1.0, 0.0, 0.0), (0.7, 2.0, 1.0)])
def test_ukf_tiles_equal_the_ukf(scaling: tuple[float, float, float]) -> None:
    ukf, motion = UnscentedKalman(*scaling), NearlyConstantVelocity(2.0)
    x0, t, sensors, z = problem(70, 60, 0.15)
    many = run_many_ukf(ukf, motion, 0.0, x0, P0, t, sensors, z, threads=1)
    plain = packed.run_many(motion, 0.0, x0, P0, t, sensors, z, threads=1)
    for i in (0, 33, 69):
        one = ukf.run(ekf.init(0.0, x0[i], P0), motion, stream.stack(t, sensors, [row[i] for row in z]))
        np.testing.assert_allclose(many.x[i], one.x[-1], rtol=1e-8, atol=1e-7)
        np.testing.assert_allclose(many.P[i], one.P[-1], rtol=1e-7, atol=1e-7)
        assert many.nis[i] == pytest.approx(one.nis.sum(), rel=1e-6)
        assert many.dof[i] == one.dof.sum()
    assert np.abs(many.x - plain.x).max() > 1e-3  # it is not the EKF


def test_msc_tiles_equal_the_msc_filter() -> None:
    """An observer that turns; infrared alone, then range once in a while."""
    rng, k, n, msc = np.random.default_rng(3), 60, 70, MscFilter()
    t = np.cumsum(rng.uniform(0.0, 0.4, k))
    own = np.stack((20 * t, 5 * np.sin(t), np.zeros(k), np.full(k, 20.0), 5 * np.cos(t), np.zeros(k)), axis=1)
    own0 = np.array([0.0, 0, 0, 20, 5, 0])
    sensors, z = [], []
    for i, now in enumerate(t):
        sensors.append((Radar(5.0, 0.01, 0.01) if i % 7 == 6 else Infrared(2e-3, 2e-3)).at(SensorPose(own[i, :3])))
        truth = X0 + np.r_[now * X0[3:], np.zeros(3)]
        noise = rng.normal(size=(n, sensors[i].dimension)) * np.sqrt(np.diag(sensors[i].R(truth)))
        z.append(sensors[i].h(truth) + noise)
        z[-1][rng.random(n) < 0.15] = np.nan
    motion = NearlyConstantVelocity(2.0)
    start = msc.init(0.0, X0, P0, own0)
    many = run_many_msc(
        motion, 0.0, np.tile(start.y, (n, 1)), start.Py, own0, t, sensors, z, own, threads=1
    )  # fmt: skip
    for i in (0, 33, 69):
        one = msc.run(start, motion, stream.stack(t, sensors, [row[i] for row in z]), own)
        error = many.x[i] - one.x[-1]
        error[2] = math.remainder(error[2], 2 * math.pi)
        np.testing.assert_allclose(error, 0.0, atol=1e-9 * np.abs(one.x[-1]).max())
        sigma = np.sqrt(np.diag(one.P[-1]))
        np.testing.assert_allclose(many.P[i] / np.outer(sigma, sigma), one.P[-1] / np.outer(sigma, sigma), atol=1e-8)
        assert many.nis[i] == pytest.approx(one.nis.sum(), rel=1e-6)
        assert many.dof[i] == one.dof.sum()
    with pytest.raises(UserError, match="at the observer"):
        run_many_msc(motion, 0.0, start.y[None], start.Py, own0, t, [SENSORS[1]] * k, [row[:1, -2:] for row in z], own)


def test_mistakes_are_named() -> None:
    x0, t, sensors, z = problem(2, 6, 0.0)
    cv = NearlyConstantVelocity(1.0)
    with pytest.raises(UserError, match="two NearlyConstantVelocity"):
        run_many_imm(InteractingModels((cv, KnownTurn(0.1, 1.0))), 0.0, x0, P0, t, sensors, z)
    with pytest.raises(UserError, match="azimuth, elevation"):
        run_many_ukf(UnscentedKalman(), cv, 0.0, x0, P0, t, [Radar(1.0)] * 6, [row[:, :1] for row in z])
