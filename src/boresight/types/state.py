"""States in and out of every filter."""

from __future__ import annotations

from typing import NamedTuple

from boresight.types.sensor import FloatArray


class GaussianState(NamedTuple):
    """A Gaussian belief at one time: what `predict` and `update` take and give."""

    t: float  # s
    x: FloatArray  # (n,) SI, world ENU unless the motion model says otherwise; position first, then velocity
    P: FloatArray  # (n, n)


class UpdateInfo(NamedTuple):
    """What one update saw."""

    y: FloatArray  # innovation (m,), angles wrapped
    S: FloatArray  # its covariance (m, m)
    nis: float  # y' S^-1 y, chi-square with m degrees of freedom if consistent
    log_likelihood: float  # log N(y; 0, S)


class Pose(NamedTuple):
    """Where a platform is and how it is turned at times `t`; a scalar time gives arrays without the leading axis."""

    t: FloatArray  # (...,) s
    position: FloatArray  # (..., 3) world ENU m
    velocity: FloatArray  # (..., 3) world ENU m/s
    enu_from_body: FloatArray  # (..., 3, 3) rotation, FRD body to ENU
