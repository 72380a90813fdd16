"""wang2009's table: the residuals of each stage, and what steadying does."""

from __future__ import annotations

import numpy as np
import pytest

from boresight.papers import wang2009


def worst(camera: str, *stages: str) -> float:
    return max(abs(row[f"{stage}_deg_residual"]) for row in wang2009.table(camera) for stage in stages)


def test_each_stage_reproduces_the_table() -> None:
    """The paper prints whole degrees; the rest is the mount's play and the camera's unknown centre."""
    assert worst("nominal", "alpha", "beta") < 1.95
    assert worst("nominal", "alpha_g_from_printed", "beta_g_from_printed") < 1.15
    assert worst("nominal", "alpha_g", "beta_g") < 2.65
    assert worst("fitted", "alpha", "beta", "alpha_g", "beta_g") < 1.35


def test_steadying_holds_the_direction() -> None:
    raw, pixels, printed = wang2009.scatter()
    assert raw.travel_deg > 30.0
    assert max(printed.alpha_rms_deg, printed.beta_rms_deg) <= 1.0
    assert max(pixels.alpha_rms_deg, pixels.beta_rms_deg) <= 1.6
    assert pixels.travel_deg < 4.0


def test_the_chain_is_the_papers_matrices() -> None:
    """(4) written out with the paper's own matrices, in its own axes: C_g^r' of §2.2, and u = (cβcα, cβsα, sβ)."""
    _, _, ours = wang2009.directions()
    for row, d in zip(wang2009.TABLE, ours):
        psi, theta, phi = np.radians(row[:3])
        a, b = np.radians(row[5:7])
        c, s = np.cos, np.sin
        C_ga = np.array([[c(psi), s(psi), 0], [-s(psi), c(psi), 0], [0, 0, 1]])
        C_ab = np.array([[c(theta), 0, -s(theta)], [0, 1, 0], [s(theta), 0, c(theta)]])
        C_br = np.array([[1, 0, 0], [0, c(phi), s(phi)], [0, -s(phi), c(phi)]])
        g = (C_br @ C_ab @ C_ga).T @ [c(b) * c(a), c(b) * s(a), s(b)]  # forward (north), left (west), up
        np.testing.assert_allclose(d, [-g[1], g[0], g[2]], atol=1e-14)


@pytest.mark.parametrize("camera", list(wang2009.CAMERAS))
def test_the_picture_is_drawn(camera: str, tmp_path) -> None:
    wang2009.picture(str(tmp_path / "track.svg"), camera)
    assert "<svg" in (tmp_path / "track.svg").read_text(encoding="utf-8")
