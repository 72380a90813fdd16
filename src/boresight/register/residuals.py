"""What tracks' reports say beyond what paths and errors predict, whitened and weighted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from boresight.frames.pose import PoseTrack, sensor_pose
from boresight.kernels.registration import TIME
from boresight.kernels.registration_batch import reports_of
from boresight.register.paths import Path, interval
from boresight.types import N_COMPONENTS, Component, FloatArray, Sensor

ANGLES = (Component.AZIMUTH, Component.ELEVATION)
DELTA = 0.05  # s, of the time derivative
STRETCH = 40.0  # s


class Observed(NamedTuple):
    """Reports that belong to tracks; world ENU, times of validity as declared (the latency is off)."""

    track: NDArray[np.int64]  # (n,) 0 … tracks − 1
    sensor: NDArray[np.int64]  # (n,)
    t: FloatArray  # (n,) s
    z: FloatArray  # (n, 7) NaN where not measured or not used
    R: FloatArray  # (n, 7, 7) NaN where not measured
    fix: FloatArray  # (n, 3) position that the report gives by itself, NaN for a direction
    alike: FloatArray  # (n,) reports of the same sensor and track within its decorrelation time: together one look
    poses: tuple[PoseTrack | None, ...]  # by sensor
    tracks: int


class Lines(NamedTuple):
    """Linearised residuals y ≈ J dx + S de, whitened: one line per component of a report."""

    lines: int
    row: NDArray[np.int64]  # (e,) entries of J: line
    track: NDArray[np.int64]  # (e,) the track whose path the entry belongs to, −1 for a coloured error
    column: NDArray[np.int64]  # (e,) place within the path, or among all unknowns for a coloured error
    value: FloatArray  # (e,)
    y: FloatArray  # (lines,)
    S: FloatArray  # (lines, 5)
    sensor: NDArray[np.int64]  # (lines,)
    cluster: NDArray[np.int64]  # (lines,) track and stretch of time
    raw: FloatArray  # (lines,) residual in declared standard deviations, NaN where nothing is measured

    def place(self, base: Sequence[int]) -> NDArray[np.int64]:
        """Columns among all unknowns, `base` (tracks,) being where each path begins."""
        start = np.append(np.asarray(base, dtype=np.int64), 0)
        out: NDArray[np.int64] = start[self.track] + self.column
        return out


def cluster_of(track: int, t: FloatArray) -> NDArray[np.int64]:
    """Number the stretch of time and the track that something belongs to: errors there may be alike."""
    out: NDArray[np.int64] = track * 1_000_000 + np.mod(np.floor(t / STRETCH), 1_000_000).astype(np.int64)
    return out


def linearise(
    observed: Observed,
    paths: Sequence[Path],
    errors: FloatArray,
    sensors: Sequence[Sensor],
    channels: Mapping[tuple[int, int, int], tuple[int, int]],
    first_coloured: int,
    slow: FloatArray,
    robust: float,
    scale: FloatArray,
    extent: float,
) -> Lines:
    """Linearise every report about `paths` and `errors` (sensors, 5), the coloured errors at `slow`.

    `scale` (sensors,) multiplies the declared variances; residuals beyond `robust` count less (Cauchy's
    weights); a direction may be that of any point within `extent` (m) of the target's middle.
    """
    d = paths[0].x.shape[1] // 2
    parts: list[Lines] = []
    count = 0
    for k, path in enumerate(paths):
        for s in np.unique(observed.sensor[observed.track == k]):
            rows = np.flatnonzero((observed.track == k) & (observed.sensor == s))
            part = _group(observed, rows, path, errors[s], sensors[int(s)], d)
            wide = scale[s] * observed.alike[rows]
            cluster = cluster_of(k, observed.t[rows])
            lines = _lines(part, k, int(s), count, channels, first_coloured, slow, robust, wide, cluster, extent)
            parts.append(lines)
            count += lines.lines
    joined = {
        name: np.concatenate([getattr(p, name) for p in parts])
        for name in ("row", "track", "column", "value", "y", "S", "sensor", "cluster", "raw")
    }
    return Lines(lines=count, **joined)


class _Group(NamedTuple):
    """One sensor's reports of one track against the prediction."""

    z: FloatArray  # (n, m) measured components
    predicted: FloatArray  # (n, m)
    H: FloatArray  # (n, m, 2d) by the state at the knot before
    S: FloatArray  # (n, m, 5)
    R: FloatArray  # (n, m, m)
    mask: list[int]  # components
    knot: NDArray[np.int64]  # (n,)
    share: FloatArray  # (n,) of the way to the next knot
    far: FloatArray  # (n,) m, predicted range


def _group(
    observed: Observed, rows: NDArray[np.int64], path: Path, error: FloatArray, sensor: Sensor, d: int
) -> _Group:
    pose = observed.poses[int(observed.sensor[rows[0]])]
    t = observed.t[rows] - error[TIME]
    z, H, S, knot, dt = _predict(path, t, sensor, pose, error, d)
    later = _predict(path, t + DELTA, sensor, pose, error, d)[0]
    before = _predict(path, t - DELTA, sensor, pose, error, d)[0]
    change = later - before
    change[:, list(ANGLES)] = np.angle(np.exp(1j * change[:, list(ANGLES)]))
    S[:, :, TIME] = -change / (2 * DELTA)
    measured = np.isfinite(observed.z[rows])
    mask = [c for c in range(N_COMPONENTS) if measured[:, c].any() and not (d == 2 and c in (2, 6))]
    state = np.zeros((len(rows), N_COMPONENTS, 2 * d))
    state[:, :, :d] = H[:, :, :d]
    state[:, :, d:] = H[:, :, 3 : 3 + d] + dt[:, None, None] * H[:, :, :d]
    R = observed.R[rows][:, mask][:, :, mask]
    from_knot = dt / (path.t[1] - path.t[0])
    return _Group(
        observed.z[rows][:, mask],
        z[:, mask],
        state[:, mask],
        S[:, mask],
        R,
        mask,
        knot,
        from_knot,
        z[:, Component.RANGE],
    )


def _predict(
    path: Path, t: FloatArray, sensor: Sensor, pose: PoseTrack | None, error: FloatArray, d: int
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[np.int64], FloatArray]:
    """Reports (n, 7) at true times `t`, Jacobians by the state there, and the knots before."""
    knot = interval(path.t, t)
    dt = t - path.t[knot]
    n = len(t)
    p, v = np.zeros((n, 3)), np.zeros((n, 3))
    p[:, :d] = path.x[knot, :d] + dt[:, None] * path.x[knot, d:]
    v[:, :d] = path.x[knot, d:]
    z, H, S = np.empty((n, N_COMPONENTS)), np.empty((n, N_COMPONENTS, 6)), np.empty((n, N_COMPONENTS, 5))
    if pose is not None:
        t = np.clip(t, pose.t[0] - pose.max_extrapolation, pose.t[-1] + pose.max_extrapolation)
    place, moving, axes = sensor_pose(sensor, pose, t)
    reports_of(p, v, place, moving, np.ascontiguousarray(axes), np.tile(error, (n, 1)), z, H, S)
    return z, H, S, knot, dt


def _lines(
    g: _Group,
    track: int,
    sensor: int,
    first: int,
    channels: Mapping[tuple[int, int, int], tuple[int, int]],
    first_coloured: int,
    slow: FloatArray,
    robust: float,
    wide: FloatArray,
    cluster: NDArray[np.int64],
    extent: float,
) -> Lines:
    n, m = g.z.shape
    y = g.z - g.predicted
    for i, c in enumerate(g.mask):
        if c in ANGLES:
            y[:, i] = np.angle(np.exp(1j * y[:, i]))
        if (track, sensor, c) in channels:
            at = channels[track, sensor, c][0]
            y[:, i] -= (1.0 - g.share) * slow[at + g.knot] + g.share * slow[at + g.knot + 1]
    # a report without a component has it left out: infinite variance
    missing = ~np.isfinite(g.z)
    R = np.where(missing[:, :, None] | missing[:, None, :], 0.0, np.nan_to_num(g.R))
    if set(g.mask) <= set(ANGLES):
        R[:, np.arange(m), np.arange(m)] += (extent / np.maximum(g.far, extent + 1e-9))[:, None] ** 2
    R[:, np.arange(m), np.arange(m)] = np.where(missing, 1e18, R[:, np.arange(m), np.arange(m)])
    white = np.linalg.inv(np.linalg.cholesky(R))
    y = np.einsum("kij,kj->ki", white, np.where(missing, 0.0, y))
    raw = np.where(missing, np.nan, y).ravel()
    white = white / np.sqrt(wide)[:, None, None]
    y = y / np.sqrt(wide)[:, None]
    measured = np.maximum((~missing).sum(axis=1), 1)
    root = 1.0 / np.sqrt(1.0 + (y**2).sum(axis=1) / (robust**2 * measured))
    white = white * root[:, None, None]
    y = y * root[:, None]
    H = np.einsum("kij,kja->kia", white, g.H)
    S = np.einsum("kij,kja->kia", white, g.S)
    width = H.shape[2]
    line = first + np.arange(n)[:, None] * m + np.arange(m)
    column = np.broadcast_to((width * g.knot)[:, None, None] + np.arange(width), H.shape)
    row, owner, place, value = [line[:, :, None].repeat(width, 2)], [np.full(H.shape, track)], [column], [H]
    for i, c in enumerate(g.mask):
        if (track, sensor, c) not in channels:
            continue
        at = first_coloured + channels[track, sensor, c][0]
        for shift, part in ((0, 1.0 - g.share), (1, g.share)):
            row.append(line)
            owner.append(np.full(line.shape, -1))
            place.append(np.broadcast_to((at + shift + g.knot)[:, None], line.shape))
            value.append(white[:, :, i] * part[:, None])

    flat = [np.concatenate([np.asarray(part).ravel() for part in parts]) for parts in (row, owner, place)]
    values = np.concatenate([part.ravel() for part in value])
    of_sensor = np.full(n * m, sensor)
    return Lines(
        n * m, flat[0], flat[1], flat[2], values, y.ravel(), S.reshape(n * m, -1), of_sensor, cluster.repeat(m), raw
    )
