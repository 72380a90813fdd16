"""The paper's listing, as printed: what it does to time, to Q, to R. For comparison only.

Mended only where it cannot run at all: it begins at the prior, not at zero (there the Jacobian is 0/0), and leaves out
the temperature, which has no state. Kept: infrared rows taken by the radar's row number (so 50 ms apart are taken for
100 ms), Q = diag(0.1, 0.1, 0.1, 0.5, 0.5, 0.5) at every step of 0.1 s, R = diag(1, 0.01, 0.01) and diag(0.01, 0.01) -
degrees squared against radians.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from boresight.filters.stream import Reports
from boresight.models import Infrared, Radar
from boresight.papers.async_ekf.scenario import IR_PHASE, Data
from boresight.types.sensor import FloatArray

RADAR_PRINTED = Radar(1.0, 0.1, 0.1)
IR_PRINTED = Infrared(0.1, 0.1)
PARAMETERS = np.zeros(1)


@njit(cache=True)
def motion_printed(
    x: FloatArray, dt: float, parameters: FloatArray, x_out: FloatArray, F: FloatArray, Q: FloatArray
) -> None:
    """Constant velocity with the listing's fixed Q; nothing at all over no time."""
    for i in range(6):
        x_out[i] = x[i] + (dt * x[3 + i] if i < 3 else 0.0)
        for j in range(6):
            F[i, j] = 1.0 if i == j else dt if j == i + 3 else 0.0
            Q[i, j] = 0.0
        if dt > 0.0:
            Q[i, i] = 0.1 if i < 3 else 0.5


def interpolated(data: Data, run: int) -> FloatArray:
    """Return infrared (n, 2) interpolated to the radar's times: it needs the sample after, so it is not causal."""
    ir = ~data.is_radar
    t, t_radar = data.t[ir], data.t[data.is_radar]
    azimuth, elevation = np.unwrap(data.z[run][ir, 1]), data.z[run][ir, 2]
    return np.stack([np.interp(t_radar, t, azimuth), np.interp(t_radar, t, elevation)], axis=1)


def by_row(data: Data, run: int) -> FloatArray:
    """Return infrared (n, 2) by the radar's row number, as the listing does."""
    n = int(data.is_radar.sum())
    assert data.t[~data.is_radar][0] == IR_PHASE
    return np.asarray(data.z[run][~data.is_radar, 1:3][:n])


def paired(data: Data, run: int, infrared: FloatArray, radar: Radar, ir: Infrared) -> Reports:
    """Return the radar's reports, each followed by an infrared report given the same time."""
    t = data.t[data.is_radar]
    z = np.full((2 * len(t), 7), np.nan)
    z[::2] = data.z[run][data.is_radar]
    z[1::2, 1:3] = infrared
    context = np.tile(np.array([radar.context, ir.context]), (len(t), 1))
    return Reports(np.repeat(t, 2), z, context, Radar.kernel)
