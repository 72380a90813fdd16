"""A platform's pose between its navigation stamps, and a sensor's on it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from boresight.errors import UserError
from boresight.frames.local import ENU_FROM_NED
from boresight.kernels import pose as kernel
from boresight.kernels import rotation, rotations
from boresight.kernels.pose_known import known_attitudes, known_positions
from boresight.types import Axes, Component, PlatformTrack, Pose, Sensor, Site
from boresight.types.sensor import FloatArray

FORETOLD = 2.8  # noise of a pose one stamp ahead against that of a stamp: √7.75, a quadratic over four stamps
ALWAYS = -1e12  # s: the stamp of a platform at rest, before all others
SLOPE_WINDOW = 1.0  # s to either side over which a missing velocity is fitted
_NORTH_LEVEL: FloatArray = ENU_FROM_NED.copy()  # heading north, level: FRD is NED


@dataclass(frozen=True, slots=True, eq=False)
class PoseTrack:
    """Stamped navigation data, ready to be asked for any time: build it with `pose_track`.

    Attributes:
        id: the platform.
        t: (n,) stamps of positions (s); `position`, `velocity` (n, 3) in the site's ENU (m, m/s).
        measured: (n,) whether the velocity was given (else it is a slope); `hermite` (n - 1,) whether both ends were.
        arrived: (n,) when each had arrived (s), ascending; `arrived_attitude` (m,) the same of attitudes.
        t_attitude: (m,) stamps of attitudes (s), empty if there are none; `quaternion` (m, 4) of enu_from_body;
            `steps` (m - 1, 3) the turn from each to the next (rad, body axes).
        max_extrapolation: how far before the first and after the last stamp an answer is given (s).
        max_gap: the longest time between stamps over which an answer is given (s).
        sigma_position, sigma_attitude: (n,) and (m,) declared error of each stamp (m per axis, rad per angle); where a
            stamp has none, that of the one before; 0 before the first.
        site: set if local level turns with the platform's place on the ellipsoid; None for a flat world.
    """

    id: str
    t: FloatArray
    arrived: FloatArray
    position: FloatArray
    velocity: FloatArray
    measured: NDArray[np.bool_]
    hermite: NDArray[np.bool_]
    t_attitude: FloatArray
    arrived_attitude: FloatArray
    quaternion: FloatArray
    steps: FloatArray
    max_extrapolation: float
    max_gap: float
    site: Site | None
    sigma_position: FloatArray
    sigma_attitude: FloatArray

    @property
    def has_attitude(self) -> bool:
        """Whether any stamp carries an attitude."""
        return len(self.t_attitude) > 0

    def usable(self, t: ArrayLike, attitude: bool = False) -> NDArray[np.bool_]:
        """Return (n,) whether `at` answers: no long gap and not too far beyond the ends (with `attitude`, in both)."""
        times = np.atleast_1d(np.asarray(t, dtype=np.float64))
        ok = _covered(self.t, times, self.max_gap, self.max_extrapolation)
        if attitude:
            ok &= _covered(self.t_attitude, times, self.max_gap, self.max_extrapolation)
        return ok

    def covers(self, t: FloatArray) -> bool:
        """Return whether `at` answers for all of `t` (n,) (s), in attitude too where there is any."""
        if not len(self.t) or kernel.first_uncovered(self.t, t, self.max_gap, self.max_extrapolation)[0] >= 0:
            return False
        nodes = self.t_attitude
        return not len(nodes) or bool(kernel.first_uncovered(nodes, t, self.max_gap, self.max_extrapolation)[0] < 0)

    def at(self, t: ArrayLike) -> Pose:
        """Return the pose at `t` (n,) or a scalar (s): position (…, 3), velocity (…, 3), enu_from_body (…, 3, 3).

        Positions by cubic Hermite where both ends carry a velocity, else linear; attitude by slerp. Beyond the ends
        velocity and turn rate go on. With no attitude at all the platform heads north, level. Raises UserError
        where `usable` is false.
        """
        times = np.asarray(t, dtype=np.float64)
        flat = np.ascontiguousarray(times.reshape(-1))
        position, velocity = self._position(flat)
        R, _ = self._attitude(flat)
        if times.ndim == 0:
            return Pose(times, position[0], velocity[0], R[0])
        return Pose(times, position, velocity, R)

    def until(self, t: float) -> PoseTrack:
        """Return what was known at time `t` (s): the stamps that had arrived by then, and slopes from these alone."""
        n = int(np.searchsorted(self.arrived, t, side="right"))
        m = int(np.searchsorted(self.arrived_attitude, t, side="right"))
        if n == len(self.t) and m == len(self.t_attitude):
            return self
        velocity = self.velocity[:n]
        newest = self.t[n - 1] if n else t
        recent = int(np.searchsorted(self.t, newest - SLOPE_WINDOW))
        if not self.measured[recent:n].all():
            first = max(min(int(np.searchsorted(self.t, newest - 3.0 * SLOPE_WINDOW)), recent - 1), 0)
            slopes = kernel.slopes(self.t[first:n], self.position[first:n], SLOPE_WINDOW, recent - first)
            velocity = velocity.copy()
            velocity[recent:] = np.where(self.measured[recent:n, None], velocity[recent:], slopes)
        return replace(
            self, t=self.t[:n], arrived=self.arrived[:n], position=self.position[:n], velocity=velocity,
            measured=self.measured[:n], hermite=self.hermite[: max(n - 1, 0)], t_attitude=self.t_attitude[:m],
            arrived_attitude=self.arrived_attitude[:m], quaternion=self.quaternion[:m],
            steps=self.steps[: max(m - 1, 0)], sigma_position=self.sigma_position[:n],
            sigma_attitude=self.sigma_attitude[:m],
        )  # fmt: skip

    def body_rate(self, t: ArrayLike) -> FloatArray:
        """Return the turn rate (n, 3) at `t` (n,) in body axes (rad/s): constant between attitude stamps."""
        return self._attitude(np.atleast_1d(np.asarray(t, dtype=np.float64)))[1]

    def _position(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        self._check(self.t, t, "position")
        out: tuple[FloatArray, FloatArray] = kernel.interpolate_position(
            self.t, self.position, self.velocity, self.hermite, t
        )
        return out

    def _attitude(self, t: FloatArray) -> tuple[FloatArray, FloatArray]:
        if not self.has_attitude:
            return np.broadcast_to(_NORTH_LEVEL, (len(t), 3, 3)).copy(), np.zeros((len(t), 3))
        self._check(self.t_attitude, t, "attitude")
        out: tuple[FloatArray, FloatArray] = kernel.interpolate_attitude(
            self.t_attitude, self.quaternion, self.steps, t
        )
        return out

    def _check(self, nodes: FloatArray, t: FloatArray, what: str) -> None:
        row, gap = kernel.first_uncovered(nodes, t, self.max_gap, self.max_extrapolation)
        if row < 0:
            return
        when = f"platform '{self.id}': {what} at t = {t[row]:.6g} s"
        if gap > 0.0:
            raise UserError(f"{when} lies in a gap of {gap:.3g} s without navigation; the limit is {self.max_gap:g} s")
        raise UserError(
            f"{when} is more than {self.max_extrapolation:g} s outside the navigation data "
            f"({nodes[0]:.6g} … {nodes[-1]:.6g} s)"
        )


def pose_track(
    platform: PlatformTrack,
    site: Site | None = None,
    *,
    max_extrapolation: float = 2.0,
    max_gap: float = 10.0,
) -> PoseTrack:
    """Make a `PoseTrack` of stamped navigation data (`PlatformTrack`, site ENU, NaN where not given).

    Where velocities are missing they are the slope of a least-squares line over the stamps within ±1 s (at least
    the neighbours). With `site`, attitude and north-aligned axes refer to local level *at the platform*, which turns
    by 0.009° per kilometre from the site's; without, the world is flat. One at rest is where its row says at all times.
    Raises UserError for an empty track, stamps that do not ascend, or a platform with no finite position.
    """
    if platform.at_rest:
        always = np.full(len(platform.t), ALWAYS)
        platform = replace(platform, t=always, t_recv=None, at_rest=False, velocity=np.zeros((len(always), 3)))
        max_extrapolation = math.inf
    have = np.isfinite(platform.position).all(axis=1) & np.isfinite(platform.t)
    if not have.any():
        raise UserError(f"platform '{platform.id}': no row has a position")
    stamps = platform.t[np.isfinite(platform.t)]
    backwards = np.flatnonzero(np.less_equal(stamps[1:], stamps[:-1]))
    if len(backwards):
        before, after = stamps[backwards[0]], stamps[backwards[0] + 1]
        raise UserError(f"platform '{platform.id}': times must ascend ({after:.6f} s stands after {before:.6f} s)")
    t = np.ascontiguousarray(platform.t[have])
    position = np.ascontiguousarray(platform.position[have])
    measured: NDArray[np.bool_] = np.asarray(np.isfinite(platform.velocity[have]).all(axis=1))
    velocity = platform.velocity[have].copy()
    if not measured.all():
        velocity[~measured] = kernel.slopes(t, position, SLOPE_WINDOW, 0)[~measured]
    turned = np.isfinite(platform.ypr).all(axis=1) & np.isfinite(platform.t)
    t_attitude = np.ascontiguousarray(platform.t[turned])
    quaternion = _attitudes(platform.ypr[turned], t_attitude, t, position, site)
    arrived = platform.t if platform.t_recv is None else np.maximum.accumulate(platform.t_recv)
    return PoseTrack(
        platform.id, t, np.ascontiguousarray(arrived[have]), position, velocity, measured,
        measured[1:] & measured[:-1], t_attitude, np.ascontiguousarray(arrived[turned]), quaternion,
        rotations.steps_between(quaternion), max_extrapolation, max_gap, site,
        _carried_on(platform.sigma_position)[have], _carried_on(platform.sigma_attitude)[turned],
    )  # fmt: skip


def sensor_pose(sensor: Sensor, track: PoseTrack | None, t: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return position (n, 3), velocity (n, 3) in world ENU and `enu_from_sensor` (n, 3, 3) of a sensor at `t` (n,).

    The columns of `enu_from_sensor` are the sensor's east/north/up-like axes in ENU, as `kernels.measurement` takes
    them: for `site_enu` and `platform_enu` east, north, up; for `body` and `mount` right, forward and minus down.
    The lever arm (FRD) turns with the platform and adds rate × arm to the velocity.

    - `site_enu`: fixed at the site's origin, or at its station with that place's east/north/up; no lever arm.
    - `platform_enu`: at the platform, north-aligned.
    - `body`, `mount`: on the platform's body, turned by `mount` for the latter. Without a platform the body is north/
      east/down of the site or station.

    Raises UserError for a platform sensor without a track, for one that needs attitude where there is none, and for
    times that the track does not cover.
    """
    times = np.ascontiguousarray(np.atleast_1d(np.asarray(t, dtype=np.float64)))
    n = len(times)
    if sensor.axes == Axes.SITE_ENU:
        position, turn = _station(sensor, n)
        return position, np.zeros((n, 3)), np.broadcast_to(turn, (n, 3, 3)).copy()
    if track is None:
        position, velocity, R, rate = _fixed(sensor, n)
    else:
        position, velocity = track._position(times)
        if not _needs_attitude(sensor, track):
            return position, velocity, _north_aligned(track, position)
        R, rate = track._attitude(times)
    return _mounted(sensor, track, position, velocity, R, rate)


def sensor_poses(
    sensor: Sensor, track: PoseTrack | None, t: FloatArray, first: NDArray[np.int64], known: FloatArray
) -> tuple[NDArray[np.bool_], FloatArray, FloatArray, FloatArray]:
    """Return what `sensor_pose` does for many looks, each from the navigation data that had come in when it did.

    Times `t` (n,) of look i are `first[i]` to `first[i + 1]`, `known` (k,) is when it arrived (s). The first array
    returned (k,) says whether that navigation data covers the look; where not, its poses are zero. Raises UserError as
    `sensor_pose` does, but for times that are not covered.
    """
    if track is None or sensor.axes == Axes.SITE_ENU:
        return np.ones(len(known), np.bool_), *sensor_pose(sensor, track, t)
    limits = (track.max_gap, track.max_extrapolation)
    good, position, velocity = known_positions(
        track.t, track.arrived, track.position, track.velocity, track.measured, track.hermite, limits, SLOPE_WINDOW,
        t, first, known,
    )  # fmt: skip
    needed = _needs_attitude(sensor, track)
    if not needed and not track.has_attitude:
        return good, position, velocity, _north_aligned(track, position)
    turned, R, rate = known_attitudes(
        track.t_attitude, track.arrived_attitude, track.quaternion, track.steps, limits, t, first, known
    )
    if not needed:  # before the first attitude stamp it does without
        return (
            good & (turned | (known < track.arrived_attitude[0])),
            position,
            velocity,
            _north_aligned(track, position),
        )
    return good & turned, *_mounted(sensor, track, position, velocity, R, rate)


def has_pose(sensor: Sensor, track: PoseTrack | None) -> bool:
    """Return whether a sensor on a platform can have a pose at all from what is known of that."""
    if sensor.axes == Axes.SITE_ENU:
        return True
    if track is None or not len(track.t):
        return False
    turned = sensor.axes != Axes.PLATFORM_ENU or any(sensor.mount.lever_arm)
    return track.has_attitude or not turned


def _needs_attitude(sensor: Sensor, track: PoseTrack) -> bool:
    """Whether the sensor's pose depends on the platform's attitude; raises UserError if so and there is none."""
    needed = sensor.axes != Axes.PLATFORM_ENU or any(sensor.mount.lever_arm)
    if needed and not track.has_attitude:
        why = f'axes = "{sensor.axes}"' if sensor.axes != Axes.PLATFORM_ENU else "a lever arm"
        raise UserError(
            f"sensor '{sensor.id}' has {why} and needs the attitude of platform '{track.id}', which has none"
        )
    return needed


def _mounted(
    sensor: Sensor,
    track: PoseTrack | None,
    position: FloatArray,
    velocity: FloatArray,
    enu_from_body: FloatArray,
    rate: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the sensor's pose from its platform's; position and velocity are moved in place."""
    arm = np.array(sensor.mount.lever_arm, dtype=np.float64)
    if sensor.axes == Axes.PLATFORM_ENU and track is not None:
        axes = _north_aligned(track, position)
    else:
        axes = kernel.sensor_axes(enu_from_body, _body_from_mount(sensor))
    if arm.any():
        kernel.add_lever_arm(position, velocity, enu_from_body, rate, arm)
    return position, velocity, axes


def add_navigation_noise(
    sensor: Sensor,
    track: PoseTrack,
    t: FloatArray,
    z: FloatArray,
    covariance: FloatArray,
    known: float | FloatArray = np.inf,
) -> FloatArray:
    """Return the covariance (n, 7, 7) of measurements `z` (n, 7) with the error of the platform's pose in it.

    Position error counts fully in range and Cartesian components and by the range in angles; attitude error in the
    angles, and by the distance in Cartesian components, for sensors that turn with the body. A pose beyond the last
    stamp up to `known` (s, also for each row) carries the noise of its extrapolation. Without declared errors the
    covariance comes back as it is.
    """
    turns = track.has_attitude and sensor.axes not in (Axes.SITE_ENU, Axes.PLATFORM_ENU)
    moves = len(track.t) > 0 and sensor.axes != Axes.SITE_ENU
    if not len(t) or not ((turns and track.sigma_attitude.any()) or (moves and track.sigma_position.any())):
        return covariance
    by = np.broadcast_to(known, t.shape)
    a, p, ahead = np.zeros(len(t)), np.zeros(len(t)), np.zeros(len(t), np.bool_)
    if moves:
        p = track.sigma_position[np.maximum(np.searchsorted(track.arrived, by, side="right") - 1, 0)]
    if turns:
        newest = np.maximum(np.searchsorted(track.arrived_attitude, by, side="right") - 1, 0)
        a = track.sigma_attitude[newest]
        if track.max_extrapolation < math.inf:  # else it is at rest, and never foretold
            ahead = t > track.t_attitude[newest]
    angle2 = (a * np.where(ahead, FORETOLD, 1.0)) ** 2
    far = np.where(np.isnan(z[:, Component.RANGE]), np.inf, z[:, Component.RANGE])
    across = angle2 + (p / np.maximum(far, 1.0)) ** 2
    level = np.maximum(np.cos(np.nan_to_num(z[:, Component.ELEVATION])), 1e-3)
    box = z[:, Component.EAST : Component.UP + 1]
    out = covariance.copy()
    out[:, Component.RANGE, Component.RANGE] += p * p
    out[:, Component.AZIMUTH, Component.AZIMUTH] += across / level**2
    out[:, Component.ELEVATION, Component.ELEVATION] += across
    for i in range(Component.EAST, Component.UP + 1):
        out[:, i, i] += p * p + angle2 * np.nansum(box * box, axis=1)
    return out


def _carried_on(sigma: FloatArray) -> FloatArray:
    """Return (n,) each value, where it is NaN the last one before it, 0 before the first."""
    known = np.isfinite(sigma)
    last = np.maximum.accumulate(np.where(known, np.arange(len(sigma)), -1))
    return np.where(last >= 0, sigma[np.maximum(last, 0)], 0.0)


def _fixed(sensor: Sensor, n: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    if sensor.platform is not None or sensor.axes == Axes.PLATFORM_ENU:
        name = f" '{sensor.platform}'" if sensor.platform else ""
        raise UserError(
            f"sensor '{sensor.id}' has axes = \"{sensor.axes}\" but there is no track of its platform{name}"
        )
    position, turn = _station(sensor, n)
    return position, np.zeros((n, 3)), np.broadcast_to(turn @ _NORTH_LEVEL, (n, 3, 3)).copy(), np.zeros((n, 3))


def _station(sensor: Sensor, n: int) -> tuple[FloatArray, FloatArray]:
    """Where a fixed sensor stands (n, 3), and how its local level is turned (3, 3)."""
    if sensor.station is None:
        return np.zeros((n, 3)), np.eye(3)
    return np.tile(np.array(sensor.station.position), (n, 1)), np.array(sensor.station.enu_from_local)


def _body_from_mount(sensor: Sensor) -> FloatArray:
    mount = sensor.mount
    if sensor.axes != Axes.MOUNT:
        return np.eye(3)
    R: FloatArray = rotation.matrix_from_ypr(float(mount.yaw), float(mount.pitch), float(mount.roll))
    return R


def _north_aligned(track: PoseTrack, position: FloatArray) -> FloatArray:
    if track.site is None:
        return np.broadcast_to(np.eye(3), (len(position), 3, 3)).copy()
    site = track.site
    R: FloatArray = kernel.local_level(position, site.latitude, site.longitude, site.height)
    return R


def _attitudes(ypr: FloatArray, t_attitude: FloatArray, t: FloatArray, p: FloatArray, site: Any) -> FloatArray:
    """Return the attitudes (m, 4) against world ENU; local level is that of the place known at each stamp."""
    if not len(t_attitude):
        return np.zeros((0, 4))
    yaw, pitch, roll = (np.ascontiguousarray(ypr[:, i]) for i in range(3))
    R = ENU_FROM_NED @ rotations.matrix_from_ypr(yaw, pitch, roll)
    if site is not None:
        i = np.maximum(np.searchsorted(t, t_attitude, side="right") - 1, 0)  # later positions were not known yet
        before = np.maximum(i - 1, 0)
        step = np.maximum(t[i] - t[before], 1e-3)[:, None]
        where = p[i] + (t_attitude - t[i])[:, None] * ((p[i] - p[before]) / step)
        R = kernel.local_level(np.ascontiguousarray(where), site.latitude, site.longitude, site.height) @ R
    q: FloatArray = rotations.quaternion_from_matrix(np.ascontiguousarray(R))
    return q


def _covered(nodes: FloatArray, t: FloatArray, max_gap: float, max_extrapolation: float) -> NDArray[np.bool_]:
    if not len(nodes):
        return np.zeros(len(t), dtype=bool)
    inside: NDArray[np.bool_] = (t >= nodes[0] - max_extrapolation) & (t <= nodes[-1] + max_extrapolation)
    i = np.clip(np.searchsorted(nodes, t, side="right") - 1, 0, max(len(nodes) - 2, 0))
    gap = nodes[np.minimum(i + 1, len(nodes) - 1)] - nodes[i]
    on_stamp = np.isin(t, nodes)
    between = (t > nodes[0]) & (t < nodes[-1]) & ~on_stamp
    out: NDArray[np.bool_] = inside & ~(between & (gap > max_gap))
    return out
