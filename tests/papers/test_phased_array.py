"""phased_array's table on a few runs: the bounds hold, the printed chain does not."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.frames.tangent import separation
from boresight.papers.phased_array.modes import FILTER, reports_of
from boresight.papers.phased_array.scenario import LEAD, SCENARIOS, SKIPPED, orbit, simulate
from boresight.papers.phased_array.table import table

MAY_BE_OFF = {"nominal": (0.015, 0.045), "zenith": (0.015, 0.045), "ship": (0.048, 0.06), "biased": (0.03, 0.11)}


@pytest.mark.slow
@pytest.mark.parametrize("scenario", list(SCENARIOS))
def test_the_beam(scenario: str) -> None:
    rows = {r["mode"]: r for r in table((scenario,), 3, 1)}
    filtered, repaired = MAY_BE_OFF.get(scenario, (0.015, 0.045))
    # three runs instead of twelve: a tenth more for the scatter between runs
    assert rows["filter"]["rmse_deg"] <= filtered
    assert rows["repaired"]["rmse_deg"] <= 1.1 * repaired
    for mode in ("filter", "repaired"):
        assert rows[mode]["above_1deg"] == 0.0
        assert rows[mode]["available"] == 1.0
    assert rows["filter"]["reduction_vs_self"] >= 0.85
    if scenario != "clean":
        assert rows["as_printed"]["rmse_deg"] > 0.5


def test_the_filters_covariance_is_honest() -> None:
    """Normalised squared position error over 8 clean passes: mean 3 within what correlated nodes allow."""
    total = []
    for seed in range(8):
        p = simulate(SCENARIOS["clean"], np.random.default_rng(seed))
        out = FILTER.run(reports_of(p), p.node, p.node + LEAD)
        e = out.position - orbit(SCENARIOS["clean"].offset, p.node + LEAD)[0]
        total.append(
            np.einsum(
                "ni,nij,nj->n",
                e,
                np.linalg.inv(out.covariance),
                e,
            )[SKIPPED::25].mean()
        )
    # 8 passes of about 17 nearly independent nodes: 3 ± sqrt(6 / 136) · 3
    assert np.mean(total) == pytest.approx(3.0, abs=1.2)


def test_the_satellite_is_where_it_should_be() -> None:
    """4.5° off the zenith plane culminates at 44.7°, 0.05° at 89.4°; nodes one second apart above 10°."""
    for name, highest in (("nominal", 44.7), ("zenith", 89.4)):
        p = simulate(SCENARIOS[name], np.random.default_rng(0))
        elevation = np.degrees(np.arcsin(p.direction[:, 2]))
        assert elevation.max() == pytest.approx(highest, abs=0.5)
        assert elevation[:-2].min() > 9.9
        np.testing.assert_allclose(np.diff(p.node), 1.0)
        assert separation(p.direction[0], p.direction[-1]) > 1.5


def test_the_source_that_is_off_is_found_in_every_pass() -> None:
    """The table's twelve passes with a source 10 km off: found in all of them, 0.012° RMSE, no pass above 0.03°."""
    streams = np.random.default_rng([1, list(SCENARIOS).index("biased")]).spawn(12)
    worst = 0.0
    for rng in streams:
        p = simulate(SCENARIOS["biased"], rng)
        out = FILTER.run(reports_of(p), p.node, p.node + LEAD)
        at = (out.position - p.array)[SKIPPED:]
        truth = orbit(SCENARIOS["biased"].offset, p.node + LEAD)[0][SKIPPED:] - p.array[SKIPPED:]
        worst = max(worst, float(np.degrees(np.sqrt(np.mean(separation(at, truth) ** 2)))))
        assert (out.biased[SKIPPED:] == 1).all()
    assert worst < 0.03
