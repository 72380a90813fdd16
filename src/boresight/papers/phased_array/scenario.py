"""A satellite pass, an array (fixed or on a ship) and three guide sources with delay, losses and jumps.

The paper prints none of this; the numbers are those of docs/pointing.md. Times run from culmination.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.frames.array_face import Pole, angles_from_face, enu_from_face
from boresight.frames.attitude import enu_from_body
from boresight.frames.azel import azel_from_enu
from boresight.frames.local import ecef_from_enu, ecef_from_enu_rotation
from boresight.frames.tangent import direction_from_tangent, unit
from boresight.kernels.guide import DIRECTION, EARTH_RATE, MU, POSITION, fly
from boresight.types import FloatArray, Site

DEG = np.pi / 180.0
STATION = Site(39.0 * DEG, 100.0 * DEG, 1400.0)
ORBIT_RADIUS = 6378137.0 + 550e3  # m
COURSE = 350.0 * DEG
LOWEST = 10.0 * DEG  # elevation above which the pass is followed
SKIPPED = 20  # nodes at the beginning that are not scored
LEAD = 1.0  # s, from a node to when the beam is there
SIGMA_ANGLE = (0.05 * DEG, 0.0, 0.25 * DEG)  # of sources 1 and 3
SIGMA_RANGE, SIGMA_POSITION = 20.0, 300.0  # m, of sources 1 and 2
SOURCE_1_OFFSET = np.array([300.0, 200.0, 5.0])  # m, east, north, up of the array
RFU_FROM_FRD = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@dataclass(frozen=True, slots=True)
class Scenario:
    """One variation of the pass."""

    offset: float = 4.5 * DEG  # of the ground track from the station, at the Earth's centre
    jumps: tuple[float, float, float] = (0.02, 0.02, 0.01)
    loss: float = 0.05
    ship: bool = False
    sigma_attitude: float = 0.0  # rad per angle
    bias: float = 0.0  # m along track, of source 2
    silent: float = 0.0  # s before and after culmination, source 1
    face: tuple[float, float] = (90.0 * DEG, 40.0 * DEG)  # boresight azimuth, elevation (in the ship's axes on a ship)
    pole: Pole = Pole.IN_FACE


SCENARIOS = {
    "nominal": Scenario(),
    "clean": Scenario(jumps=(0.0, 0.0, 0.0), loss=0.0),
    "zenith": Scenario(offset=0.05 * DEG, face=(0.0, 90.0 * DEG), pole=Pole.ON_NORMAL),
    "ship": Scenario(ship=True, sigma_attitude=0.03 * DEG, face=(30.0 * DEG, 40.0 * DEG)),
    "biased": Scenario(bias=10e3),
    "silent": Scenario(silent=30.0),
    "heavy": Scenario(jumps=(0.05, 0.05, 0.03), loss=0.2),
}


class Source(NamedTuple):
    """Reports of one source, in order of their own times."""

    t: FloatArray  # (n,) s
    t_recv: FloatArray  # (n,) s
    z: FloatArray  # (n, 3) az, el (rad), range (m or NaN) in `axes`; or ECEF m
    origin: FloatArray  # (n, 3) ECEF m
    axes: FloatArray  # (n, 3, 3) ECEF from the source's east/north/up-like axes


class Pass(NamedTuple):
    """What a run of the scenario gives."""

    node: FloatArray  # (k,) s
    direction: FloatArray  # (k, 3) unit, station ENU: the truth at node + LEAD
    array: FloatArray  # (k, 3) ECEF m: the array at node + LEAD
    array_now: FloatArray  # (k, 3) ECEF m, at the node
    face: FloatArray  # (k, 3, 3) station ENU from face, true, at node + LEAD
    face_measured: FloatArray  # (k, 3, 3) as the attitude is measured then
    face_now: FloatArray  # (k, 3, 3) as measured at the node
    sources: tuple[Source, Source, Source]
    pole: Pole


def orbit(offset: float, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ECEF positions and inertial velocities turned to ECEF axes (n, 3) at times (s) from culmination."""
    R = ecef_from_enu_rotation(STATION)
    up = unit(np.stack(ecef_from_enu(0.0, 0.0, 0.0, STATION)))  # from the Earth's centre: 0.19° off the plumb line
    ahead = R @ [np.sin(COURSE), np.cos(COURSE), 0.0]
    ahead = unit(ahead - (ahead @ up) * up)
    side = np.cross(ahead, up)
    start = np.concatenate(
        [
            ORBIT_RADIUS * (np.cos(offset) * up + np.sin(offset) * side),
            np.sqrt(MU / ORBIT_RADIUS) * ahead,
        ]
    )
    out = np.empty((len(t), 6))
    for sign in (1.0, -1.0):
        x, at = start.copy(), 0.0
        for i in np.argsort(np.abs(t)):
            if t[i] * sign < 0 or (t[i] == 0 and sign < 0):
                continue
            fly(x, t[i] - at)
            at = t[i]
            out[i] = x
    c, s = np.cos(EARTH_RATE * t), np.sin(EARTH_RATE * t)
    for k in (0, 3):
        a, b = out[:, k].copy(), out[:, k + 1].copy()
        out[:, k], out[:, k + 1] = c * a + s * b, c * b - s * a
    return out[:, :3], out[:, 3:]


def simulate(scenario: Scenario, rng: np.random.Generator) -> Pass:
    """Return one pass with its reports; the same generator gives the same pass."""
    R = ecef_from_enu_rotation(STATION)
    t = np.arange(-700.0, 701.0)
    seen = _elevation(orbit(scenario.offset, t)[0] - np.stack(ecef_from_enu(0.0, 0.0, 0.0, STATION)), R) > LOWEST
    node = t[seen]
    aim = node + LEAD
    to_target = orbit(scenario.offset, aim)[0] - _array(scenario, aim)
    sources = (
        _guide_1(scenario, node, rng),
        _guide_2(scenario, node, rng),
        _own(scenario, node, rng),
    )
    return Pass(
        node, unit(to_target @ R), _array(scenario, aim), _array(scenario, node), _face(scenario, aim, None),
        _face(scenario, aim, rng), _face(scenario, node, rng), sources, scenario.pole,
    )  # fmt: skip


def _elevation(ecef: FloatArray, R: FloatArray) -> FloatArray:
    out: FloatArray = azel_from_enu(*(ecef @ R).T)[1]
    return out


def _array(scenario: Scenario, t: FloatArray) -> FloatArray:
    speed = 8.0 if scenario.ship else 0.0
    way = speed * t
    return np.stack(ecef_from_enu(way * np.sin(60 * DEG), way * np.cos(60 * DEG), 0.0 * t, STATION), axis=-1)


def _face(scenario: Scenario, t: FloatArray, rng: np.random.Generator | None) -> FloatArray:
    """Return the station's ENU from the face (n, 3, 3); with `rng`, as a noisy attitude sensor has it."""
    R = enu_from_face(*scenario.face)
    if not scenario.ship:
        return np.broadcast_to(R, (len(t), 3, 3)).copy()
    wave = 2 * np.pi * t
    ypr = DEG * np.stack([60 + 2 * np.sin(wave / 14), 3 * np.sin(wave / 6.5), 8 * np.sin(wave / 9)], axis=-1)
    if rng is not None:
        ypr = ypr + scenario.sigma_attitude * rng.standard_normal(ypr.shape)
    out: FloatArray = enu_from_body(ypr[:, 0], ypr[:, 1], ypr[:, 2]) @ RFU_FROM_FRD.T @ R
    return out


def _noisy(direction: FloatArray, sigma: float, rng: np.random.Generator) -> FloatArray:
    return direction_from_tangent(direction, sigma * rng.standard_normal((len(direction), 2)))


def _delivered(t: FloatArray, node: FloatArray, low: float, high: float, rng: np.random.Generator) -> FloatArray:
    late = np.where(rng.random(len(t)) < 0.05, rng.uniform(0.5, 1.5, len(t)), 0.0)
    return t + rng.uniform(low, high, len(t)) + late


def _guide_1(s: Scenario, node: FloatArray, rng: np.random.Generator) -> Source:
    t = node - 0.7
    R = ecef_from_enu_rotation(STATION)
    origin = _array(s, t) + R @ SOURCE_1_OFFSET
    d = (orbit(s.offset, t)[0] - origin) @ R
    azimuth, elevation, r = azel_from_enu(*_noisy(unit(d), SIGMA_ANGLE[0], rng).T)
    r = np.linalg.norm(d, axis=1) + SIGMA_RANGE * rng.standard_normal(len(t))
    jump = _signed(4 * DEG, 20 * DEG, len(t), rng) * (rng.random(len(t)) < s.jumps[0])
    in_azimuth = rng.random(len(t)) < 0.5
    azimuth = azimuth + np.where(in_azimuth, jump / np.cos(elevation), 0.0)
    elevation = elevation + np.where(in_azimuth, 0.0, jump)
    keep = (rng.random(len(t)) >= s.loss) & (np.abs(node) > s.silent if s.silent else True)
    z = np.stack([azimuth, elevation, r], axis=-1)
    t_recv = _delivered(t, node, 0.1, 0.6, rng)
    return _source(t, t_recv, z, origin, np.broadcast_to(R, (len(t), 3, 3)), keep)


def _guide_2(s: Scenario, node: FloatArray, rng: np.random.Generator) -> Source:
    t = node - 0.3
    position, velocity = orbit(s.offset, t)
    z = position + s.bias * unit(velocity) + SIGMA_POSITION * rng.standard_normal((len(t), 3))
    jumped = rng.random(len(t)) < s.jumps[1]
    radius = np.linalg.norm(z, axis=1)
    latitude = np.arcsin(z[:, 2] / radius) + jumped * _signed(0.5 * DEG, 3 * DEG, len(t), rng)
    longitude = np.arctan2(z[:, 1], z[:, 0]) + jumped * _signed(0.5 * DEG, 3 * DEG, len(t), rng)
    c = np.cos(latitude)
    moved = radius[:, None] * np.stack([c * np.cos(longitude), c * np.sin(longitude), np.sin(latitude)], axis=-1)
    z = np.where(jumped[:, None], moved, z)
    keep = rng.random(len(t)) >= s.loss
    none = np.zeros((len(t), 3))
    return _source(t, _delivered(t, node, 0.2, 1.0, rng), z, none, np.broadcast_to(np.eye(3), (len(t), 3, 3)), keep)


def _own(s: Scenario, node: FloatArray, rng: np.random.Generator) -> Source:
    R = ecef_from_enu_rotation(STATION)
    origin = _array(s, node)
    direction = unit((orbit(s.offset, node)[0] - origin) @ R)
    seen = np.einsum("nji,nj->ni", _face(s, node, None), direction)
    seen = _noisy(seen, SIGMA_ANGLE[2], rng)
    jump = _signed(3 * DEG, 10 * DEG, len(node), rng) * (rng.random(len(node)) < s.jumps[2])
    turn = 2 * np.pi * rng.random(len(node))
    seen = direction_from_tangent(seen, jump[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1))
    azimuth, elevation, _ = angles_from_face(seen, s.pole)
    z = np.stack([azimuth, elevation, np.full(len(node), np.nan)], axis=-1)
    axes = R @ _face(s, node, rng) @ pole_axes(s.pole)
    return _source(node, node, z, origin, axes, rng.random(len(node)) >= s.loss)


def pole_axes(pole: Pole) -> FloatArray:
    """Return (3, 3): face axes from the east/north/up-like axes of an angle system."""
    if pole == Pole.IN_FACE:
        return np.eye(3)
    return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def _signed(low: float, high: float, n: int, rng: np.random.Generator) -> FloatArray:
    out: FloatArray = rng.uniform(low, high, n) * rng.choice([-1.0, 1.0], n)
    return out


def _source(
    t: FloatArray, t_recv: FloatArray, z: FloatArray, origin: FloatArray, axes: FloatArray, keep: NDArray[np.bool_]
) -> Source:
    return Source(t[keep], t_recv[keep], z[keep], origin[keep], np.ascontiguousarray(axes[keep]))


KINDS = (DIRECTION, POSITION, DIRECTION)
