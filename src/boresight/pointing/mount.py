"""An azimuth-elevation mount: mechanical limits, winding, slew rates, and passes through its keyhole."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
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


class Way(StrEnum):
    """How a mount whose elevation reaches beyond the zenith follows a pass."""

    UPRIGHT = "upright"  # elevation up to 90°
    FLIPPED = "flipped"  # azimuth half a turn round, elevation from 90° on
    OVER = "over the top"  # upright to the culmination, flipped from there


class PassPlan(NamedTuple):
    """How a mount follows a pass."""

    azimuth: FloatArray  # (n,) rad, commanded, not wrapped
    elevation: FloatArray  # (n,) rad
    error: FloatArray  # (n,) rad on the sphere between commanded and wanted
    keyhole: NDArray[np.bool_]  # (n,) where azimuth would have to turn faster than it can
    wound: bool  # the whole pass fits the azimuth's range without unwinding on the way
    way: Way = Way.UPRIGHT


@dataclass(frozen=True, slots=True)
class Mount:
    """Stops (rad) and slew rates (rad/s). `mask` holds the horizon as (azimuth, elevation) corners (rad).

    A mount whose elevation goes beyond 90° can flip: it also points at a direction with azimuth half a turn round and
    elevation counted on from the zenith. The stops are where the mount can go, the mask is what the antenna can see: a
    command may pass below the mask, never beyond a stop. Raises UserError for stops in the wrong order, for an
    elevation beyond -90° or 180°, and for numbers that are not finite.
    """

    azimuth: tuple[float, float] = (-1.5 * math.pi, 1.5 * math.pi)
    elevation: tuple[float, float] = (0.0, 0.5 * math.pi)
    azimuth_rate: float = math.radians(10.0)
    elevation_rate: float = math.radians(10.0)
    mask: Mask = ()

    def __post_init__(self) -> None:
        numbers = (
            *self.azimuth,
            *self.elevation,
            self.azimuth_rate,
            self.elevation_rate,
            *(v for c in self.mask for v in c),
        )
        if not all(map(math.isfinite, numbers)):
            raise UserError("mount: a stop, rate or corner of the horizon is no finite number")
        if not (self.azimuth[0] < self.azimuth[1] and self.elevation[0] < self.elevation[1]):
            raise UserError("mount: a lower stop lies above the upper one")
        if not (self.elevation[0] >= -0.5 * math.pi - 1e-9 and self.elevation[1] <= math.pi + 1e-9):
            raise UserError("mount: the stops of elevation must lie between -90° and 180°")
        if not all(abs(e) <= 0.5 * math.pi for _, e in self.mask):
            raise UserError("mount: the horizon must lie between -90° and 90°")
        if not (self.azimuth_rate > 0 and self.elevation_rate > 0):
            raise UserError("mount: slew rates must be above zero")

    @property
    def flips(self) -> bool:
        """Whether elevation goes beyond the zenith."""
        return self.elevation[1] > 0.5 * math.pi + 1e-9

    def reach(self, azimuth: float, elevation: float, near: float, near_elevation: float | None = None) -> MountState:
        """Return the allowed position for a direction: the one that takes the least time from `near`, within the stops.

        Any winding, and flipped if the mount can; where nothing reaches the direction, the nearest to it on the sphere.
        """
        ways = [(azimuth, elevation), *([(azimuth + math.pi, math.pi - elevation)] if self.flips else [])]
        best, least = MountState(self.azimuth[0], self.elevation[0]), (math.inf, math.inf)
        here = elevation if near_elevation is None else near_elevation
        for a, e in ways:
            stop = min(max(e, self.elevation[0]), self.elevation[1])
            for turn in self._windings(a):
                off = _apart(turn, stop, azimuth, elevation)
                late = max(abs(turn - near) / self.azimuth_rate, abs(stop - here) / self.elevation_rate)
                cost = (round(off, 6), late)
                if cost < least:
                    best, least = MountState(turn, stop), cost
        return best

    def _windings(self, azimuth: float) -> list[float]:
        """Return the positions within the stops at an azimuth, or if there is none the stop nearer on the circle."""
        low, high = self.azimuth
        azimuth = math.remainder(azimuth, TURN)
        first = azimuth + TURN * math.ceil((low - azimuth) / TURN - 1e-12)
        turns = [first + TURN * k for k in range(int(max(high - first, 0.0) // TURN) + 1) if first + TURN * k <= high]
        if not turns:
            turns = [min((low, high), key=lambda a: abs(math.remainder(a - azimuth, TURN)))]
        return [min(max(a, low), high) for a in turns]

    def step(self, state: MountState, azimuth: float, elevation: float, dt: float) -> MountState:
        """Return the next command on the way to a direction: within the stops and what can be slewed in `dt` (s)."""
        if not (math.isfinite(azimuth) and math.isfinite(elevation)):
            return state
        goal = self.reach(azimuth, elevation, state.azimuth, state.elevation)
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
        must be by now if it is to be in time for all that comes. Where the winding runs out, it is the follower's; and
        so it is for a mount that can flip, which goes over the top.
        """
        late = self.step(late, float(azimuth[0]), float(elevation[0]), dt)
        if self.flips or not np.isfinite(azimuth).all():
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
        same on both sides: the mean of following late (forwards in time) and early (backwards). A mount that can flip
        does so, for the whole pass or from its highest point on, if it then follows better.
        """
        azimuth, elevation = np.asarray(azimuth, dtype=np.float64), np.asarray(elevation, dtype=np.float64)
        best = self._plan(t, azimuth, elevation, Way.UPRIGHT)
        for way in (Way.FLIPPED, Way.OVER) if self.flips else ():
            other = self._plan(t, azimuth, elevation, way)
            if (not other.wound, float(other.error.max())) < (not best.wound, float(best.error.max()) - 1e-9):
                best = other
        return best

    def _plan(self, t: FloatArray, azimuth: FloatArray, elevation: FloatArray, way: Way) -> PassPlan:
        top = 0 if way == Way.FLIPPED else (int(np.argmax(elevation)) if way == Way.OVER else len(t))
        flipped = np.arange(len(t)) >= top
        wanted = np.unwrap(np.where(flipped, azimuth + math.pi, azimuth))
        raised = np.where(flipped, math.pi - elevation, elevation)
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
        held = np.clip(raised, *self.elevation)
        late = _limited(held, self.elevation_rate * dt)
        e = 0.5 * (late + _limited(held[::-1], self.elevation_rate * dt[::-1])[::-1])
        fast = np.zeros(len(t), dtype=bool)
        fast[1:] = np.abs(np.diff(wanted)) > self.azimuth_rate * dt * (1 + 1e-9)
        error = separation(_directions(a, e), _directions(azimuth, elevation))
        return PassPlan(a, e, error, fast, spill[best] < 1e-12, way)


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


def _apart(a: float, e: float, azimuth: float, elevation: float) -> float:
    """Return the angle (rad) on the sphere between a position and a direction."""
    s, c = math.sin(0.5 * (e - elevation)), math.sin(0.5 * (a - azimuth))
    h = s * s + math.cos(e) * math.cos(elevation) * c * c
    return 2.0 * math.asin(math.sqrt(min(max(h, 0.0), 1.0)))
