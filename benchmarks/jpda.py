"""JPDA marginals: time against PyEHM, and how far belief propagation is from the exact: `python -m benchmarks.jpda`.

PyEHM is asked only where it is installed, and up to 12 × 12: it takes seconds beyond.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from boresight.association import jpda


def dense(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Every track sees every report, of unequal weight."""
    rng = np.random.default_rng(n)
    return np.exp(rng.normal(0.0, 1.0, (n, n))), np.full(n, 0.2)


def patch(rng: np.random.Generator, n: int, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Tracks of σ 1 in a square, `spacing` σ apart in the mean; p_D 0.9, clutter as dense as the tracks, gate d² 16."""
    side, p_d = spacing * np.sqrt(n), 0.9
    x = rng.uniform(0.0, side, (n, 2))
    seen = x[rng.random(n) < p_d]
    false = rng.uniform(0.0, side, (rng.poisson(n), 2))
    z = np.concatenate([seen + rng.standard_normal(seen.shape), false])
    d2 = ((z[None] - x[:, None]) ** 2).sum(axis=2)
    weight = p_d * np.exp(-0.5 * d2) / (2.0 * np.pi) / (n / side**2)
    return np.where(d2 < 16.0, weight, 0.0), np.full(n, 1.0 - p_d)


def best_of(call: Callable[[], Any], rounds: int) -> float:
    """Return the least time (s) of a call."""
    times = []
    for _ in range(rounds):
        begun = time.perf_counter()
        call()
        times.append(time.perf_counter() - begun)
    return min(times)


def pyehm() -> Any:
    """Return PyEHM's EHM2, or None."""
    try:
        return importlib.import_module("pyehm.core").EHM2
    except ImportError:
        return None


def error(exact: np.ndarray, loopy: np.ndarray, inside: np.ndarray) -> str:
    """Return the largest and the root mean square error of the pairs inside the gates."""
    off = np.abs(exact - loopy)[inside]
    return f"{off.max():.4f} {np.sqrt((off**2).mean()):.4f}" if off.size else "–"


def clusters() -> None:
    """Time exact and messages on dense clusters."""
    peer = pyehm()
    print("dense n × n: exact, ms | PyEHM (EHM2), ms | messages, ms | largest, rms error of the messages")
    for n in (6, 8, 10, 12, 14, 16):
        weight, miss = dense(n)
        exact = jpda.marginals(weight, miss, most_states=1e8)
        loopy = jpda.marginals(weight, miss, most_states=0.0)
        ms = [best_of(lambda: jpda.marginals(weight, miss, most_states=m), 10) * 1e3 for m in (1e8, 0.0)]  # noqa: B023
        told = "–"
        if peer is not None and n <= 12:
            both = np.c_[miss, weight]
            inside = np.ones_like(both, dtype=np.int32)
            assert np.abs(peer().run(inside, both)[:, 1:] - exact.p).max() < 1e-9
            told = f"{best_of(lambda: peer().run(inside, both), 1) * 1e3:.1f}"  # noqa: B023
        print(f"{n:2d}: {ms[0]:8.2f} | {told:>8s} | {ms[1]:6.2f} | {error(exact.p, loopy.p, weight > 0.0)}")


def scenes() -> None:
    """Error of the messages among clusters that are exact by default, and among those up to 100 times larger."""
    print("100 tracks, p_D 0.9, as many clutter points")
    print("spacing, σ: share of rows exact, ms | error of messages there: largest, rms | in larger clusters")
    rng = np.random.default_rng(1)
    for spacing in (8.0, 6.0, 5.0, 4.5, 4.0):
        share, spent, exact, loopy, small, large = 0.0, 0.0, [], [], [], []
        for _ in range(10):
            weight, miss = patch(rng, 100, spacing)
            usual = jpda.marginals(weight, miss)
            deep = jpda.marginals(weight, miss, most_states=100.0 * jpda.MOST_STATES)
            spent += best_of(lambda: jpda.marginals(weight, miss), 3)  # noqa: B023
            exact.append(deep.p[weight > 0.0])
            loopy.append(jpda.marginals(weight, miss, most_states=0.0).p[weight > 0.0])
            row = np.nonzero(weight)[0]
            small.append(usual.exact[row])
            large.append(deep.exact[row] & ~usual.exact[row])
            share += float(usual.exact.mean())
        e, b = np.concatenate(exact), np.concatenate(loopy)
        told = " | ".join(error(e, b, np.concatenate(which)) for which in (small, large))
        print(f"{spacing:.1f}: {share / 10:.2f} {spent / 10 * 1e3:6.2f} | {told}")


def main() -> None:
    """Print both tables."""
    clusters()
    scenes()


if __name__ == "__main__":
    main()
