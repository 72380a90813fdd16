"""An azimuth-elevation mount: mechanical limits, winding, slew rates, and passes through its keyhole."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from boresight.errors import UserError
from boresight.frames.tangent import separation
from boresight.types.sensor import FloatArray

TURN = 2.0 * math.pi
Mask = tuple[tuple[float, float], ...]  # corners (azimuth, elevation) (rad) of a horizon


class MountState(NamedTuple):
    """Where the mount stands (rad): azimuth is not wrapped, it counts the winding."""

    azimuth: float
    elevation: float


class PassPlan(NamedTuple):
    """How a mount follows a pass."""

    azimuth: FloatArray  # (n,) rad, commanded, not wrapped
    elevation: FloatArray  # (n,) rad
    error: FloatArray  # (n,) rad on the sphere between commanded and wanted
    keyhole: NDArray[np.bool_]  # (n,) where azimuth would have to turn faster than it can
    wound: bool  # the whole pass fits the azimuth's range without unwinding on the way


@dataclass(frozen=True, slots=True)
class Mount:
    """Stops (rad) and slew rates (rad/s). `mask` holds the horizon as (azimuth, elevation) corners (rad).

    The stops are where the mount can go, the mask is what the antenna can see: a command may pass below the mask,
    never beyond a stop. Raises UserError for stops in the wrong order.
    """

    azimuth: tuple[float, float] = (-1.5 * math.pi, 1.5 * math.pi)
    elevation: tuple[float, float] = (0.0, 0.5 * math.pi)
    azimuth_rate: float = math.radians(10.0)
    elevation_rate: float = math.radians(10.0)
    mask: Mask = ()

    def __post_init__(self) -> None:
        if not (self.azimuth[0] < self.azimuth[1] and self.elevation[0] < self.elevation[1]):
            raise UserError("mount: a lower stop lies above the upper one")
        if not (self.azimuth_rate > 0 and self.elevation_rate > 0):
            raise UserError("mount: slew rates must be above zero")

    def reach(self, azimuth: float, elevation: float, near: float) -> MountState:
        """Return the allowed position for a direction: the winding nearest to azimuth `near`, held at the stops."""
        low, high = self.azimuth
        azimuth = math.remainder(azimuth, TURN)
        first = azimuth + TURN * math.ceil((low - azimuth) / TURN - 1e-12)
        turns = [first + TURN * k for k in range(int(max(high - first, 0.0) // TURN) + 1) if first + TURN * k <= high]
        if turns:
            best = min(turns, key=lambda a: abs(a - near))
        else:  # no winding reaches it: the stop that is nearer on the circle
            best = min((low, high), key=lambda a: abs(math.remainder(a - azimuth, TURN)))
        return MountState(min(max(best, low), high), min(max(elevation, self.elevation[0]), self.elevation[1]))

    def step(self, state: MountState, azimuth: float, elevation: float, dt: float) -> MountState:
        """Return the next command on the way to a direction: within the stops and what can be slewed in `dt` (s)."""
        if not (math.isfinite(azimuth) and math.isfinite(elevation)):
            return state
        goal = self.reach(azimuth, elevation, state.azimuth)
        a = _towards(state.azimuth, goal.azimuth, self.azimuth_rate * dt)
        e = _towards(state.elevation, goal.elevation, self.elevation_rate * dt)
        return MountState(
            min(max(a, self.azimuth[0]), self.azimuth[1]), min(max(e, self.elevation[0]), self.elevation[1])
        )

    def foresee(
        self, late: MountState, azimuth: FloatArray, elevation: FloatArray, spacing: float, dt: float
    ) -> tuple[MountState, MountState]:
        """Return a follower's next position and the command, for directions (n,) (rad) from now, `spacing` (s) apart.

        `plan`, tick by tick: `late` follows without looking ahead; the command is the mean of it and of where azimuth
        must be by now if it is to be in time for all that comes. Where the winding runs out, it is the follower's.
        """
        late = self.step(late, float(azimuth[0]), float(elevation[0]), dt)
        if not np.isfinite(azimuth).all():
            return late, late
        wanted = np.unwrap(azimuth)
        wanted += self.reach(float(azimuth[0]), 0.0, late.azimuth).azimuth - wanted[0]
        if wanted.min() < self.azimuth[0] or wanted.max() > self.azimuth[1]:
            return late, late
        early = float(_limited(wanted[::-1], np.full(len(wanted) - 1, self.azimuth_rate * spacing))[-1])
        return late, MountState(0.5 * (late.azimuth + early), late.elevation)

    def visible(self, azimuth: FloatArray, elevation: FloatArray) -> NDArray[np.bool_]:
        """Return (n,) whether directions stand above the horizon mask (linear between its corners) or 0°."""
        return np.asarray(np.asarray(elevation) >= horizon_at(self.mask, azimuth))

    def plan(self, t: FloatArray, azimuth: FloatArray, elevation: FloatArray) -> PassPlan:
        """Return how to follow directions (n,) (rad) at ascending times: the winding chosen for the whole pass.

        Through the keyhole about the zenith azimuth turns at its full rate, begun early enough that the error is the
        same on both sides: the mean of following late (forwards in time) and early (backwards).
        """
        wanted = np.unwrap(np.asarray(azimuth, dtype=np.float64))
        low, high = self.azimuth
        shifts = TURN * np.arange(math.floor((low - wanted.max()) / TURN), math.ceil((high - wanted.min()) / TURN) + 1)
        spill = [
            float(np.maximum(low - (wanted + s), 0).max() + np.maximum(wanted + s - high, 0).max()) for s in shifts
        ]
        middle = 0.5 * (low + high)
        best = min(range(len(shifts)), key=lambda i: (spill[i], abs(float(np.mean(wanted)) + shifts[i] - middle)))
        wanted = wanted + shifts[best]
        dt = np.diff(t)
        late = _limited(wanted, self.azimuth_rate * dt)
        early = _limited(wanted[::-1], self.azimuth_rate * dt[::-1])[::-1]
        a = np.clip(0.5 * (late + early), low, high)
        high_enough = np.clip(elevation, *self.elevation)
        late = _limited(high_enough, self.elevation_rate * dt)
        e = 0.5 * (late + _limited(high_enough[::-1], self.elevation_rate * dt[::-1])[::-1])
        fast = np.zeros(len(t), dtype=bool)
        fast[1:] = np.abs(np.diff(wanted)) > self.azimuth_rate * dt * (1 + 1e-9)
        error = separation(_directions(a, e), _directions(wanted, np.asarray(elevation)))
        return PassPlan(a, e, error, fast, spill[best] < 1e-12)


def horizon_at(mask: Mask, azimuth: ArrayLike) -> FloatArray:
    """Return the elevation (rad) of the horizon at azimuths (rad): linear between the mask's corners, 0 without any."""
    if not mask:
        return np.zeros(np.shape(azimuth))
    corners = np.array(sorted((a % TURN, e) for a, e in mask))
    return np.asarray(np.interp(np.mod(azimuth, TURN), corners[:, 0], corners[:, 1], period=TURN), dtype=np.float64)


def _towards(here: float, there: float, most: float) -> float:
    return here + min(max(there - here, -most), most)


def _limited(wanted: FloatArray, most: FloatArray) -> FloatArray:
    out = wanted.copy()
    for i in range(1, len(out)):
        out[i] = _towards(out[i - 1], wanted[i], most[i - 1])
    return out


def _directions(azimuth: FloatArray, elevation: FloatArray) -> FloatArray:
    c = np.cos(elevation)
    return np.stack([c * np.sin(azimuth), c * np.cos(azimuth), np.sin(elevation)], axis=-1)
