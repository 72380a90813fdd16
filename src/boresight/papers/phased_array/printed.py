"""phased_array as printed, with its fixed-weight baseline, and own tracking alone."""

from __future__ import annotations

import numpy as np

from boresight.align.delay import align_linear
from boresight.align.smooth import hat_matrix, one_step_predictor, weighted_differences
from boresight.frames.array_face import angles_from_face, face_from_angles
from boresight.frames.azel import enu_from_azel
from boresight.frames.geodetic import ecef_from_geodetic, geodetic_from_ecef
from boresight.frames.local import ecef_from_enu_rotation
from boresight.frames.tangent import unit
from boresight.fuse.weights import deviation_variance, inverse_variance
from boresight.kernels.guide import POSITION
from boresight.papers.phased_array.scenario import KINDS, SOURCE_1_OFFSET, STATION, Pass, Source
from boresight.screen.prediction import fourth_difference_ok, three_sigma_of_five_ok
from boresight.types import FloatArray

WINDOW = 7
ETA = np.arange(6.0, 0.0, -1.0)  # η1 > … > η6 of (5)
ALPHA, BETA = 0.5, 0.17


def as_printed(p: Pass, fixed: bool = False) -> FloatArray:
    """Return the predicted beam (k, 3) in face axes, one second ahead of each node; NaN before the first.

    Per source: (1) raw components drawn to the node by a line, §1.3's screen, face angles, (4), (5); then the dynamic
    weights of §2, or with `fixed` a third each. The first seven nodes are used raw.
    """
    series = np.stack([_face_series(p, i) for i in range(3)], axis=1)  # (k, 3, 2) face angles
    out = np.full((len(p.node), 3), np.nan)
    for k in range(len(p.node)):
        window = series[max(k - WINDOW + 1, 0) : k + 1]
        there = np.isfinite(window).all(axis=(0, 2))
        if not there.any():
            continue
        window = _unwrapped(window[:, there])
        if len(window) < WINDOW:
            ahead = window[-1]
        else:
            ahead = weighted_differences(np.tensordot(hat_matrix(WINDOW, 3), window, axes=1), ETA)
        weights = np.full(ahead.shape, 1.0 / len(ahead))
        if not fixed and len(window) == WINDOW and len(ahead) > 1:
            for axis in range(2):
                variance = np.maximum(deviation_variance(window[:, :, axis]), 1e-18)
                weights[:, axis] = inverse_variance(variance)
        angles = (weights * ahead).sum(axis=0)
        out[k] = face_from_angles(float(angles[0]), float(angles[1]), p.pole)
    return out


def _unwrapped(window: FloatArray) -> FloatArray:
    """Bring azimuths near to each other, over time and over sources."""
    out = window.copy()
    out[:, :, 0] = np.unwrap(out[:, :, 0], axis=0)
    out[:, :, 0] += 2 * np.pi * np.round((out[-1, 0, 0] - out[-1, :, 0]) / (2 * np.pi))
    return out


def _face_series(p: Pass, which: int) -> FloatArray:
    """Return the face angles (k, 2) of one source at the nodes: (1), §1.3 and §1.4; NaN before two reports."""
    values = _screened(_at_nodes(p, which), which)
    if which == 2:
        return values[:, :2]
    R = ecef_from_enu_rotation(STATION)
    out = np.full((len(p.node), 2), np.nan)
    known = np.isfinite(values).all(axis=1)
    v = values[known]
    if KINDS[which] == POSITION:
        enu = (
            np.stack(ecef_from_geodetic(np.clip(v[:, 0], -1.57, 1.57), v[:, 1], v[:, 2]), axis=-1) - p.array_now[known]
        ) @ R
    else:
        enu = np.stack(enu_from_azel(v[:, 0], v[:, 1], v[:, 2]), axis=-1) + SOURCE_1_OFFSET
    face = np.einsum("nji,nj->ni", p.face_now[known], enu)
    azimuth, elevation, _ = angles_from_face(face, p.pole)
    out[known] = np.stack([azimuth, elevation], axis=-1)
    return out


def _at_nodes(p: Pass, which: int) -> FloatArray:
    """Return raw components (k, 3) drawn to each node by the line through the two newest reports there, (1)."""
    s = p.sources[which]
    raw = _raw(s, which)
    out = np.full((len(p.node), 3), np.nan)
    for k, node in enumerate(p.node):
        here = np.flatnonzero((s.t_recv <= node) & (s.t > node - 30.0))[-2:]
        if len(here) == 2:
            a, b = raw[here[0]], raw[here[1]].copy()
            angular = slice(1, 2) if KINDS[which] == POSITION else slice(0, 1)
            b[angular] = a[angular] + np.mod(b[angular] - a[angular] + np.pi, 2 * np.pi) - np.pi
            out[k] = align_linear(s.t[here[0]], a, s.t[here[1]], b, node).value
    return out


def _raw(s: Source, which: int) -> FloatArray:
    if KINDS[which] == POSITION:
        return np.stack(geodetic_from_ecef(*s.z.T), axis=-1)
    z = s.z.copy()
    z[:, 2] = np.nan_to_num(z[:, 2])
    return z


def _screened(values: FloatArray, which: int) -> FloatArray:
    """Apply §1.3 as printed to each component: 17σ on Δ⁴ for the first five, then 3σ of five, else (3)."""
    sigma = [[9e-4, 9e-4, 20.0], [5e-5, 5e-5, 300.0], [4.4e-3, 4.4e-3, 1.0]][which]
    out = values.copy()
    first = np.flatnonzero(np.isfinite(values).all(axis=1))
    if len(first) < 5:
        return out
    begin = int(first[0])
    for c in range(3):
        y = out[:, c]
        j = begin + 4
        while j < len(y) and not fourth_difference_ok(y[j - 4 : j + 1], sigma[c]):
            j += 1
        for i in range(j + 1, len(y)):
            if not three_sigma_of_five_ok(y[i - 4 : i + 1]):
                y[i] = one_step_predictor(5, 1) @ y[i - 5 : i]
    return out


def own_tracking(p: Pass) -> FloatArray:
    """Return own tracking alone (k, 3), station ENU: alpha–beta on the steadied line of sight, one second ahead."""
    s = p.sources[2]
    R = ecef_from_enu_rotation(STATION)
    seen = np.einsum(
        "nij,nj->ni", np.einsum("ji,njk->nik", R, s.axes), np.stack(enu_from_azel(s.z[:, 0], s.z[:, 1]), axis=-1)
    )
    at = {float(t): d for t, d in zip(s.t, seen)}
    out = np.full((len(p.node), 3), np.nan)
    x, v = np.zeros(3), np.zeros(3)
    started = 0
    for k, node in enumerate(p.node):
        x = x + v
        d = at.get(float(node))
        if d is not None and started < 2:
            v = d - x if started else np.zeros(3)
            x = d
            started += 1
        elif d is not None:
            e = d - x
            x, v = x + ALPHA * e, v + BETA * e
        if started:
            out[k] = unit(x + v)
    return out
