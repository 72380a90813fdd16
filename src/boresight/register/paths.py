"""Paths of targets on evenly spaced knots."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.types import FloatArray

if TYPE_CHECKING:
    from boresight.register.residuals import Observed

KNOT = 0.5  # s: white acceleration within it moves a target by √(q·KNOT³/3), centimetres for boats
MARGIN = 4.0  # s beyond the reports: room for time offsets


class Path(NamedTuple):
    """One target: position and velocity at the knots."""

    t: FloatArray  # (n,) s
    x: FloatArray  # (n, 2d) world ENU m, m/s


def interval(t: FloatArray, times: FloatArray) -> NDArray[np.int64]:
    """Return the knot at or before each of `times` (m,) of knots `t` (n,), clipped to the path."""
    out: NDArray[np.int64] = np.clip(((times - t[0]) / KNOT).astype(np.int64), 0, len(t) - 2)
    return out


def first_path(observed: Observed, track: int, d: int, q: float) -> Path:
    """Return the path to begin from: the fixes of the track's ranging reports, smoothed over some seconds."""
    mine = observed.track == track
    t = observed.t[mine]
    knots = np.arange(t.min() - MARGIN, t.max() + MARGIN + KNOT, KNOT)
    fixes = observed.fix[mine][:, :d]
    have = np.isfinite(fixes).all(axis=1)
    x = np.zeros((len(knots), 2 * d))
    tf, p = t[have], fixes[have]
    for k, now in enumerate(knots):
        w = np.exp(-0.5 * ((tf - now) / 6.0) ** 2) + 1e-12 / (1.0 + (tf - now) ** 2)
        m = float(w @ tf / w.sum())
        spread = float(w @ (tf - m) ** 2 / w.sum())
        mean = w @ p / w.sum()
        slope = (w * (tf - m)) @ (p - mean) / w.sum() / (spread + 1.0)
        x[k] = np.r_[mean + slope * np.clip(now - m, -5.0, 5.0), slope]
    return Path(knots, x)
