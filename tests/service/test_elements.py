"""Elements as a guide: too old, failing or of a satellite that is not there, they cost nobody else anything."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmarks.passes import EPOCH, lines_of

from boresight.config.site import pointer_for, read_site
from boresight.errors import UserError
from boresight.frames.local import ecef_from_enu
from boresight.service.elements import Elements
from boresight.service.live import run_live

SITE = """
[site]
latitude_deg = 47.0
longitude_deg = 8.0
[dynamics]
kind = "orbit"
{source}
[[source]]
id = "gps"
sigma_position_m = 100.0
"""
SOURCE = '[[source]]\nid = "sat"\ntle = "sats.tle"\nsigma_position_m = 1000.0\n{more}\n'
GOOD = lines_of(5, 15.2, 0.0005, 51.6, 10.0, 0.0, 20.0)
DECAYS = lines_of(6, 16.41, 0.0001, 52.0, 17.0, 140.0, 131.0, 2e-3)


def station(tmp_path: Path, more: str = "", lines: tuple[str, str] = GOOD):
    (tmp_path / "sats.tle").write_text("\n".join(["SAT", *lines, "CUT", GOOD[0][:60], GOOD[1]]), encoding="utf-8")
    (tmp_path / "site.toml").write_text(SITE.format(source=SOURCE.format(more=more)), encoding="utf-8")
    return read_site(tmp_path / "site.toml")


def test_elements_that_fail_cost_their_own_reports_only(tmp_path: Path) -> None:
    s = station(tmp_path, lines=DECAYS)
    pointer = pointer_for(s)
    state, elements = pointer.init(), Elements(pointer, s.elements, {"sat": 30.0})
    elements.report(state, EPOCH + 60.0)
    assert not elements.faults
    assert pointer.tick(state, EPOCH + 60.0)[1] is not None
    assert elements.told(EPOCH + 86400.0) == "sat elements 1.0 d"
    for k in range(5):
        elements.report(state, EPOCH + 20 * 86400.0 + k)
    assert elements.counts["elements_failed"] == 5
    assert "sat: " in elements.told(EPOCH + 20 * 86400.0)
    at = np.array(ecef_from_enu(1e5, 2e5, 5e5, s.site))
    state = pointer.init()
    for k in range(5):  # the other source goes on alone
        t = EPOCH + 20 * 86400.0 + 10.0 + k
        elements.report(state, t)
        pointer.take(state, 1, t, at)
    assert pointer.tick(state, EPOCH + 20 * 86400.0 + 15.0)[1] is not None


def test_elements_too_old_are_not_used_unless_asked_for(tmp_path: Path) -> None:
    s = station(tmp_path)
    pointer = pointer_for(s)
    state, elements = pointer.init(), Elements(pointer, s.elements, {"sat": 30.0})
    elements.report(state, EPOCH + 31 * 86400.0)
    assert elements.counts["elements_old"] == 1
    assert elements.told(EPOCH + 31 * 86400.0) == "sat: elements 31 days old, more than 30"
    assert pointer.tick(state, EPOCH + 31 * 86400.0)[1] is None
    assert not elements.usable(EPOCH + 31 * 86400.0)
    with pytest.raises(UserError, match=r"no \[input\], and no elements to guide: sat elements .* see max_age_days"):
        run_live(s, pointer, 0.1, None)
    assert station(tmp_path, "max_age_days = inf").file.source[0].max_age_days == np.inf
    with pytest.raises(UserError, match="max_age_days must be above zero"):
        station(tmp_path, "max_age_days = 0.0")


def test_a_satellite_by_name_or_number(tmp_path: Path) -> None:
    for named in ("SAT", "00005"):
        assert station(tmp_path, f'satellite = "{named}"').elements["sat"].name == "SAT"
    with pytest.raises(UserError, match=r"no satellite 'CUT': .*line 5: 60 characters long"):
        station(tmp_path, 'satellite = "CUT"')
    with pytest.raises(UserError, match="did you mean 'SAT'"):
        station(tmp_path, 'satellite = "SATT"')
