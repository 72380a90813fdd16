"""A user's own models through the packed filter: the same as through the general stream."""

from __future__ import annotations

import numpy as np
import pytest
from tests.models.test_own import PRIOR, bearing_and_range, bearing_and_range_H, drag, drag_F, drag_Q

from boresight.errors import UserError
from boresight.filters import ekf, own, stream
from boresight.kernels.own import BACKWARDS
from boresight.models import Infrared, NearlyConstantVelocity, Radar
from boresight.models.motion import KnownTurn, Singer
from boresight.models.own import own_motion, own_sensor


@pytest.mark.parametrize("correlated", [False, True])
def test_own_models_equal_the_general_stream(correlated: bool) -> None:
    rng = np.random.default_rng(1)
    R = np.array([[1e-4, 5e-3 if correlated else 0.0], [5e-3 if correlated else 0.0, 4.0]])
    sensor = own_sensor(bearing_and_range, R, parameters=(10.0, -20.0), angles=(0,), H=bearing_and_range_H)
    motion = own_motion(drag, drag_Q, state_dimension=6, parameters=(0.1, 0.5), F=drag_F)
    t = np.cumsum(rng.uniform(0.05, 0.3, 100))
    z = [bearing_and_range(PRIOR.x, (10.0, -20.0)) + rng.normal(size=2) * [1e-2, 2.0] for _ in t]
    z[3][0] = np.nan
    expected = stream.run(PRIOR, motion, stream.stack(t, [sensor] * 100, z))
    belief, used, kept, nis = own.pack(PRIOR, motion), own.models(motion, sensor), np.empty((100, 42)), np.empty(100)
    own.run(belief, used, own.table(t, [sensor] * 100, z), kept, nis)
    np.testing.assert_allclose(kept[:, :6], expected.x, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(kept[:, 6:].reshape(-1, 6, 6), expected.P, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(nis, expected.nis, rtol=1e-8)
    one = own.pack(PRIOR, motion)
    for k in range(100):
        assert own.step(one, own.report(sensor, t[k], z[k]), used.motion, used.observe) == pytest.approx(nis[k])
    np.testing.assert_allclose(one, belief, rtol=1e-12)
    np.testing.assert_array_equal(own.unpack(belief).P, own.unpack(belief).P.T)
    assert own.step(one, own.report(sensor, -5.0, z[0]), used.motion, used.observe) == BACKWARDS


def test_built_in_kernels_go_the_same_way() -> None:
    """Two sensors of one kernel, a motion that is not nearly constant velocity."""
    motion = KnownTurn(rate=0.1, q=0.3)
    sensors = [Radar(5.0, 0.01, 0.01), Infrared(2e-3, 2e-3)]
    rng = np.random.default_rng(2)
    t = 0.1 * np.arange(1, 61)
    z = [sensors[k % 2].h(PRIOR.x) + 1e-3 * rng.normal(size=3 - k % 2) for k in range(60)]
    those = [sensors[k % 2] for k in range(60)]
    expected = stream.run(PRIOR, motion, stream.stack(t, those, z))
    belief = own.pack(PRIOR, motion)
    own.run(belief, own.models(motion, sensors[0]), own.table(t, those, z))
    np.testing.assert_allclose(own.unpack(belief).x, expected.x[-1], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(own.unpack(belief).P, expected.P[-1], rtol=1e-9, atol=1e-9)


def test_mistakes_are_named() -> None:
    sensor = Radar(5.0)
    with pytest.raises(UserError, match="6 states, not 9"):
        own.models(Singer(10.0, 1.0), sensor)
    with pytest.raises(UserError, match="6 states, not 4"):
        own.pack(ekf.init(0.0, np.zeros(4), np.eye(4)), NearlyConstantVelocity(1.0, 2))
    motion = NearlyConstantVelocity(1.0)
    with pytest.raises(UserError, match="cannot go past report 1"):
        own.run(
            own.pack(PRIOR, motion),
            own.models(motion, sensor),
            own.table([1.0, 0.5], [sensor] * 2, [np.array([300.0])] * 2),
        )
