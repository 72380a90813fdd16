"""Learned noise: wrong q and wrong R are found, a manoeuvre is not taken for noise, stream equals steps."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.errors import UserError
from boresight.filters import stream
from boresight.filters.adaptive import AdaptiveNoise
from boresight.models import Infrared, NearlyConstantVelocity, Radar

P0 = np.diag([100.0, 100, 100, 25, 25, 25])


def scene(rng: np.random.Generator, path, k: int = 1500, noise: float = 1.0):  # type: ignore[no-untyped-def]
    """Radar and infrared in turn, 20 Hz in all; `noise` multiplies the radar's sigmas."""
    t = np.arange(1, k + 1) * 0.05
    sensors = [Radar(2.0, 0.005, 0.005) if i % 2 else Infrared(0.002, 0.002) for i in range(k)]
    z = []
    for i, now in enumerate(t):
        factor = noise if i % 2 else 1.0
        R = np.diag(sensors[i].R(np.zeros(6)))
        z.append(sensors[i].h(np.r_[path(now), 0, 0, 0]) + factor * rng.normal(size=len(R)) * np.sqrt(R))
    return stream.stack(t, sensors, z), np.arange(k) % 2, sensors, z


def straight(t: float) -> np.ndarray:
    return np.array([500 + 15 * t, 300 - 5 * t, 50.0])


def jinking(t: float) -> np.ndarray:
    return np.array([500 + 15 * t, 300 + 40 * np.sin(0.6 * t), 50.0])


@pytest.mark.parametrize("noise", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("path", [straight, jinking])
def test_measurement_noise_is_found_whatever_the_target_does(noise: float, path) -> None:  # type: ignore[no-untyped-def]
    reports, index, _, _ = scene(np.random.default_rng(1), path, noise=noise)
    adaptive = AdaptiveNoise(NearlyConstantVelocity(0.5))
    _, scale = adaptive.run(adaptive.init(0.0, np.r_[path(0.0), 15, -5, 0], P0, 2), reports, index)
    # a memory of 200 reports leaves a variance with a relative deviation of sqrt(2/400) = 7 %, and the first-order
    # separation from the motion some more (the infrared beside it is the sharper one): a factor of 1.7 either way
    assert np.abs(np.log(scale[1, :3] / noise**2)).max() < np.log(1.7), scale
    assert np.abs(np.log(scale[0, 1:3])).max() < np.log(1.7), scale


def test_process_noise_is_found() -> None:
    """A target that truly wanders with q = 3, declared 0.03 and 300."""
    rng = np.random.default_rng(2)
    motion = NearlyConstantVelocity(3.0)
    x, path = np.array([500.0, 300, 50, 10, 0, 0]), []
    _, F, Q = motion.move(x, 0.05)
    root = np.linalg.cholesky(Q)
    for _ in range(1600):
        x = F @ x + root @ rng.normal(size=6)
        path.append(x[:3])
    reports, index, sensors, z = scene(rng, lambda t: path[round(t / 0.05)])
    for declared in (0.03, 300.0):
        adaptive = AdaptiveNoise(NearlyConstantVelocity(declared), memory=0)
        state = adaptive.init(0.0, np.r_[path[0], 10, 0, 0], P0, 2)
        levels = []
        for k in range(1500):
            state, _ = adaptive.update(adaptive.predict(state, reports.t[k]), int(index[k]), sensors[k], z[k])
            levels.append(adaptive.q(state))
            if k == 300:
                break
        out, _ = adaptive.run(adaptive.init(0.0, np.r_[path[0], 10, 0, 0], P0, 2), reports, index)
        np.testing.assert_allclose(out.x[300], state.mixture.x, rtol=1e-9)
        levels = np.exp(out.weights[500:] @ np.log([m.q for m in adaptive.bank.motions]))
        assert 1.0 < np.exp(np.mean(np.log(levels))) < 9.0  # half-decade levels: within a factor of three


def test_steps_equal_the_stream_with_learned_noise() -> None:
    reports, index, sensors, z = scene(np.random.default_rng(3), jinking, k=60, noise=2.0)
    adaptive = AdaptiveNoise(NearlyConstantVelocity(0.5), q_factors=(0.1, 1.0, 10.0), memory=20)
    state = adaptive.init(0.0, np.r_[jinking(0.0), 15, -5, 0], P0, 2)
    out, scale = adaptive.run(state, reports, index)
    for k in range(60):
        state, _ = adaptive.update(adaptive.predict(state, reports.t[k]), int(index[k]), sensors[k], z[k])
    np.testing.assert_allclose(out.x[-1], state.mixture.x, rtol=1e-9)
    np.testing.assert_allclose(scale, state.scale, rtol=1e-9)


def test_a_sudden_manoeuvre_is_not_locked_out() -> None:
    """Straight for 40 s, then 3 g: the track follows, though R and q were learned in quiet flight."""

    def path(t: float) -> np.ndarray:
        return straight(t) + np.array([0.0, 15.0 * max(0.0, t - 40.0) ** 2, 0.0])

    reports, index, _, _ = scene(np.random.default_rng(4), path, k=1000)
    adaptive = AdaptiveNoise(NearlyConstantVelocity(0.5))
    out, _ = adaptive.run(adaptive.init(0.0, np.r_[straight(0.0), 15, -5, 0], P0, 2), reports, index)
    error = np.linalg.norm(out.x[:, :3] - [path(t) for t in out.t], axis=1)
    assert error[out.t > 42.0].max() < 25.0
    assert error[-1] < 15.0


def test_mistakes_are_named() -> None:
    with pytest.raises(UserError, match="at least 10 reports"):
        AdaptiveNoise(NearlyConstantVelocity(1.0), memory=3)
    with pytest.raises(UserError, match="q factor"):
        AdaptiveNoise(NearlyConstantVelocity(1.0), q_factors=(0.0,))
    with pytest.raises(UserError, match="limit"):
        AdaptiveNoise(NearlyConstantVelocity(1.0), limit=0.5)
