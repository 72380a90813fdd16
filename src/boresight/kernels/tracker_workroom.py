"""Arrays in which the tracker's small functions hand each other their results."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from boresight.kernels.registration import N_PARAMETERS
from boresight.kernels.tracker import IntArray
from boresight.types.sensor import FloatArray


class Workroom(NamedTuple):
    """Arrays that one update after another writes over; n states."""

    z: FloatArray  # (7,)
    H: FloatArray  # (7, n)
    h6: FloatArray  # (7, 6)
    y: FloatArray  # (7,)
    S: FloatArray  # (7, 7)
    PHt: FloatArray  # (n, 7)
    mask: IntArray  # (7,)
    sight: FloatArray  # (2, 3)
    fix: FloatArray  # (3,)
    G: FloatArray  # (3, n)
    L: FloatArray  # (3, 3)
    W: FloatArray  # (3, 3)
    v: FloatArray  # (3,)
    errors: FloatArray  # (7, 5) the components by the sensor's constant errors
    C: FloatArray  # (3, 5) the world position by them
    logs: FloatArray  # (32,) of the components


def workroom(n: int) -> Workroom:
    """Return the arrays for states of length n."""
    return Workroom(
        np.empty(7),
        np.zeros((7, n)),
        np.empty((7, 6)),
        np.empty(7),
        np.empty((7, 7)),
        np.empty((n, 7)),
        np.empty(7, np.int64),
        np.zeros((2, 3)),
        np.empty(3),
        np.empty((3, n)),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty(3),
        np.empty((7, N_PARAMETERS)),
        np.empty((3, N_PARAMETERS)),
        np.empty(32),
    )
