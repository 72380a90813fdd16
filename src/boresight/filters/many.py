"""IMM, unscented and MSC filter for thousands of tracks that share a schedule of reports, as `packed.run_many`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from boresight.errors import UserError
from boresight.filters.imm import InteractingModels
from boresight.filters.packed import BatchResult, checked, dense, fits, layout, out_of_tiles, schedule, spread
from boresight.filters.ukf import UnscentedKalman
from boresight.kernels import imm_tiles, msc_tiles, tiles, ukf_tiles
from boresight.models.base import KernelSensor
from boresight.models.motion import NearlyConstantVelocity
from boresight.types.enums import Component
from boresight.types.sensor import FloatArray

MSC_ORDER = [2, 0, 5, 3, 1, 4]  # azimuth, elevation, 1/range and their rates, as indices into MscState.y
POLAR = ([Component.RANGE, Component.AZIMUTH, Component.ELEVATION], [Component.AZIMUTH, Component.ELEVATION])


class MixtureBatch(NamedTuple):
    """What `run_many_imm` leaves of N tracks."""

    x: FloatArray  # (N, 6) moment-matched
    P: FloatArray  # (N, 6, 6)
    weights: FloatArray  # (N, 2)
    X: FloatArray  # (2, N, 6) each model's own
    PP: FloatArray  # (2, N, 6, 6)


def run_many_imm(
    models: InteractingModels,
    t0: float,
    x0: FloatArray,
    P0: FloatArray,
    t: FloatArray,
    sensors: Sequence[KernelSensor],
    z: Sequence[FloatArray],
    *,
    threads: int = 0,
) -> MixtureBatch:
    """Filter N tracks with two nearly constant velocities that interact; arguments as `packed.run_many`.

    Both models begin from x0, P0 with half the weight. Raises UserError for other than two such models.
    """
    motions = models.motions
    if len(motions) != 2 or not all(fits(m, sensors) for m in motions):
        raise UserError("run_many_imm takes two NearlyConstantVelocity in 3 dimensions, and sensors as run_many")
    checked(t0, x0, t, sensors, z)
    contexts, which = schedule(sensors)
    first, measured = layout(x0, P0, z)
    m, width = len(first), tiles.WIDTH
    blocks = np.concatenate((first, first, np.full((m, width), 0.5)), axis=1)
    times, q = np.ascontiguousarray(t, dtype=float), np.array([motion.q for motion in motions])  # type: ignore[attr-defined]
    chain = imm_tiles.transitions_of(-1.0 / np.diag(models.rates), np.diff(times, prepend=t0))
    score = np.empty((m, 2 * width))

    def part(rows: slice) -> None:
        imm_tiles.run_imm_tiles(
            blocks[rows], t0, q, chain, times, measured[rows], contexts, which, score[rows]
        )  # fmt: skip

    spread(part, m, threads)
    n, size = len(x0), 27 * width
    own = [dense(out_of_tiles(np.ascontiguousarray(blocks[:, i * size : (i + 1) * size]), n)) for i in range(2)]
    w = np.stack((blocks[:, 2 * size :].ravel()[:n], 1.0 - blocks[:, 2 * size :].ravel()[:n]), axis=1)
    X, PP = np.stack([x for x, _ in own]), np.stack([P for _, P in own])
    x = np.einsum("nj,jni->ni", w, X)
    d = X - x
    P = np.einsum("nj,jnab->nab", w, PP + d[..., :, None] * d[..., None, :])
    return MixtureBatch(x, P, w, X, PP)


def run_many_ukf(
    ukf: UnscentedKalman,
    motion: NearlyConstantVelocity,
    t0: float,
    x0: FloatArray,
    P0: FloatArray,
    t: FloatArray,
    sensors: Sequence[KernelSensor],
    z: Sequence[FloatArray],
    *,
    threads: int = 0,
) -> BatchResult:
    """Filter N tracks with the unscented filter; arguments as `packed.run_many`.

    Sensors measure range, azimuth and elevation, or azimuth and elevation; a track has all of a report or none of it.
    Raises UserError.
    """
    if not fits(motion, sensors) or any(list(s.components) not in POLAR for s in sensors):
        raise UserError(
            "run_many_ukf takes NearlyConstantVelocity in 3 dimensions, and sensors of (range,) azimuth, elevation"
        )
    checked(t0, x0, t, sensors, z)
    contexts, which = schedule(sensors)
    full = [row if s.dimension == 3 else np.insert(row, 0, 0.0, axis=1) for s, row in zip(sensors, z)]
    blocks, measured = layout(x0, P0, full)
    m, n, width = len(blocks), len(x0), tiles.WIDTH
    times, scaling, score = np.ascontiguousarray(t, dtype=float), ukf.scaling, np.empty((m, 2 * width))

    def part(rows: slice) -> None:
        ukf_tiles.run_ukf_tiles(
            blocks[rows], t0, motion.q, scaling, times, measured[rows], contexts, which, score[rows]
        )  # fmt: skip

    spread(part, m, threads)
    x, P = dense(out_of_tiles(blocks, n))
    sums = out_of_tiles(score, n)
    return BatchResult(x, P, sums[:, 0], sums[:, 1], np.empty((0, n, 6)))


def run_many_msc(
    motion: NearlyConstantVelocity,
    t0: float,
    y0: FloatArray,
    P0: FloatArray,
    own0: FloatArray,
    t: FloatArray,
    sensors: Sequence[KernelSensor],
    z: Sequence[FloatArray],
    own: FloatArray,
    *,
    threads: int = 0,
) -> BatchResult:
    """Filter N tracks in modified spherical coordinates: y0 (N, 6) and P0 as in `MscState`, the observer at own (k, 6).

    Sensors as `run_many_ukf`, standing at the observer with north-aligned axes. Results are in MSC. Raises UserError.
    """
    if not fits(motion, sensors) or any(list(s.components) not in POLAR for s in sensors):
        raise UserError(
            "run_many_msc takes NearlyConstantVelocity in 3 dimensions, and sensors of (range,) azimuth, elevation"
        )
    checked(t0, y0, t, sensors, z)
    if np.shape(own) != (len(t), 6) or np.shape(own0) != (6,):
        raise UserError(f"the observer needs one position and velocity a report: ({len(t)}, 6), and (6,) at t0")
    for sensor, place in zip(sensors, own):
        if not np.array_equal(sensor.pose.enu_from_sensor, np.eye(3)) or np.any(sensor.pose.position != place[:3]):
            raise UserError(
                "sensors must stand at the observer with north-aligned axes: sensor.at(SensorPose(position))"
            )
    contexts, which = schedule(sensors)
    full = [row if s.dimension == 3 else np.insert(row, 0, 0.0, axis=1) for s, row in zip(sensors, z)]
    P = np.broadcast_to(P0, (len(y0), 6, 6))[:, MSC_ORDER][:, :, MSC_ORDER]
    blocks, measured = layout(np.asarray(y0, dtype=float)[:, MSC_ORDER], P, full)
    m, n, width = len(blocks), len(y0), tiles.WIDTH
    times, score = np.ascontiguousarray(t, dtype=float), np.empty((m, 2 * width))
    start, path = np.array(own0, dtype=float), np.array(own, dtype=float)

    def part(rows: slice) -> None:
        msc_tiles.run_msc_tiles(
            blocks[rows], t0, motion.q, start, path, times, measured[rows], contexts, which, score[rows]
        )  # fmt: skip

    spread(part, m, threads)
    y, P = dense(out_of_tiles(blocks, n))
    back = np.argsort(MSC_ORDER)
    sums = out_of_tiles(score, n)
    return BatchResult(y[:, back], P[:, back][:, :, back], sums[:, 0], sums[:, 1], np.empty((0, n, 6)))
