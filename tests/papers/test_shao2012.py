"""shao2012: the filters stand at the bound, the paper's pipeline where its mathematics puts it."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.align.compression import combine, compress, compressed_variance
from boresight.papers.shao2012.alignment import aligned
from boresight.papers.shao2012.methods import METHODS
from boresight.papers.shao2012.scenario import SETS, simulate
from boresight.papers.shao2012.table import bound, errors, over_time, table

RATIOS = ("az_ratio", "el_ratio", "range_ratio", "velocity_ratio")


AT_THE_BOUND = ("ekf", "iekf", "ukf", "msc")


def by_method(name: str, runs: int, methods: tuple[str, ...] = tuple(METHODS)) -> dict[str, dict[str, float]]:
    return {row["method"]: row for row in table(name, runs, seed=1, methods=methods)}


def test_set_a_small() -> None:
    rows = by_method("A", 40)
    # range has about 2 independent errors a run over 3-6 s: 80 in all, a ratio's deviation is 8 %; three of them
    for method in AT_THE_BOUND:
        for ratio in RATIOS:
            assert 0.76 < rows[method][ratio] < 1.24, (method, ratio)
        assert 0.75 < rows[method]["anees_per_dim"] < 1.25
    assert rows["as_printed"]["az_mrad"] is None or rows["as_printed"]["az_mrad"] > 100.0
    assert 1.3 < rows["corrected_angles_only"]["az_ratio"] < 1.7
    assert rows["corrected_angles_only"]["range_ratio"] > 3.0
    assert rows["radar_only"]["az_ratio"] > 10.0
    assert rows["rts"]["az_ratio"] < 0.6
    # the bound is nearly the same in every run: METHODS' figures to their printed digits
    bound = rows["bound"]
    assert [bound[k] for k in ("az_mrad", "el_mrad")] == pytest.approx([0.137, 0.121], abs=0.003)
    assert [bound[k] for k in ("range_m", "velocity_m_s")] == pytest.approx([5.40, 2.78], rel=0.02)


@pytest.mark.parametrize(
    ("name", "runs"),
    [("A", 60), pytest.param("A", 500, marks=pytest.mark.slow), pytest.param("C", 300, marks=pytest.mark.slow)],
)
def test_alignment_rows(name: str, runs: int) -> None:
    """Compressed innovations stand at the bound with one update for 6 (A) or 11 (C) reports; compression does not.

    METHODS' figures for compression on A within 5 % of 500 runs; of 60 within 15 % (see above: about 8 % each).
    """
    setup = SETS[name]
    data = simulate(setup, runs, np.random.default_rng(1))
    limits = np.sqrt(np.mean(bound(setup, data) ** 2, axis=1))
    slack = 0.05 if runs >= 300 else 0.15
    got = {}
    for kind in ("compress", "innovations", "interpolate"):
        e = errors(data, aligned(setup, data, kind))
        got[kind] = np.sqrt(np.mean(e**2, axis=(1, 2)))
    assert (got["innovations"] <= (1.0 + slack) * limits).all()
    assert (got["interpolate"][:2] > got["compress"][:2]).all()
    if name == "A":
        figures = np.array([0.197e-3, 0.179e-3, 5.50, 2.94])
        np.testing.assert_allclose(got["compress"][:2], figures[:2], rtol=slack)
        assert (got["compress"][2:] <= (1.0 + slack) * figures[2:]).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", list(SETS))
def test_all_sets_at_the_bound(name: str) -> None:
    rows = by_method(name, 500, AT_THE_BOUND)
    for method in AT_THE_BOUND:
        for ratio in RATIOS:
            assert rows[method][ratio] <= 1.05, (method, ratio)
        assert 0.95 <= rows[method]["anees_per_dim"] <= 1.05


@pytest.mark.parametrize("runs", [60, pytest.param(500, marks=pytest.mark.slow)])
def test_the_papers_headline_on_set_p(runs: int) -> None:
    """Azimuth 0.2 mrad after 2-3 s and range 50 m after 4-5 s, with angles only; what it costs against ours."""
    t, curves = over_time("P", runs, 1, ("corrected_angles_only", "ekf"))
    paper, ours = curves["corrected_angles_only"], curves["ekf"]
    # an RMS over 60 runs at one instant has a relative deviation of 9 %, much less averaged over seconds
    assert np.sqrt(np.mean(paper[0, (t > 2.95) & (t < 6.05)] ** 2)) < 0.25e-3
    assert np.sqrt(np.mean(paper[2, (t > 3.95) & (t < 7.05)] ** 2)) < 60.0
    assert np.sqrt(np.mean(ours[2, (t > 3.95) & (t < 7.05)] ** 2)) < 15.0


def test_compression_is_the_least_squares_line() -> None:
    rng = np.random.default_rng(3)
    z = 0.1 * rng.normal(size=(4000, 5))
    fit = np.array([np.polyval(np.polyfit(np.arange(5) - 4, row, 1), 0) for row in z[:50]])
    np.testing.assert_allclose(compress(z[:50]), fit, atol=1e-12)
    # 4000 draws: a variance has a relative deviation of 2.2 %; four of them
    assert np.var(compress(z)) == pytest.approx(compressed_variance(0.1, 5), rel=0.09)
    wrapped = np.array([[3.13, 3.14, -3.13318530718, -3.12318530718, -3.11318530718]])
    assert compress(wrapped)[0] == pytest.approx(2 * np.pi - 3.11318530718, abs=1e-6)


def test_combining_angles_wraps() -> None:
    value, variance = combine(np.array([3.1]), 1.0, np.array([-3.1]), 1.0)
    assert abs(value[0]) == pytest.approx(np.pi)
    assert variance == 0.5


def test_same_seed_same_data() -> None:
    a, b = (simulate(SETS["A"], 2, np.random.default_rng(7)) for _ in range(2))
    np.testing.assert_array_equal(a.z, b.z)
