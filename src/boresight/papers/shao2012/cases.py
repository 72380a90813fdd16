"""Cases where the choice of coordinates and noise decides: weaving, straight, diffuse range, over the top.

Infrared as in set A, the relative start as in the sets. *weave* and *straight*: prior range sigma 1000 m, velocity
200 m/s, q = 0.01, infrared only; weaving, the own ship accelerates 30 m/s² east and west in turn, 4 s each. *diffuse*:
range lognormal with mean 5000 m and sigma(ln r) = 0.6, velocity known to 50 m/s, weaving. *overhead*: the target
passes below at 9.76 s; noise in the tangent plane, radar 0.5 mrad and 20 m, velocity known to 1 m/s.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from boresight.bounds import trajectory_bound
from boresight.filters.msc import KNOWN_RANGE, MscFilter, MscState
from boresight.filters.stream import Reports
from boresight.kernels.msc import EXACT, cartesian_from_msc, inverse_jacobian, msc_from_world
from boresight.kernels.msc_stream import msc_stream
from boresight.kernels.stream import ekf_stream
from boresight.models import Infrared, NearlyConstantVelocity, Radar
from boresight.papers.montecarlo import finite, nees, polar, rms, wrapped
from boresight.papers.shao2012.scenario import OWN, RELATIVE, Setup, pose
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState

LATERAL, LEG = 30.0, 4.0  # m/s², s
INFRARED, RATE = 0.5e-3, 50  # rad, Hz
RANGE = 5000.0  # m


def own_path(t: FloatArray, weaving: bool) -> FloatArray:
    """Return the own ship (k, 6): north at 200 m/s, weaving east and west or not."""
    out = np.tile(OWN, (len(t), 1))
    out[:, 1] += OWN[4] * t
    if weaving:
        leg, s = np.divmod(t, 2 * LEG)  # every two legs end with no sideways velocity
        u = np.minimum(s, LEG)
        w = s - u
        out[:, 0] += LATERAL * (leg * LEG**2 + 0.5 * u**2 + LEG * w - 0.5 * w**2)
        out[:, 3] += LATERAL * (u - w)
    return out


class Case:
    """Truth and infrared reports (and radar, for `overhead`) of all runs."""

    def __init__(
        self,
        start: FloatArray,
        motion: NearlyConstantVelocity,
        duration: float,
        weaving: bool,
        rng: np.random.Generator,
    ) -> None:
        self.t = np.arange(1, round(duration * RATE) + 1) / RATE
        self.own, self.own0, self.motion = own_path(self.t, weaving), own_path(np.zeros(1), weaving)[0], motion
        self.truth = np.empty((len(start), len(self.t), 6))
        x, (_, F, Q) = start, motion.move(start[0], 1.0 / RATE)
        root = np.linalg.cholesky(Q)
        for k in range(len(self.t)):
            x = x @ F.T + rng.normal(size=x.shape) @ root.T
            self.truth[:, k] = x
        self.noise = rng.normal(size=(*self.truth.shape[:2], 2, 3))

    def infrared(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return t, z (runs, k, 7), contexts and own ship of infrared reports with az/el noise."""
        z = np.full((*self.truth.shape[:2], 7), np.nan)
        z[..., 1:3] = polar(self.truth - self.own)[..., 1:] + INFRARED * self.noise[..., 0, 1:]
        sensor = Infrared(INFRARED, INFRARED)
        return self.t, z, np.array([sensor.at(pose(o)).context for o in self.own]), self.own


Prior = Callable[[int], GaussianState] | Callable[[int], MscState]


def _cartesian(case: Case, prior: GaussianState, data: tuple[FloatArray, ...]) -> tuple[FloatArray, FloatArray]:
    """Run the EKF in world ENU; return means (runs, k, 6) and NEES (runs, k)."""
    t, z, context, _ = data
    k = len(t)
    means, consistency = np.full((len(z), k, 6), np.nan), np.full((len(z), k), np.nan)
    for run in range(len(z)):
        out = [np.full(s, np.nan) for s in ((k, 6), (k, 6, 6), (k, 6), (k, 6, 6), (k, 6, 6), (k, 2))]
        head = (case.motion.kernel, case.motion.parameters, Radar.kernel, prior.x, prior.P, 0.0)
        ekf_stream(*head, t, z[run], context, 1, *out)
        means[run] = out[0]
        consistency[run] = nees(out[0] - _at(case, t, run), out[1])
    return means, consistency


def _at(case: Case, t: FloatArray, run: int) -> FloatArray:
    return np.asarray(case.truth[run][np.rint(t * RATE).astype(int) - 1])


def _spherical(case: Case, prior: MscState, data: tuple[FloatArray, ...]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Run the MSC filter; return world means, NEES in MSC, and the relative sigma of 1/r, each (runs, k, …)."""
    t, z, context, own = data
    k = len(t)
    means, consistency, sigma = np.full((len(z), k, 6), np.nan), np.full((len(z), k), np.nan), np.empty((len(z), k))
    for run in range(len(z)):
        out = [np.full(s, np.nan) for s in ((k, 6), (k, 6, 6), (k, 6), (k, 6, 6), (k, 6, 6), (k, 2))]
        head = (case.motion.kernel, case.motion.parameters, Radar.kernel, prior.y, prior.Py, 0.0, prior.own)
        msc_stream(*head, t, z[run], context, own, EXACT, *out)
        truth = _at(case, t, run)
        true_y = np.array([msc_from_world(x, o) for x, o in zip(truth, own)])
        error = out[0] - true_y
        error[:, 2] = wrapped(error[:, 2])
        consistency[run] = nees(error, out[1])
        sigma[run] = np.sqrt(out[1][:, 5, 5]) / out[0][:, 5]
        means[run] = np.array([cartesian_from_msc(y) for y in out[0]]) + own
    return means, consistency, sigma


def _range_bound(case: Case, start: FloatArray, prior: GaussianState, data: tuple[FloatArray, ...]) -> FloatArray:
    """Return the Cramér-Rao bound on range (runs, k) on each run's true path."""
    t, z, context, own = data
    out = np.empty((len(z), len(t)))
    for run in range(len(z)):
        reports = Reports(t, z[run], context, Radar.kernel)
        P = trajectory_bound(prior._replace(x=start[run]), case.motion, reports, case.truth[run])
        u = case.truth[run, :, :3] - own[:, :3]
        u /= np.linalg.norm(u, axis=1)[:, None]
        out[run] = np.sqrt(np.einsum("ki,kij,kj->k", u, P[:, :3, :3], u))
    return out


def _in_msc(prior: GaussianState, own0: FloatArray, rng: np.random.Generator) -> MscState:
    """Return the prior's mean and covariance in MSC, by draws: with range this uncertain a Jacobian is not enough."""
    draws = prior.x + rng.normal(size=(20_000, 6)) @ np.linalg.cholesky(prior.P).T
    y = np.array([msc_from_world(x, own0) for x in draws])
    return MscState(prior.t, y.mean(axis=0), np.cov(y.T), own0)


def _range_error(case: Case, means: FloatArray) -> FloatArray:
    return np.asarray(polar(means - case.own)[..., 0] - polar(case.truth - case.own)[..., 0])


def weave(runs: int, rng: np.random.Generator, weaving: bool = True) -> list[dict[str, Any]]:
    """Infrared only with a range prior of 1000 m: what own-ship motion tells of range, and what it does not."""
    setup = Setup(5e-3, 1000.0, INFRARED, RATE, 0.01, prior_velocity=200.0)
    prior = setup.prior
    start = prior.x + rng.normal(size=(runs, 6)) @ np.linalg.cholesky(prior.P).T
    case = Case(start, setup.motion, 8.0, weaving, rng)
    spherical = _in_msc(prior, case.own0, rng)
    means, consistency, sigma = _spherical(case, spherical, case.infrared())
    plain, plain_nees = _cartesian(case, prior, case.infrared())
    limits = _range_bound(case, start, prior, case.infrared())
    rows = []
    for at in (2.0, 5.0, 8.0):
        k = round(at * RATE) - 1
        true_range = polar(case.truth - case.own)[:, k, 0]
        common: dict[str, Any] = {"case": "weave" if weaving else "straight", "time_s": at}
        reported: dict[str, Any] = {
            "range_sigma_reported_m": rms(sigma[:, k] * polar(means - case.own)[:, k, 0]),
            "range_observable": float(np.mean(sigma[:, k] < KNOWN_RANGE)),
            "true_range_m": float(np.mean(true_range)),
        }
        for method, m, n in (("msc", means, consistency), ("ekf", plain, plain_nees)):
            error = _range_error(case, m)[:, k]
            row: dict[str, Any] = {
                "method": method,
                "range_m": finite(rms(error)),
                "range_bound_m": rms(limits[:, k]),
                "range_over_bound": finite(rms(error / limits[:, k])),
                "anees_per_dim": finite(n[:, k].mean() / 6),
            }
            rows.append(common | row | (reported if method == "msc" else {}))
    return rows


def diffuse(runs: int, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Infrared only, range all but unknown: each filter starts from the same prior's moments in its coordinates."""
    s, velocity = 0.6, np.array([0.0, RELATIVE[4] + OWN[4], 0.0])
    direction = polar(RELATIVE[:3])
    angle = 5e-3
    own0 = own_path(np.zeros(1), True)[0]
    spherical = MscFilter().from_direction(0.0, direction[1], direction[2], angle, RANGE, s, 50.0, own0, velocity)
    r = np.exp(np.log(RANGE) - 0.5 * s * s + s * rng.normal(size=runs))
    azimuth = direction[1] + angle / np.cos(direction[2]) * rng.normal(size=runs)
    elevation = direction[2] + angle * rng.normal(size=runs)
    u = np.stack([np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)], -1)
    start = np.concatenate([r[:, None] * u + own0[:3], velocity + 50.0 * rng.normal(size=(runs, 3))], axis=1)
    case = Case(start, NearlyConstantVelocity(0.01), 7.0, True, rng)
    line = RELATIVE[:3] / np.linalg.norm(RELATIVE[:3])
    spread = RANGE**2 * np.expm1(s * s)  # variance of r; across the line of sight angle² E[r²]
    across = angle**2 * (RANGE**2 + spread)
    P = np.diag([0.0, 0.0, 0.0, 2500.0, 2500.0, 2500.0])
    P[:3, :3] = across * np.eye(3) + (spread - across) * np.outer(line, line)
    prior = GaussianState(0.0, np.r_[RANGE * line + own0[:3], velocity], P)
    results = {"msc": _spherical(case, spherical, case.infrared())[:2], "ekf": _cartesian(case, prior, case.infrared())}
    window = (case.t > 3.0 - 1e-9) & (case.t < 6.0 + 1e-9)
    return [
        {
            "case": "diffuse",
            "method": method,
            "time_s": "3-6",
            "range_m": finite(rms(_range_error(case, means)[:, window])),
            "range_median_m": finite(float(np.median(np.abs(_range_error(case, means)[:, window])))),
            "anees_per_dim": finite(float(np.mean(consistency[:, window])) / 6.0),
        }
        for method, (means, consistency) in results.items()
    ]


def _tangent_reports(case: Case, setup: Setup, tangent: bool) -> tuple[FloatArray, ...]:
    """Radar and infrared with noise in the tangent plane; `tangent` says whether the filter knows it."""
    ticks = [(k, radar) for k in range(len(case.t)) for radar in (False, True) if not radar or (k + 1) % 5 == 0]
    index, is_radar = np.array([k for k, _ in ticks]), np.array([r for _, r in ticks])
    seen = polar(case.truth - case.own)[:, index]
    az, el = seen[..., 1], seen[..., 2]
    u = np.stack([np.cos(el) * np.sin(az), np.cos(el) * np.cos(az), np.sin(el)], -1)
    e_az = np.stack([np.cos(az), -np.sin(az), np.zeros_like(az)], -1)
    e_el = np.stack([-np.sin(el) * np.sin(az), -np.sin(el) * np.cos(az), np.cos(el)], -1)
    noise = np.where(is_radar[None, :, None], case.noise[:, index, 1], case.noise[:, index, 0])
    sigma = np.where(is_radar, setup.radar_angle, setup.infrared)[None, :, None]
    noisy = polar(u + sigma * (noise[..., 1:2] * e_az + noise[..., 2:3] * e_el))
    z = np.full((*seen.shape[:2], 7), np.nan)
    z[..., 1:3] = noisy[..., 1:]
    z[:, is_radar, 0] = seen[:, is_radar, 0] + setup.radar_range * noise[:, is_radar, 0]
    radar = Radar(setup.radar_range, setup.radar_angle, setup.radar_angle, tangent=tangent)
    ir = Infrared(setup.infrared, setup.infrared, tangent=tangent)
    context = np.array([(radar if r else ir).at(pose(case.own[k])).context for k, r in ticks])
    return case.t[index], z, context, case.own[index]


def overhead(runs: int, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Over the top: azimuth noise in the tangent plane, and taken for constant."""
    setup = Setup(0.5e-3, 20.0, INFRARED, RATE, 1.0, prior_velocity=1.0)
    prior = setup.prior
    start = prior.x + rng.normal(size=(runs, 6)) @ np.linalg.cholesky(prior.P).T
    case = Case(start, setup.motion, 15.0, False, rng)
    y0 = msc_from_world(prior.x, case.own0)
    inverse = inverse_jacobian(y0)
    spherical = MscState(0.0, y0, inverse @ prior.P @ inverse.T, case.own0)
    rows = []
    for noise, tangent in (("tangent", True), ("constant_azimuth", False)):
        data = _tangent_reports(case, setup, tangent)
        window = data[0] > 8.0 - 1e-9
        results = {"msc": _spherical(case, spherical, data)[:2], "ekf": _cartesian(case, prior, data)}
        for method, (means, consistency) in results.items():
            truth = np.array([_at(case, data[0], run) for run in range(runs)])
            with np.errstate(all="ignore"):
                error = np.linalg.norm((means - truth)[:, window, :3], axis=-1)
                worst = np.sqrt(np.mean(error**2, axis=1))
            rows.append(
                {
                    "case": "overhead",
                    "method": f"{method}_{noise}",
                    "time_s": "8-15",
                    "position_m": finite(rms(error)),
                    "worst_run_m": finite(float(worst.max())),
                    "anees_per_dim": finite(float(np.mean(consistency[:, window])) / 6.0),
                }
            )
    return rows


CASES: dict[str, Callable[[int, np.random.Generator], list[dict[str, Any]]]] = {
    "weave": weave,
    "straight": lambda runs, rng: weave(runs, rng, weaving=False),
    "diffuse": diffuse,
    "overhead": overhead,
}
