"""wang2009: pixels of a camera on a moving mount, turned into a frame that stands still. The paper's table 1.

The paper's axes are forward, left, up and its angles turn the other way than ours: heading ψ = −Ψ, pitch θ = −θ,
roll φ = φ, azimuth = −α; its Y runs up the picture. α and β of the table are body angles, with the mount in.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from boresight.frames.attitude import enu_from_body, ned_from_body
from boresight.frames.azel import azel_from_enu, enu_from_azel
from boresight.frames.camera import Camera, direction_from_pixel
from boresight.frames.tangent import separation
from boresight.types.sensor import FloatArray

MOUNT_DEG = (45.0, 0.0)  # ω1, ω2
CAMERAS = {
    "nominal": Camera(256, 256, 128.0, 128.0, 128.0, 128.0),  # a field of view of 90°
    "fitted": Camera(256, 256, 132.6, 132.6, 130.2, 256.0 - 129.4),  # least squares on the table's α, β
}

# Table 1: Ψ, θ, φ (°), X, Y (px), α, β, α_g, β_g (°), as printed.
TABLE = np.array(
    [
        [0.7, 0.1, 0.2, 75, 145, -22, 7, -22, 7],
        [5.3, -4.4, 4.6, 82, 142, -25, 6, -21, 8],
        [8.8, -7.9, 8.1, 93, 141, -29, 4, -21, 8],
        [12.5, -11.6, 11.8, 101, 141, -33, 4, -21, 8],
        [18.3, -17.3, 17.4, 111, 142, -38, 5, -20, 9],
        [23.3, -22.3, 22.4, 130, 150, -44, 9, -22, 9],
        [27.3, -26.4, 26.4, 138, 157, -49, 12, -22, 9],
        [30.6, -29.7, 29.7, 148, 165, -52, 15, -22, 9],
    ]
)
STAGES = ("alpha", "beta", "alpha_g", "beta_g", "alpha_g_from_printed", "beta_g_from_printed")


class Scatter(NamedTuple):
    """How far a stage's direction moves over the eight frames (deg)."""

    stage: str
    alpha_rms_deg: float  # about the mean
    beta_rms_deg: float
    travel_deg: float  # on the sphere, from the first frame to the last


def table(camera: str = "nominal") -> list[dict[str, Any]]:
    """Return one row per frame: printed angles, ours, and ours minus printed (deg), for each stage of the chain.

    `alpha_deg`, `beta_deg` from the pixel (§2.3, §2.4); `alpha_g_deg`, `beta_g_deg` the whole chain from the pixel
    (4); `…_g_from_printed_deg` from the printed α and β (§2.2 alone).
    """
    body, steady, steady_printed = directions(camera)
    ours = np.degrees(np.column_stack([*_paper_angles(body), *_paper_angles(steady), *_paper_angles(steady_printed)]))
    printed = TABLE[:, [5, 6, 7, 8, 7, 8]]
    rows = []
    for i in range(len(TABLE)):
        row: dict[str, Any] = {"frame": i + 1, "x_px": TABLE[i, 3], "y_px": TABLE[i, 4]}
        row |= {f"{name}_printed_deg": float(v) for name, v in zip(STAGES[:4], printed[i])}
        row |= {f"{name}_deg": float(v) for name, v in zip(STAGES, ours[i])}
        row |= {f"{name}_deg_residual": float(v) for name, v in zip(STAGES, ours[i] - printed[i])}
        rows.append(row)
    return rows


def directions(camera: str = "nominal") -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return unit vectors (8, 3): in the body from the pixels (right, forward, up), steadied, and from printed α, β."""
    yaw, pitch, roll = np.radians(TABLE[:, :3] * [-1.0, -1.0, 1.0]).T
    body_from_mount = ned_from_body(*np.radians([*MOUNT_DEG, 0.0]))
    seen = direction_from_pixel(CAMERAS[camera], TABLE[:, 3], CAMERAS[camera].height - TABLE[:, 4])
    body = seen @ body_from_mount.T
    alpha, beta = np.radians(TABLE[:, 5:7]).T
    right, forward, up = enu_from_azel(-alpha, beta, 1.0)
    printed = np.stack([forward, right, -up], axis=-1)
    R = enu_from_body(yaw, pitch, roll)
    steady, steady_printed = ((R @ v[:, :, None])[:, :, 0] for v in (body, printed))
    return np.stack([body[:, 1], body[:, 0], -body[:, 2]], axis=-1), steady, steady_printed


def scatter(camera: str = "nominal") -> list[Scatter]:
    """Return the scatter of the raw direction and of the steadied ones, from the pixels and from printed α, β."""
    out = []
    for stage, d in zip(("body", "steadied, from pixels", "steadied, from printed α, β"), directions(camera)):
        alpha, beta = np.degrees(_paper_angles(d))
        travel = float(np.degrees(separation(d[0], d[-1])))
        out.append(Scatter(stage, float(alpha.std()), float(beta.std()), travel))
    return out


def picture(path: str, camera: str = "nominal") -> None:
    """Draw the target's track before and after steadying to a file (PNG, SVG or PDF by its ending)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = table(camera)
    figure = Figure(figsize=(8, 4.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for label, a, b, colour, marker in (
        ("body, from pixels", "alpha_deg", "beta_deg", "tab:red", "o"),
        ("steadied, from pixels", "alpha_g_deg", "beta_g_deg", "tab:blue", "o"),
        ("steadied, from printed α, β", "alpha_g_from_printed_deg", "beta_g_from_printed_deg", "tab:green", "s"),
        ("as printed (α_g, β_g)", "alpha_g_printed_deg", "beta_g_printed_deg", "black", "x"),
    ):
        x, y = [r[a] for r in rows], [r[b] for r in rows]
        axes.plot(x, y, "-", marker=marker, color=colour, label=label, markersize=5, linewidth=1)
    for row in rows:
        axes.annotate(str(row["frame"]), (row["alpha_deg"], row["beta_deg"]), xytext=(4, 4), textcoords="offset points")
    axes.set(xlabel="α (deg, left positive)", ylabel="β (deg)", title="wang2009, table 1: the target in 8 frames")
    axes.set_aspect("equal")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", fontsize="small")
    figure.savefig(path, dpi=120)


def _paper_angles(d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return α (left positive) and β of east/north/up-like vectors: α_g = atan2(y, x), β_g = asin(z)."""
    azimuth, elevation, _ = azel_from_enu(d[:, 0], d[:, 1], d[:, 2])
    return -azimuth, elevation
