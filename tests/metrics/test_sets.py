"""GOSPA and OSPA against their definitions, by brute force."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from boresight.metrics.sets import gospa, ospa


def gospa_by_definition(x: np.ndarray, y: np.ndarray, c: float, p: float) -> float:
    """Minimum over all partial assignments of sum d^p + c^p/2 (n + m - 2 |assigned|)."""
    best = c**p / 2 * (len(x) + len(y))
    for k in range(1, min(len(x), len(y)) + 1):
        for rows in itertools.combinations(range(len(x)), k):
            for columns in itertools.permutations(range(len(y)), k):
                d = sum(np.linalg.norm(x[i] - y[j]) ** p for i, j in zip(rows, columns, strict=True))
                best = min(best, d + c**p / 2 * (len(x) + len(y) - 2 * k))
    return best ** (1 / p)


@pytest.mark.parametrize("p", [1.0, 2.0])
def test_gospa_is_the_minimum_over_assignments(p: float) -> None:
    rng = np.random.default_rng(3)
    for _ in range(60):
        x, y = rng.uniform(0, 40, (rng.integers(0, 5), 2)), rng.uniform(0, 40, (rng.integers(0, 5), 2))
        g = gospa(x, y, 20.0, p)
        assert g.distance == pytest.approx(gospa_by_definition(x, y, 20.0, p), abs=1e-9)
        assert g.distance**p == pytest.approx(g.localisation + g.missed + g.false, abs=1e-9)


def test_nobody_reported_of_two_targets_costs_the_cut_off() -> None:
    assert gospa(np.zeros((2, 2)), np.zeros((0, 2)), 20.0, 2.0).distance == pytest.approx(20.0)


def test_ospa_of_its_paper() -> None:
    x = np.array([[0.0, 0.0], [100.0, 0.0]])
    assert ospa(x, x) == 0.0
    assert ospa(x, x[:1], 20.0, 2.0) == pytest.approx(np.sqrt(20.0**2 / 2))
    assert ospa(x, x + [3.0, 4.0], 20.0, 2.0) == pytest.approx(5.0)
    assert ospa(np.zeros((0, 2)), np.zeros((0, 2))) == 0.0
