"""Monte Carlo: many tracks that share a schedule. Our tiles, and NumPy over all tracks at once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from benchmarks.filters import MOTION, P0, SENSORS, X0, transition
from benchmarks.timing import FUSED_TIMES, Contenders, Row, peak, row, timed
from boresight.filters import ekf, packed, stream
from boresight.filters.imm import InteractingModels
from boresight.filters.many import MSC_ORDER, run_many_imm, run_many_msc, run_many_ukf
from boresight.filters.msc import MscFilter
from boresight.filters.ukf import UnscentedKalman
from boresight.kernels import imm_tiles, msc_tiles, tiles, ukf_tiles
from boresight.models import NearlyConstantVelocity

# Operations of the straight-line algebra, an update and the prediction before it, one component after another (as
# `blocks.condition` does; the tiles do some 40 more and wait less): radar (3 components), infrared (2)
FLOPS = {3: 415, 2: 309}


class Study(NamedTuple):
    """N tracks, k reports, radar and infrared in turn (or one of them alone)."""

    t: np.ndarray  # (k,)
    sensors: list
    x0: np.ndarray  # (N, 6)
    z: list[np.ndarray]  # (N, m) each


def study(tracks: int, reports: int, sensors: tuple = SENSORS) -> Study:
    """Return a study of one straight path."""
    rng = np.random.default_rng(8)
    t, used, z = 0.02 * np.arange(1, reports + 1), [sensors[k % len(sensors)] for k in range(reports)], []
    for now, sensor in zip(t, used, strict=True):
        truth = X0.copy()
        truth[:3] += now * X0[3:]
        noise = rng.normal(size=(tracks, sensor.dimension)) * np.sqrt(np.diag(sensor.R(truth)))
        z.append(sensor.h(truth) + noise)
    return Study(t, used, X0 + rng.normal(size=(tracks, 6)) * np.sqrt(np.diag(P0)), z)


def ours(s: Study) -> np.ndarray:
    """The public function, layout and all: final means (N, 6)."""
    return packed.run_many(MOTION, 0.0, s.x0, P0, s.t, s.sensors, s.z, threads=1).x


def kernel(s: Study) -> Callable[[], None]:
    """The kernel alone, on data that is laid out."""
    contexts, which = packed.schedule(s.sensors)
    blocks, measured = packed.layout(s.x0, P0, s.z)
    score, kept = np.empty((len(blocks), 2 * tiles.WIDTH)), np.empty((0, 0, 0))

    def call() -> None:
        tiles.run_tiles(blocks.copy(), 0.0, MOTION.q, s.t, measured, contexts, which, score, kept)

    return call


MODELS = InteractingModels((MOTION, NearlyConstantVelocity(q=20.0)), (10.0, 5.0))
UKF, MSC = UnscentedKalman(), MscFilter()


def imm_kernel(s: Study) -> Callable[[], None]:
    """Two interacting models, laid out."""
    contexts, which = packed.schedule(s.sensors)
    first, measured = packed.layout(s.x0, P0, s.z)
    blocks = np.concatenate((first, first, np.full((len(first), tiles.WIDTH), 0.5)), axis=1)
    q, chain = np.array([0.5, 20.0]), imm_tiles.transitions_of(np.array([10.0, 5.0]), np.diff(s.t, prepend=0.0))
    score = np.empty((len(blocks), 2 * tiles.WIDTH))
    return lambda: imm_tiles.run_imm_tiles(blocks.copy(), 0.0, q, chain, s.t, measured, contexts, which, score)


def ukf_kernel(s: Study) -> Callable[[], None]:
    """The unscented filter, laid out."""
    contexts, which = packed.schedule(s.sensors)
    full = [z if z.shape[1] == 3 else np.insert(z, 0, 0.0, axis=1) for z in s.z]
    blocks, measured = packed.layout(s.x0, P0, full)
    score = np.empty((len(blocks), 2 * tiles.WIDTH))
    return lambda: ukf_tiles.run_ukf_tiles(
        blocks.copy(), 0.0, MOTION.q, UKF.scaling, s.t, measured, contexts, which, score
    )


def msc_kernel(s: Study) -> Callable[[], None]:
    """The filter in modified spherical coordinates, its observer at rest, laid out."""
    contexts, which = packed.schedule(s.sensors)
    full = [z if z.shape[1] == 3 else np.insert(z, 0, 0.0, axis=1) for z in s.z]
    start, own = MSC.init(0.0, X0, P0), np.zeros((len(s.t), 6))
    y0, P = np.tile(start.y[MSC_ORDER], (len(s.x0), 1)), start.Py[np.ix_(MSC_ORDER, MSC_ORDER)]
    blocks, measured = packed.layout(y0, P, full)
    score = np.empty((len(blocks), 2 * tiles.WIDTH))
    return lambda: msc_tiles.run_msc_tiles(
        blocks.copy(), 0.0, MOTION.q, own[0], own, s.t, measured, contexts, which, score
    )


def agree(s: Study) -> None:
    """Hold the tiles of the other filters against the streams of their filters, for one track.

    The streams run in a process of their own, as plain Python: there they need not be compiled.
    """
    child = subprocess.Popen(
        [sys.executable, "-c", "from benchmarks import batch; print(batch.streams())"],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    begin, own = MSC.init(0.0, X0, P0), np.zeros((len(s.t), 6))
    y0 = np.tile(begin.y, (len(s.x0), 1))
    many = {
        "IMM": run_many_imm(MODELS, 0.0, s.x0, P0, s.t, s.sensors, s.z, threads=1).x,
        "MSC": run_many_msc(MOTION, 0.0, y0, begin.Py, own[0], s.t, s.sensors, s.z, own, threads=1).x,
        "UKF": run_many_ukf(UKF, MOTION, 0.0, s.x0, P0, s.t, s.sensors, s.z, threads=1).x,
    }
    alone = json.loads(child.communicate()[0])
    for name, x in many.items():
        np.testing.assert_allclose(x[0], alone[name], rtol=1e-9, atol=1e-8, err_msg=name)


def streams() -> str:
    """Return the final mean of the first track of `small()` by each of the other filters, as JSON."""
    s = small()
    start, reports = ekf.init(0.0, s.x0[0], P0), stream.stack(s.t, s.sensors, [z[0] for z in s.z])
    found = {
        "IMM": MODELS.run(MODELS.init(0.0, s.x0[0], P0, [0.0, 0.0]), reports).x[-1],
        "MSC": MSC.run(MSC.init(0.0, X0, P0), MOTION, reports, np.zeros((len(s.t), 6))).x[-1],
        "UKF": UKF.run(start, MOTION, reports).x[-1],
    }
    return json.dumps({name: x.tolist() for name, x in found.items()})


def small() -> Study:
    """Return the study on which contenders are compared."""
    return study(64, 40)


def numpy_batched(s: Study) -> np.ndarray:
    """Arrays over all tracks, dense matrices, the updates of `filters.by_hand`."""
    n = len(s.x0)
    x, P, now, eye = s.x0.copy(), np.broadcast_to(P0, (n, 6, 6)).copy(), 0.0, np.eye(6)
    for t, sensor, z in zip(s.t, s.sensors, s.z, strict=True):
        F, Q = transition(t - now)
        x, P, now = x @ F.T, F @ P @ F.T + Q, t
        e, north, u = x[:, 0], x[:, 1], x[:, 2]
        rho2 = e * e + north * north
        rho, r2 = np.sqrt(rho2), rho2 + u * u
        r = np.sqrt(r2)
        H = np.zeros((n, 3, 6))
        H[:, 0, :3] = np.stack((e, north, u), axis=1) / r[:, None]
        H[:, 1, 0], H[:, 1, 1] = north / rho2, -e / rho2
        H[:, 2, 0], H[:, 2, 1], H[:, 2, 2] = -e * u / (rho * r2), -north * u / (rho * r2), rho / r2
        h = np.stack((r, np.arctan2(e, north), np.arctan2(u, rho)), axis=1)
        if sensor.dimension == 2:
            H, h = H[:, 1:], h[:, 1:]
        y = z - h
        y[:, -2:] = (y[:, -2:] + np.pi) % (2 * np.pi) - np.pi
        HP = H @ P
        K = np.linalg.solve(HP @ H.transpose(0, 2, 1) + sensor.R(X0), HP).transpose(0, 2, 1)
        x = x + (K @ y[..., None])[..., 0]
        A = eye - K @ H
        P = A @ P @ A.transpose(0, 2, 1) + K @ sensor.R(X0) @ K.transpose(0, 2, 1)
    return x


def rows(quick: bool) -> list[Row]:
    """Agreement, then time per update and core, and the share of the measured peak."""
    np.testing.assert_allclose(ours(small()), numpy_batched(small()), rtol=0, atol=1e-6)
    agree(small())
    big = study(1024, 200)
    contenders: Contenders = {
        "boresight": (kernel(big), 1024 * 200),
        "boresight, with layout": (lambda: ours(big), 1024 * 200),
        "boresight, IMM of two models": (imm_kernel(big), 1024 * 200),
        "boresight, MSC": (msc_kernel(big), 1024 * 200),
        "boresight, UKF": (ukf_kernel(big), 1024 * 200),
        "NumPy batched": (lambda: numpy_batched(study_part), 1024 * 20),
        "peak": (peak, 2 * 128 * FUSED_TIMES),
    }
    study_part = study(1024, 20)
    for call, _ in contenders.values():
        call()
    found = timed(contenders, 5 if quick else 15)
    work, speed = "Monte Carlo, radar and IR EKF", found.pop("peak")
    out = [row(work, name, 1e9 * v, "ns per update", v / found["boresight"]) for name, v in found.items()]
    out.append(row("the core's peak", "fused multiply-add loop", 1e-9 / speed, "GFLOP/s"))
    share = 0.5 * (FLOPS[3] + FLOPS[2]) * speed / found["boresight"]
    out.append(row("Monte Carlo, share of the core's peak", "boresight", share, "fraction"))
    return out
