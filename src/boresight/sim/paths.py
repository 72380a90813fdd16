"""Paths through waypoints: straight legs, rounded turns, speeds or times at the waypoints."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from boresight.errors import UserError
from boresight.types import FloatArray


class Trajectory(NamedTuple):
    """A path on a fine clock; between the nodes a cubic fits positions and velocities."""

    t: FloatArray  # (k,) s, ascending
    position: FloatArray  # (k, 3) ENU m
    velocity: FloatArray  # (k, 3) m/s


@dataclass(frozen=True, slots=True, eq=False)
class Straight:
    """Constant velocity (3,) (m/s) from `position` (3,) (ENU m) at time 0; zero velocity stands still."""

    position: FloatArray
    velocity: FloatArray

    def at(self, t: FloatArray) -> Trajectory:
        """Return the path at times `t` (s)."""
        return Trajectory(t, self.position + t[:, None] * self.velocity, np.tile(self.velocity, (len(t), 1)))


@dataclass(frozen=True, slots=True, eq=False)
class Waypoints:
    """A path through `points` (k, 3) (ENU m) with corners rounded to `turn_radius` (m, less where legs are short).

    Give either `speeds` (k,) (m/s; each leg has constant acceleration) or `times` (k,) (s, ascending; the speed is
    smooth). Before the first and after the last point the path goes straight on. Raises UserError.
    """

    points: FloatArray
    speeds: FloatArray | None = None
    times: FloatArray | None = None
    turn_radius: float = 0.0
    start: float = 0.0  # s, time at the first point if speeds are given

    def __post_init__(self) -> None:
        n = len(self.points)
        if self.points.shape != (n, 3) or n < 2:
            raise UserError("waypoints: give at least two points [east, north, up]")
        if not (np.linalg.norm(np.diff(self.points, axis=0), axis=1) > 0).all():
            raise UserError("waypoints: two points that follow each other are the same")
        if (self.speeds is None) == (self.times is None):
            raise UserError("waypoints: give either speeds or times")
        if self.speeds is not None and (len(self.speeds) != n or not (self.speeds > 0).all()):
            raise UserError(f"waypoints: give one speed above zero for each of the {n} points")
        if self.times is not None and (len(self.times) != n or not (np.diff(self.times) > 0).all()):
            raise UserError(f"waypoints: give one time for each of the {n} points, ascending")
        if self.turn_radius < 0:
            raise UserError("waypoints: the turn radius must not be negative")

    def at(self, t: FloatArray) -> Trajectory:
        """Return the path at times `t` (s)."""
        pieces, knots = _round(self.points, self.turn_radius)
        knot_times, distance, speed = _clock(knots, self.speeds, self.times, self.start)
        inside = np.clip(t, knot_times[0], knot_times[-1])
        s = distance(inside) + np.where(t < knot_times[0], t - knot_times[0], 0.0) * speed(knot_times[:1])
        s = s + np.where(t > knot_times[-1], t - knot_times[-1], 0.0) * speed(knot_times[-1:])
        position, direction = _along(pieces, s)
        return Trajectory(t, position, direction * speed(inside)[:, None])


class _Piece(NamedTuple):
    """A straight leg (radius 0) or an arc: at distance s from `begin` along the path."""

    begin: float  # m
    origin: FloatArray  # start of the leg, or centre of the arc
    along: FloatArray  # unit vector at the start
    inward: FloatArray  # unit vector from the arc's start to its centre
    radius: float


def _round(points: FloatArray, radius: float) -> tuple[list[_Piece], FloatArray]:
    """Cut the corners; returns the pieces and the distance along the path of each waypoint."""
    legs = np.diff(points, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    units = legs / lengths[:, None]
    pieces: list[_Piece] = []
    knots = [0.0]
    s, here = 0.0, points[0]
    none = np.zeros(3)
    for i in range(len(legs)):
        end, cut = points[i + 1], 0.0
        if i + 1 < len(legs):
            turn = math.acos(float(np.clip(units[i] @ units[i + 1], -1.0, 1.0)))
            half = math.tan(min(turn, math.pi - 1e-6) / 2.0)
            cut = min(radius * half, 0.5 * lengths[i], 0.5 * lengths[i + 1]) if turn > 1e-9 else 0.0
        pieces.append(_Piece(s, here, units[i], none, 0.0))
        s += float((end - cut * units[i] - here) @ units[i])
        if cut > 0.0:
            r = cut / half
            inward = units[i + 1] - (units[i + 1] @ units[i]) * units[i]
            inward /= np.linalg.norm(inward)
            pieces.append(_Piece(s, end - cut * units[i] + r * inward, units[i], inward, r))
            knots.append(s + 0.5 * r * turn)
            s += r * turn
            here = end + cut * units[i + 1]
        else:
            knots.append(s)
            here = end
    return pieces, np.array(knots)


def _clock(
    knots: FloatArray, speeds: FloatArray | None, times: FloatArray | None, start: float
) -> tuple[FloatArray, CubicHermiteSpline, CubicHermiteSpline]:
    """Return the times of the waypoints, and distance and speed as functions of time."""
    if speeds is not None:
        times = start + np.concatenate([[0.0], np.cumsum(2.0 * np.diff(knots) / (speeds[1:] + speeds[:-1]))])
        distance = CubicHermiteSpline(times, knots, speeds)  # a parabola on each leg: constant acceleration
    else:
        assert times is not None
        distance = PchipInterpolator(times, knots)
    return times, distance, distance.derivative()


def _along(pieces: list[_Piece], s: FloatArray) -> tuple[FloatArray, FloatArray]:
    position, direction = np.empty((len(s), 3)), np.empty((len(s), 3))
    which = np.clip(np.searchsorted([p.begin for p in pieces], s, side="right") - 1, 0, len(pieces) - 1)
    for i, piece in enumerate(pieces):
        rows = which == i
        d = (s[rows] - piece.begin)[:, None]
        if piece.radius == 0.0:
            position[rows] = piece.origin + d * piece.along
            direction[rows] = piece.along
        else:
            angle = d / piece.radius
            out = -np.cos(angle) * piece.inward + np.sin(angle) * piece.along
            position[rows] = piece.origin + piece.radius * out
            direction[rows] = np.sin(angle) * piece.inward + np.cos(angle) * piece.along
    return position, direction
