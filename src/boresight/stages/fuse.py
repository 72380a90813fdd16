"""Fusion at measurement level as a stage: a slow report with range takes in the fast bearings of its own time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from boresight.errors import UserError
from boresight.fuse.estimates import covariance_intersection, weighted_least_squares
from boresight.fuse.weights import ResidualVariance
from boresight.kernels.measurement import measure, wrap
from boresight.stages.follow import pair
from boresight.stages.protocol import Belief, Note, Stepped
from boresight.stages.scene import AZ, EL, Place, Scene, local
from boresight.types import N_COMPONENTS, Fate, FloatArray, Scan

KINDS = ("inverse_variance", "dynamic", "covariance_intersection")
SAME = 1e-3  # s
WEAK = 1e-6  # information of a direction about what it does not see, against what it does


@dataclass(slots=True, eq=False)
class Waiting:
    """Slow looks, with the values of their time that have come so far; and how the fast sensors have done."""

    slow: list[tuple[Scan, dict[int, Scan]]] = field(default_factory=list)
    learned: dict[int, ResidualVariance] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class FuseStage:
    """Fuse each report of the `slow` sensor with the value of each `fast` sensor at its time and in its direction.

    A pair is made within `gate` standard deviations, nearest first. `inverse_variance`: weighted least squares;
    `dynamic`: the same, a fast sensor's variance multiplied by what its residuals against the fused values have shown
    (never below 1); `covariance_intersection`: for errors of unknown correlation. A value that finds no report goes
    on by itself where no value of its look was fused, else it is unused: half a look would count as misses.
    """

    scene: Scene
    kind: str
    slow: int
    fast: frozenset[int]
    gate: float = 4.0
    wait: float = 1.5  # s

    def __post_init__(self) -> None:
        if not (self.gate > 0 and self.wait > 0):
            raise UserError("fuse: gate and wait must be above zero")

    def init(self) -> Waiting:
        """Return the state before the first look."""
        return Waiting()

    def step(self, state: Waiting, scan: Scan, belief: Belief) -> tuple[Any, Stepped]:
        """Hold slow looks until the fast sensors' values are there, or `wait` seconds."""
        out: list[Scan] = []
        notes: list[Note] = []
        if scan.sensor == self.slow:
            state.slow.append((scan, {}))
        elif scan.sensor not in self.fast or not self._joins(state, scan):
            out.append(scan)
        while state.slow and self._ready(*state.slow[0], scan.t_recv):
            made, told = self._fuse(state, *state.slow.pop(0), scan.t_recv)
            out += made
            notes += told
        return state, Stepped(tuple(out), tuple(notes))

    def finish(self, state: Waiting) -> tuple[Note, ...]:
        """Reports that still waited for their partners."""
        held = [s for slow, fast in state.slow for s in (slow, *fast.values())]
        why = "the recording ended before it could be fused"
        told = [Note(int(row), Fate.UNUSED, why) for s in held for row in s.row]
        told += [Note(int(row), Fate.NO_DETECTION, "the look saw nothing") for s in held for row in s.empty_rows]
        return tuple(told)

    def _joins(self, state: Waiting, scan: Scan) -> bool:
        t = self.scene.look_time(scan)
        for slow, fast in state.slow:
            if abs(self.scene.look_time(slow) - t) < SAME and scan.sensor not in fast:
                fast[scan.sensor] = scan
                return True
        return False

    def _ready(self, slow: Scan, fast: dict[int, Scan], now: float) -> bool:
        return len(fast) == len(self.fast) or now - slow.t_recv > self.wait

    def _fuse(self, state: Waiting, slow: Scan, fast: dict[int, Scan], now: float) -> tuple[list[Scan], list[Note]]:
        z, R = slow.z.copy(), slow.covariance.copy()
        here = self.scene.place(self.slow, self.scene.valid(slow), now)
        alone: list[Scan] = []
        notes: list[Note] = []
        for sensor, values in sorted(fast.items()):
            there = self.scene.place(sensor, self.scene.valid(values), now)
            pairs: dict[int, int] = {}
            if here is not None and there is not None and len(values.t) and len(slow.t):
                learned = state.learned.setdefault(sensor, ResidualVariance())
                pairs, state.learned[sensor] = self._take(z, R, here, values, there, learned)
            notes += [
                Note(int(values.row[j]), Fate.ALIGNED, f"fused into row {slow.row[i]}", int(slow.row[i]))
                for j, i in pairs.items()
            ]
            rest = [j for j in range(len(values.t)) if j not in pairs]
            if not pairs:
                alone.append(_part(values, list(range(len(values.t))), now))
                continue
            why = "no report of the slow sensor in its direction"
            notes += [Note(int(values.row[j]), Fate.UNUSED, why) for j in rest]
            notes += [Note(int(row), Fate.NO_DETECTION, "the look saw nothing") for row in values.empty_rows]
        fused = Scan(slow.sensor, slow.t_look, now, slow.t, z, R, slow.row, slow.empty_rows)
        return [*alone, fused], notes

    def _take(
        self, z: FloatArray, R: FloatArray, here: Place, values: Scan, there: Place, learned: ResidualVariance
    ) -> tuple[dict[int, int], ResidualVariance]:
        """Fuse values into slow reports (z, R), in place; return which value went into which report."""
        n, m = len(values.t), len(z)
        scale = max(1.0, learned.ratio) if self.kind == "dynamic" else 1.0
        nis = np.full((n, m), np.inf)
        parts: dict[tuple[int, int], tuple[FloatArray, FloatArray, FloatArray]] = {}
        for j in range(n):
            seen = [c for c in (AZ, EL) if np.isfinite(values.z[j, c])]
            noise = values.covariance[j][np.ix_(seen, seen)] * scale
            for i in range(m):
                used = np.flatnonzero(np.isfinite(z[i]))
                y, J = _residual(z[i], used, here.position[i], here.axes[i], values.z[j], seen, there, j)
                S = J @ R[i][np.ix_(used, used)] @ J.T + noise
                nis[j, i] = float(y @ np.linalg.solve(S, y))
                parts[j, i] = y, J, noise
        out = {}
        for j, i in enumerate(pair(nis, np.full(nis.shape, self.gate**2))):
            if i < 0:
                continue
            y, J, noise = parts[j, int(i)]
            used = np.flatnonzero(np.isfinite(z[i]))
            P = R[i][np.ix_(used, used)]
            learned = learned.after(y, J @ P @ J.T, noise / scale)
            dx, cov = self._combine(P, y, J, noise)
            z[i, used] += dx
            z[i, AZ] = wrap(z[i, AZ]) if np.isfinite(z[i, AZ]) else np.nan
            R[i][np.ix_(used, used)] = cov
            out[j] = int(i)
        return out, learned

    def _combine(self, P: FloatArray, y: FloatArray, J: FloatArray, noise: FloatArray) -> tuple[FloatArray, FloatArray]:
        k = len(P)
        if self.kind != "covariance_intersection":
            C = np.zeros((k + len(y), k + len(y)))
            C[:k, :k], C[k:, k:] = P, noise
            best = weighted_least_squares(np.r_[np.zeros(k), y], np.vstack([np.eye(k), J]), C)
            return best.x, best.P
        # a direction as an estimate of all components: hardly any information on what it does not see
        info = J.T @ np.linalg.solve(noise, J)
        P2 = np.linalg.inv(info + WEAK * np.linalg.inv(P))
        both = covariance_intersection([np.zeros(k), P2 @ J.T @ np.linalg.solve(noise, y)], [P, P2])
        return both.x, both.P


def _residual(
    z: FloatArray, used: NDArray[np.int64], position: FloatArray, axes: FloatArray,
    bearing: FloatArray, seen: list[Any], there: Place, j: int,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """What the bearing says beyond the slow report, and its Jacobian by the slow report's measured components."""

    def predicted(report: FloatArray) -> FloatArray:
        world = position + axes @ local(report[None])[0][0]
        out, H = np.empty(N_COMPONENTS), np.empty((N_COMPONENTS, 6))
        measure(world, np.zeros(3), there.position[j], np.zeros(3), there.axes[j], out, H)
        return out[seen]

    def wrapped(d: FloatArray) -> FloatArray:
        return np.asarray(d - 2 * np.pi * np.floor((d + np.pi) / (2 * np.pi)))

    y = wrapped(bearing[seen] - predicted(z))
    J = np.zeros((len(seen), len(used)))
    for k, c in enumerate(used):
        step = np.zeros(N_COMPONENTS)
        step[c] = 1e-6 if c in (AZ, EL) else 1e-3
        J[:, k] = wrapped(predicted(z + step) - predicted(z - step)) / (2 * step[c])
    return y, J


def _part(scan: Scan, rows: list[int], now: float) -> Scan:
    return Scan(
        scan.sensor, scan.t_look, now, scan.t[rows], scan.z[rows], scan.covariance[rows], scan.row[rows],
        scan.empty_rows,
    )  # fmt: skip
