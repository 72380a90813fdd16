"""`boresight paper wang2009`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from boresight.cli.output import print_json, print_table

COLUMNS = {
    "frame": "frame",
    "alpha_deg": "α\n°",
    "alpha_deg_residual": "−\nprinted",
    "beta_deg": "β\n°",
    "beta_deg_residual": "−\nprinted",
    "alpha_g_deg": "α_g\n°",
    "alpha_g_deg_residual": "−\nprinted",
    "beta_g_deg": "β_g\n°",
    "beta_g_deg_residual": "−\nprinted",
}
FROM_PRINTED = {
    "frame": "frame",
    "alpha_g_from_printed_deg": "α_g\n°",
    "alpha_g_from_printed_deg_residual": "−\nprinted",
    "beta_g_from_printed_deg": "β_g\n°",
    "beta_g_from_printed_deg_residual": "−\nprinted",
}
SCATTER = {"stage": "stage", "alpha_rms_deg": "α rms °", "beta_rms_deg": "β rms °", "travel_deg": "first to last °"}


def wang2009(
    *,
    camera: Literal["nominal", "fitted"] = "nominal",
    plot: Annotated[Path | None, Parameter(name=["--plot", "-o"])] = None,
    json: bool = False,
) -> None:
    """Print wang2009's table 1: the paper's 8 frames, ours, and ours minus printed, for each stage of the chain.

    Parameters
    ----------
    camera
        nominal (256 px, focal length 128 px, centre 128) or fitted to the table (132.6 px, centre 130.2, 129.4).
    plot
        Draw the target's track before and after steadying to this file (.png, .svg, .pdf).
    json
        Print one JSON object instead of tables.
    """
    from boresight.errors import UserError
    from boresight.papers import wang2009 as paper

    rows = paper.table(camera)
    if plot is not None:
        if plot.suffix.lower() not in {".png", ".svg", ".pdf"}:
            raise UserError(f"--plot {plot}: the file must end in .png, .svg or .pdf")
        if not plot.parent.is_dir():
            raise UserError(f"--plot {plot}: there is no folder {plot.parent}")
        paper.picture(str(plot), camera)
    if json:
        print_json("paper wang2009", {"camera": camera}, rows)
        return
    print_table(COLUMNS, rows, f"wang2009, table 1, {camera} camera: from the pixels", digits=3)
    print_table(FROM_PRINTED, rows, "from the printed α, β", digits=3)
    print_table(SCATTER, [s._asdict() for s in paper.scatter(camera)], "scatter about the mean", digits=3)
