"""IMM: one model is that filter; the stream is the steps; mixing keeps the total moments; unequal dimensions work."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.linalg import expm

from boresight.errors import UserError
from boresight.filters import ekf, stream
from boresight.filters.imm import InteractingModels
from boresight.kernels import imm
from boresight.models import (
    CoordinatedTurn,
    Infrared,
    NearlyConstantAcceleration,
    NearlyConstantVelocity,
    Position,
    Radar,
    Singer,
)

X0, P0 = np.array([500.0, 300, 40, 10, -5, 0]), np.diag([100.0, 100, 100, 25, 25, 25])


def reports(rng: np.random.Generator, k: int = 80) -> tuple[np.ndarray, list, list]:
    t = np.cumsum(rng.uniform(0.0, 0.5, k))
    sensors = [Radar(3.0, 0.01, 0.01) if i % 3 else Infrared(0.003, 0.003) for i in range(k)]
    path = [np.array([500 + 10 * s, 300 + 40 * np.sin(0.2 * s), 40.0, 0, 0, 0]) for s in t]
    z = [s.h(x) + rng.normal(size=s.dimension) * np.sqrt(np.diag(s.R(x))) for s, x in zip(sensors, path)]
    return t, sensors, z


def test_one_model_is_that_filter() -> None:
    t, sensors, z = reports(np.random.default_rng(1))
    motion = NearlyConstantVelocity(q=0.5)
    one = InteractingModels((motion,)).run(
        InteractingModels((motion,)).init(0.0, X0, P0, [0.0]), stream.stack(t, sensors, z)
    )
    plain = stream.run(ekf.init(0.0, X0, P0), motion, stream.stack(t, sensors, z))
    np.testing.assert_allclose(one.x, plain.x, rtol=1e-12)
    np.testing.assert_allclose(one.P, plain.P, rtol=1e-11, atol=1e-12)


def test_two_equal_models_are_that_filter() -> None:
    t, sensors, z = reports(np.random.default_rng(2))
    motion = NearlyConstantAcceleration(q=0.5)
    two = InteractingModels((motion, motion), sojourn=(3.0, 8.0))
    out = two.run(two.init(0.0, X0, P0, [2.0, 2.0]), stream.stack(t, sensors, z))
    P = np.diag([*np.diag(P0), 4.0, 4.0, 4.0])
    plain = stream.run(ekf.init(0.0, np.r_[X0, 0, 0, 0], P), motion, stream.stack(t, sensors, z))
    np.testing.assert_allclose(out.x, plain.x[:, :6], rtol=1e-10)


def test_stream_equals_step_by_step_with_unequal_dimensions() -> None:
    t, sensors, z = reports(np.random.default_rng(3))
    models = InteractingModels(
        (NearlyConstantVelocity(0.1), CoordinatedTurn(0.1, 1e-3), NearlyConstantAcceleration(0.01), Singer(5.0, 1.0)),
        5.0,
    )
    state = models.init(0.0, X0, P0, [0.0, 0.1, 1.0, 1.0])
    out = models.run(state, stream.stack(t, sensors, z))
    for k, now in enumerate(t):
        state, _ = models.update(models.predict(state, now), sensors[k], z[k])
        np.testing.assert_allclose(out.x[k], state.x, rtol=1e-10)
        np.testing.assert_allclose(out.weights[k], state.weights, rtol=1e-7)
        assert np.linalg.eigvalsh(state.P)[0] > 0.0


def test_weights_go_to_the_model_that_moves_like_the_target() -> None:
    t = np.arange(1, 60) * 0.5
    rng = np.random.default_rng(4)
    path = np.array([[0.5 * 3 * s * s, 100.0, 0.0] for s in t])
    models = InteractingModels((NearlyConstantVelocity(0.01), NearlyConstantAcceleration(0.01)), 20.0)
    start = models.init(0.0, np.array([0.0, 100, 0, 0, 0, 0]), P0, [0.0, 5.0])
    out = models.run(start, stream.stack(t, [Position(1.0)] * len(t), list(path + rng.normal(size=path.shape))))
    assert out.weights[-1, 1] > 0.9


def test_mixing_keeps_mean_and_covariance_of_the_whole() -> None:
    rng = np.random.default_rng(5)
    X = rng.normal(size=(3, 4))
    P = np.array([np.eye(4) * (j + 1) for j in range(3)])
    weights, sizes, labels = np.array([0.2, 0.5, 0.3]), np.array([4, 4, 4]), np.tile(np.arange(4), (3, 1))
    rates = np.array([[-0.2, 0.1, 0.1], [0.3, -0.5, 0.2], [0.05, 0.05, -0.1]])
    transition = imm.markov(rates, 2.5)
    np.testing.assert_allclose(transition, expm(rates * 2.5), rtol=1e-12)
    before = imm.combine(weights, X, P, 4)
    predicted, X, P = imm.mix(weights, transition, X, P, sizes, labels)
    np.testing.assert_allclose(predicted, weights @ transition, rtol=1e-12)
    after = imm.combine(predicted, X, P, 4)
    np.testing.assert_allclose(after[0], before[0], rtol=1e-12)
    np.testing.assert_allclose(after[1], before[1], rtol=1e-12)


@pytest.mark.parametrize("lag", [None, 0.0, 2.0])
def test_one_model_smooths_as_that_models_smoother(lag: float | None) -> None:
    t, sensors, z = reports(np.random.default_rng(6))
    motion, laid = NearlyConstantVelocity(q=0.5), stream.stack(t, sensors, z)
    one = InteractingModels((motion,))
    out = one.smooth(one.run(one.init(0.0, X0, P0, [0.0]), laid, keep=True), lag)
    x, P = stream.smooth(stream.run(ekf.init(0.0, X0, P0), motion, laid), lag)
    np.testing.assert_allclose(out.x, x, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(out.P, P, rtol=1e-9, atol=1e-9)


def every_sequence(
    models: InteractingModels, t: np.ndarray, sensor: Position, z: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the exact smoothed means (k, 6) and weights (k, r): the smoother of every sequence of models, summed."""
    r, steps = len(models.motions), np.diff(t, prepend=0.0)
    logs, means, taken = [], [], []
    for sequence in itertools.product(range(r), repeat=len(t)):
        state, before, log = ekf.init(0.0, X0, P0), np.full(r, 1.0 / r), 0.0
        x, P, xp, Pp, F = [], [], [], [], []
        for k, j in enumerate(sequence):
            log += np.log((before @ expm(models.rates * steps[k]))[j])
            before = np.eye(r)[j]
            F.append(models.motions[j].F(state.x, steps[k]))
            state = ekf.predict(state, models.motions[j], t[k])
            xp.append(state.x), Pp.append(state.P)
            state, info = ekf.update(state, sensor, z[k])
            x.append(state.x), P.append(state.P)
            log += info.log_likelihood
        for k in range(len(t) - 2, -1, -1):  # textbook recursion of the means
            x[k] = x[k] + P[k] @ F[k + 1].T @ np.linalg.solve(Pp[k + 1], x[k + 1] - xp[k + 1])
        logs.append(log), means.append(x), taken.append(np.eye(r)[list(sequence)])
    share = np.exp(np.array(logs) - max(logs))
    share /= share.sum()
    return np.tensordot(share, np.array(means), 1), np.tensordot(share, np.array(taken), 1)


def test_smoother_is_near_the_exact_one() -> None:
    """A target that begins to swerve: the sum over all 2⁶ sequences is exact, and hopeless for more reports."""
    t = np.arange(1, 7) * 1.0
    path = [np.array([500 + 40 * s + 6 * max(s - 4, 0) ** 2, 300 + 10 * s, 40 - 5 * s]) for s in t]
    sensor = Position(4.0)
    models = InteractingModels((NearlyConstantVelocity(0.1), NearlyConstantVelocity(60.0)), 5.0)
    squares = []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        z = [p + 4.0 * rng.normal(size=3) for p in path]
        exact, _ = every_sequence(models, t, sensor, z)
        run = models.run(models.init(0.0, X0, P0, [0.0, 0.0]), stream.stack(t, [sensor] * len(t), z), keep=True)
        out = models.smooth(run)
        variance = np.diagonal(out.P, axis1=1, axis2=2)
        squares.append([np.mean((x - exact) ** 2 / variance) for x in (run.x, out.x)])
    filtered, smoothed = np.sqrt(np.mean(squares, axis=0))
    assert filtered > 0.9  # σ: what there is to gain
    assert smoothed < 0.15  # σ: what one Gaussian per model costs


def test_smoother_of_unequal_dimensions_is_positive_definite_and_lag_grows_to_all() -> None:
    t, sensors, z = reports(np.random.default_rng(8))
    models = InteractingModels(
        (NearlyConstantVelocity(0.1), CoordinatedTurn(0.1, 1e-3), NearlyConstantAcceleration(0.01)), 5.0
    )
    run = models.run(models.init(0.0, X0, P0, [0.0, 0.1, 1.0]), stream.stack(t, sensors, z), keep=True)
    whole, none, some = models.smooth(run), models.smooth(run, 0.0), models.smooth(run, 3.0)
    np.testing.assert_array_equal(models.smooth(run, 1e9).x, whole.x)
    np.testing.assert_allclose(none.x, run.x, rtol=1e-12)
    for out in (whole, some):
        assert np.linalg.eigvalsh(out.P).min() > 0.0
        np.testing.assert_array_equal(out.P, np.swapaxes(out.P, 1, 2))
        np.testing.assert_allclose(out.weights.sum(axis=1), 1.0, rtol=1e-12)
    truth = np.array([[500 + 10 * s, 300 + 40 * np.sin(0.2 * s), 40.0] for s in t])
    error = [np.sqrt(np.mean((out.x[:, :3] - truth) ** 2)) for out in (run, some, whole)]
    assert error[0] > 1.2 * max(error[1:])


def test_mistakes_are_named() -> None:
    one = InteractingModels((NearlyConstantVelocity(1.0),))
    out = one.run(one.init(0.0, X0, P0, [0.0]), stream.stack([1.0], [Position(1.0)], [np.zeros(3)]))
    with pytest.raises(UserError, match="keep=True"):
        one.smooth(out)
    with pytest.raises(UserError, match="at least one motion model"):
        InteractingModels(())
    with pytest.raises(UserError, match="same number of dimensions"):
        InteractingModels((NearlyConstantVelocity(1.0), NearlyConstantVelocity(1.0, 2)))
    with pytest.raises(UserError, match="sojourn must be a positive"):
        InteractingModels((NearlyConstantVelocity(1.0),), sojourn=-1.0)
    with pytest.raises(UserError, match="prior must hold 6"):
        InteractingModels((NearlyConstantVelocity(1.0),)).init(0.0, np.zeros(9), np.eye(9), [0.0])
