"""Reports of one object, and the one value that stands for them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.align.window import PolynomialWindow, choose_order
from boresight.kernels.measurement import measure, wrap
from boresight.stages.follow import pair
from boresight.stages.protocol import Belief
from boresight.stages.scene import AZ, EL, LEVEL, Scene, turn, turn_jacobian
from boresight.types import N_COMPONENTS, FloatArray, Scan

BOTH = (int(AZ), int(EL))


class Report(NamedTuple):
    """One bearing with the world axes' direction beside it."""

    row: int
    t: float  # s, validity
    look: float  # s, of the look it came with
    z: FloatArray  # (7,) sensor axes
    R: FloatArray  # (7, 7)
    world: FloatArray  # (2,) azimuth, elevation (rad); elevation 0 where not measured
    cov: FloatArray  # (2, 2) rad², elevation's 0 where not measured


class Value(NamedTuple):
    """What goes on to the tracker: a report, or what stands for several."""

    row: int
    t: float
    z: FloatArray
    R: FloatArray


NOTHING_MEASURED = Value(-1, 0.0, np.full(N_COMPONENTS, np.nan), np.full((N_COMPONENTS, N_COMPONENTS), np.nan))


class Group(NamedTuple):
    """Reports that belong to one predicted track, with what the track predicts for each (rad, world axes)."""

    reports: list[Report]
    innovations: FloatArray  # (n, 2)
    predicted: FloatArray  # (2,) at the mean time
    t: float  # s, weighted mean
    scene: Scene
    sensor: int
    known: float

    def value(self) -> Value:
        """The weighted mean innovation on the prediction at the mean time: lossless for what does not turn."""
        if len(self.reports) == 1:
            one = self.reports[0]
            return Value(one.row, one.t, one.z, one.R)
        elevation = np.isfinite(self.reports[0].z[EL])
        info = np.array([_invert(r.cov, elevation) for r in self.reports])
        cov = _invert(info.sum(axis=0), elevation)
        mean = cov @ np.einsum("kij,kj->i", info, self.innovations)
        return _in_sensor(self.scene, self.sensor, self.reports, self.t, self.predicted + mean, cov, self.known)


def held_reports(scene: Scene, scan: Scan) -> list[Report] | None:
    """Return a look's bearings with their world directions; None where there is no pose."""
    if len(scan.t) == 0:
        return []
    t, look = scene.valid(scan), scene.look_time(scan)
    place = scene.place(scan.sensor, t, scan.t_recv)
    if place is None:
        return None
    sensor = scene.sensors[scan.sensor]
    az, el = scan.z[:, AZ], np.nan_to_num(scan.z[:, EL])
    world, cov = np.stack([az, el], axis=1), np.nan_to_num(scan.covariance[:, AZ : EL + 1, AZ : EL + 1])
    if sensor.axes not in LEVEL:
        for i in range(len(t)):
            J = turn_jacobian(sensor, float(az[i]), float(el[i]), place.axes[i])
            world[i], cov[i] = turn(sensor, float(az[i]), float(el[i]), place.axes[i]), J @ cov[i] @ J.T
    flat = ~np.isfinite(scan.z[:, EL])
    cov[flat, 1, :] = cov[flat, :, 1] = 0.0
    return [
        Report(int(row), float(when), look, z, R, direction, P)
        for row, when, z, R, direction, P in zip(scan.row, t, scan.z, scan.covariance, world, cov, strict=True)
    ]


def by_streak(reports: list[Report], rate: float, gate: float) -> list[list[Report]]:
    """Group reports that follow one another: each look's go to the nearest streaks, one each, or begin new ones."""
    streaks: list[list[Report]] = []
    looks: dict[float, list[Report]] = {}
    for r in sorted(reports, key=lambda r: (r.t, r.row)):
        looks.setdefault(r.look, []).append(r)
    for here in looks.values():
        taken = np.full(len(here), -1)
        if streaks:
            new, old = _points(here), _points([streak[-1] for streak in streaks])
            turn_az = new.world[:, None, 0] - old.world[None, :, 0]
            turn_az = (turn_az + np.pi) % (2 * np.pi) - np.pi
            gap = np.hypot(turn_az * np.cos(new.world[:, None, 1]), new.world[:, None, 1] - old.world[None, :, 1])
            age = new.t[:, None] - old.t
            limit = gate * np.sqrt(new.variance[:, None] + old.variance) + rate * age
            possible = (age > 0.0) & (new.elevated[:, None] == old.elevated)
            taken = pair(gap, np.where(possible, limit, -1.0))
        for r, j in zip(here, taken.tolist(), strict=True):
            if j < 0:
                streaks.append([r])
            else:
                streaks[j].append(r)
    return streaks


class _Points(NamedTuple):
    """Reports as columns."""

    t: FloatArray  # (n,)
    world: FloatArray  # (n, 2)
    variance: FloatArray  # (n,) rad², of both angles
    elevated: NDArray[np.bool_]  # (n,) whether elevation was measured


def _points(reports: list[Report]) -> _Points:
    variance = np.array([r.cov[0, 0] + r.cov[1, 1] for r in reports])
    elevated = np.isfinite(np.array([r.z[EL] for r in reports]))
    return _Points(np.array([r.t for r in reports]), np.array([r.world for r in reports]), variance, elevated)


def value_of(
    scene: Scene, sensor: int, reports: list[Report], at: float, order: int | None, far_less: bool, known: float
) -> Value:
    """Return the polynomial's value at time `at` (s), or at their middle where the reports do not reach that far."""
    newest = reports[-1]
    t = np.array([r.t for r in reports])
    different = len(np.unique(t))
    if different < 2:
        return Value(newest.row, newest.t, newest.z, newest.R)
    slack = float(np.max(np.diff(t)))
    if not t[0] - slack <= at <= t[-1] + slack:
        at = float(t.mean())
    angles = np.array([r.world for r in reports])
    angles[:, 0] = np.unwrap(angles[:, 0])
    elevation = bool(np.isfinite(newest.z[EL]))
    used = [0, 1] if elevation else [0]
    sigma = np.sqrt(np.array([[r.cov[c, c] for c in (0, 1)] for r in reports]))
    degree = order if order is not None else choose_order(t, angles[:, used], np.sqrt((sigma[:, used] ** 2).mean(1)))
    polynomial = PolynomialWindow(min(degree, different - 1, 3), far_less)
    W = np.zeros((2, len(t)))
    for c in used:
        W[c] = polynomial.weights(t, sigma[:, c], at)
    world = np.einsum("ck,kc->c", W, angles)
    cov = np.einsum("ak,bk,kab->ab", W, W, np.array([r.cov for r in reports]))
    return _in_sensor(scene, sensor, reports, at, world, cov, known)


def by_track(
    scene: Scene, sensor: int, reports: list[Report], belief: Belief, gate: float, known: float
) -> tuple[list[Group], list[Report]]:
    """Group bearings by the predicted track nearest to each within `gate` standard deviations; the rest beside."""
    members: dict[int, list[tuple[Report, FloatArray]]] = {}
    strangers: list[Report] = []
    looks: dict[float, list[Report]] = {}
    for r in sorted(reports, key=lambda r: (r.t, r.row)):
        looks.setdefault(r.look, []).append(r)
    for here in looks.values():
        y, nis = _against(scene, sensor, here, belief, known)
        for i, j in enumerate(pair(nis, np.full(nis.shape, gate**2))):
            if j < 0:
                strangers.append(here[i])
            else:
                members.setdefault(int(j), []).append((here[i], y[i, j]))
    groups = []
    for j, pairs in members.items():
        these = [r for r, _ in pairs]
        info = np.array([1.0 / r.cov[0, 0] for r in these])
        t = float(info @ [r.t for r in these] / info.sum())
        predicted = _predicted(scene, sensor, np.array([t]), belief, known)
        assert predicted is not None, "reports around this time had a pose"
        groups.append(Group(these, np.array([y for _, y in pairs]), predicted[0][0, j], t, scene, sensor, known))
    return groups, strangers


def _against(
    scene: Scene, sensor: int, here: list[Report], belief: Belief, known: float
) -> tuple[FloatArray, FloatArray]:
    """Innovations (n, k, 2) of reports against k tracks, and their NIS (n, k)."""
    n, k = len(here), len(belief.position)
    y, nis = np.zeros((n, k, 2)), np.full((n, k), np.inf)
    got = _predicted(scene, sensor, np.array([r.t for r in here]), belief, known) if k else None
    if got is None:
        return y, nis
    h, P = got
    for i, r in enumerate(here):
        d = r.world - h[i]
        d[:, 0] -= 2 * np.pi * np.floor((d[:, 0] + np.pi) / (2 * np.pi))
        y[i] = d
        S = P[i] + r.cov
        if np.isfinite(r.z[EL]):
            nis[i] = np.einsum("ka,kab,kb->k", d, np.linalg.inv(S), d)
        else:
            y[i, :, 1] = 0.0
            nis[i] = d[:, 0] ** 2 / S[:, 0, 0]
    return y, nis


def _predicted(
    scene: Scene, sensor: int, t: FloatArray, belief: Belief, known: float
) -> tuple[FloatArray, FloatArray] | None:
    """Azimuth and elevation (n, k, 2) of straight tracks from the sensor at `t` (n,), and their covariance."""
    place = scene.place(sensor, t, known)
    if place is None:
        return None
    k = len(belief.position)
    h, P = np.zeros((len(t), k, 2)), np.zeros((len(t), k, 2, 2))
    z, H, level = np.empty(N_COMPONENTS), np.empty((N_COMPONENTS, 6)), np.eye(3)
    for i in range(len(t)):
        dt = float(t[i]) - belief.t
        for j in range(k):
            p = belief.position[j] + dt * belief.velocity[j]
            measure(p, belief.velocity[j], place.position[i], np.zeros(3), level, z, H)
            J = H[1:3, :3]
            h[i, j] = z[1:3]
            P[i, j] = J @ (belief.covariance[j] + dt**2 * belief.velocity_covariance[j]) @ J.T
    return h, P


def _in_sensor(
    scene: Scene, sensor: int, reports: list[Report], t: float, world: FloatArray, cov: FloatArray, known: float
) -> Value:
    """Write a world direction at time `t` in the sensor's axes there, under the row of the newest report."""
    newest = reports[-1]
    elevation = bool(np.isfinite(newest.z[EL]))
    place = scene.place(sensor, np.array([t]), known)
    assert place is not None, "the time lies among reports that had a pose"
    one = scene.sensors[sensor]
    az, el = float(world[0]), float(world[1]) if elevation else 0.0
    back = turn(one, az, el, place.axes[0], back=True)
    J = turn_jacobian(one, az, el, place.axes[0], back=True)
    turned = J @ cov @ J.T
    z, R = np.full(N_COMPONENTS, np.nan), np.full((N_COMPONENTS, N_COMPONENTS), np.nan)
    z[AZ], R[AZ, AZ] = wrap(back[0]), turned[0, 0]
    if elevation:
        z[EL] = back[1]
        R[np.ix_(BOTH, BOTH)] = turned
    return Value(newest.row, t, z, R)


def _invert(cov: FloatArray, elevation: bool) -> FloatArray:
    if elevation:
        return np.asarray(np.linalg.inv(cov))
    out = np.zeros((2, 2))
    out[0, 0] = 1.0 / cov[0, 0]
    return out
