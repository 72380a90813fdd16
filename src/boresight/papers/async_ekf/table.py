"""The table: the listing, each of its mistakes mended in turn, and filters at the data's own times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from boresight.bounds import trajectory_bound
from boresight.filters import stream
from boresight.filters.adaptive import AdaptiveNoise
from boresight.filters.imm import InteractingModels
from boresight.filters.stream import Reports
from boresight.models import CoordinatedTurn, NearlyConstantAcceleration, NearlyConstantVelocity
from boresight.models.motion import KernelMotion
from boresight.papers.async_ekf import listing
from boresight.papers.async_ekf.listing import IR_PRINTED, PARAMETERS, RADAR_PRINTED, motion_printed
from boresight.papers.async_ekf.scenario import IR, PRIOR, Q_ACCELERATION, RADAR, SCENARIOS, Data, Q, simulate
from boresight.papers.montecarlo import finite, nees, rms
from boresight.types.sensor import FloatArray
from boresight.types.state import GaussianState

CV = NearlyConstantVelocity(Q)
CA = NearlyConstantAcceleration(Q_ACCELERATION)
ACCELERATION_SIGMA = 2.0  # m/s², with which an acceleration begins
IMM = InteractingModels((CV, CoordinatedTurn(0.02, 1e-4), CA), 100.0)


class Outcome(NamedTuple):
    """One run at the scored epochs."""

    x: FloatArray  # (e, ≥6)
    P: FloatArray  # (e, ≥6, ≥6)


Method = Callable[[Data, int], Outcome]


@dataclass(frozen=True)
class _Printed(KernelMotion):
    """The listing's motion."""

    dimensions: int = 3
    kernel = staticmethod(motion_printed)
    layout = ("position", "velocity")

    def __post_init__(self) -> None:
        self.set_parameters(*PARAMETERS)


def _pairs(motion: KernelMotion, align: Callable[[Data, int], FloatArray], printed_noise: bool) -> Method:
    """Filter radar and infrared in pairs at the radar's times."""
    radar, ir = (RADAR_PRINTED, IR_PRINTED) if printed_noise else (RADAR, IR)

    def method(data: Data, run: int) -> Outcome:
        out = stream.run(data.state(run), motion, listing.paired(data, run, align(data, run), radar, ir))
        first = int(data.is_radar.sum()) - len(data.at)
        return Outcome(out.x[1::2][first:], out.P[1::2][first:])

    return method


def _own_times(motion: KernelMotion, radar_only: bool = False, smooth: bool = False, noise: float = 1.0) -> Method:
    """Filter every report at its own time; `noise` multiplies every variance that the filter assumes."""
    extra = motion.state_dimension - 6

    def method(data: Data, run: int) -> Outcome:
        reports = data.reports(run, data.is_radar if radar_only else None)
        at = np.searchsorted(reports.t, data.t[data.at])
        out = stream.run(_widened(data.state(run), extra), motion, inflated(reports, noise))
        x, P = stream.smooth(out) if smooth else (out.x, out.P)
        return Outcome(x[at], P[at])

    return method


def _widened(state: GaussianState, extra: int) -> GaussianState:
    """Add accelerations that begin at zero."""
    P = np.diag([0.0] * 6 + [ACCELERATION_SIGMA**2] * extra)
    P[:6, :6] = state.P
    return GaussianState(state.t, np.r_[state.x, np.zeros(extra)], P)


def inflated(reports: Reports, noise: float) -> Reports:
    """Return the reports with every assumed variance multiplied by `noise`."""
    context = reports.context.copy()
    context[:, 17:] *= noise
    return reports._replace(context=context)


def _imm(smooth: bool = False) -> Method:
    def method(data: Data, run: int) -> Outcome:
        state = data.state(run)
        begun = IMM.init(0.0, state.x, state.P, [0.0, 0.1, ACCELERATION_SIGMA])
        out = IMM.run(begun, data.reports(run), keep=smooth)
        if smooth:
            out = IMM.smooth(out)
        return Outcome(out.x[data.at], out.P[data.at])

    return method


def _adaptive(adaptive: AdaptiveNoise, noise: float = 1.0) -> Method:
    def method(data: Data, run: int) -> Outcome:
        state, reports = data.state(run), inflated(data.reports(run), noise)
        begun = adaptive.init(0.0, state.x, state.P, 2, ACCELERATION_SIGMA)
        out, _ = adaptive.run(begun, reports, data.is_radar.astype(np.int64))
        return Outcome(out.x[data.at], out.P[data.at])

    return method


METHODS: dict[str, Method] = {
    "as_printed": _pairs(_Printed(), listing.by_row, printed_noise=True),
    "right_times": _pairs(_Printed(), listing.interpolated, printed_noise=True),
    "right_noise": _pairs(_Printed(), listing.interpolated, printed_noise=False),
    "interpolated": _pairs(CV, listing.interpolated, printed_noise=False),
    "radar_only": _own_times(CV, radar_only=True),
    "cv": _own_times(CV),
    "ca": _own_times(CA),
    "imm": _imm(),
    "adaptive_q": _adaptive(AdaptiveNoise(replace(CV, q=Q / 30.0), memory=0)),
    "adaptive_r": _adaptive(AdaptiveNoise(CV, q_factors=(1.0,)), noise=25.0),
    "rts_cv": _own_times(CV, smooth=True),
    "rts_ca": _own_times(CA, smooth=True),
    "rts_imm": _imm(smooth=True),
}


def bound(data: Data, runs: int = 20) -> float:
    """Return the position bound (m, RMS over the scored epochs): the constant-velocity Riccati on the true paths."""
    squares = []
    for run in range(min(runs, len(data.z))):
        prior = GaussianState(0.0, data.start[run], PRIOR)
        P = trajectory_bound(prior, CV, data.reports(run), data.truth[run])[data.at]
        squares.append(np.trace(P[:, :3, :3], axis1=1, axis2=2).mean())
    return float(np.sqrt(np.mean(squares)))


def table(name: str, runs: int, seed: int, methods: tuple[str, ...] = tuple(METHODS)) -> list[dict[str, Any]]:
    """Return the rows of scenario `name` (S0, S2) over `runs` runs."""
    data = simulate(SCENARIOS[name], runs, np.random.default_rng(seed))
    limit = bound(data)
    rows = []
    for method in methods:
        outcomes = [METHODS[method](data, run) for run in range(runs)]
        error = np.array([o.x[:, :6] for o in outcomes]) - data.truth[:, data.at]
        position = rms(np.linalg.norm(error[..., :3], axis=-1))
        consistency = nees(error, np.array([o.P[:, :6, :6] for o in outcomes]))
        rows.append(
            {
                "scenario": name,
                "method": method,
                "position_m": finite(position),
                "velocity_m_s": finite(rms(np.linalg.norm(error[..., 3:], axis=-1))),
                "position_ratio": finite(position / limit),
                "anees_per_dim": finite(float(np.mean(consistency)) / 6.0),
            }
        )
    return rows


SHOWN = ("interpolated", "radar_only", "cv", "ca", "imm", "adaptive_q", "adaptive_r", "rts_ca", "rts_imm")


def over_time(
    name: str, runs: int, seed: int, methods: tuple[str, ...] = SHOWN
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the radar's times (e,) from first to last and, per method, RMS position and velocity errors (2, e)."""
    data = simulate(SCENARIOS[name], runs, np.random.default_rng(seed))
    data = data._replace(at=np.flatnonzero(data.is_radar))
    curves = {}
    for method in methods:
        e = np.array([METHODS[method](data, run).x[:, :6] for run in range(runs)]) - data.truth[:, data.at]
        curves[method] = np.sqrt(np.mean([(e[..., :3] ** 2).sum(-1), (e[..., 3:] ** 2).sum(-1)], axis=1))
    return data.t[data.at], curves
