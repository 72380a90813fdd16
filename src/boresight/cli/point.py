"""`boresight point`: sensor reports in, pointing commands out; live, or from a recording."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from boresight.cli.output import print_json
from boresight.errors import UserError

if TYPE_CHECKING:
    from boresight.pointing.pointer import Pointing

NUMBERS = (
    "t_s", "t_aim_s", "az_deg", "el_deg", "face_az_deg", "face_el_deg", "az_rate_deg_s", "el_rate_deg_s", "sigma_deg",
    "p_in_beam",
)  # fmt: skip


def point(
    site: Path,
    /,
    *,
    replay: Path | None = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    force: bool = False,
    duration_s: float | None = None,
    quiet: bool = False,
    json: bool = False,
) -> None:
    """Point an antenna, gimbal or beam at what the sources report.

    Parameters
    ----------
    site
        SITE.toml: site, beam, face, mount, sources, input and output (docs/pointing.md names every key).
    replay
        A recording instead of live input; needs -o.
    output
        Folder for pointing.parquet.
    force
        Replace the output folder.
    duration_s
        Live: stop after this time.
    quiet
        Live: no status line.
    json
        Print one JSON object at the end.
    """
    from boresight.config.site import pointer_for, read_site

    station = read_site(site)
    if replay is None:
        from boresight.service.live import run_live

        if output is not None:
            raise UserError("-o goes with --replay; live commands go where [output] says")
        counts = run_live(station, pointer_for(station), duration_s, None if quiet else sys.stderr)
        if json:
            print_json("point", {"site": str(site), "duration_s": duration_s}, [counts])
        return
    if output is None:
        raise UserError("--replay needs -o FOLDER for pointing.parquet")
    from boresight.io.files import check_output, output_folder
    from boresight.io.recording import read_recording
    from boresight.io.table import write_table
    from boresight.report.pointing import pointing_picture
    from boresight.service.replay import replay as run

    check_output(output, force)
    recording = read_recording(replay)
    chain = pointer_for(station, recording)
    pointings = [p for p, _ in run(station, site.parent, chain, recording)]
    if not pointings:
        raise UserError(f"{replay}: no report with a range or a position: nothing to point at")
    with output_folder(output, force) as folder:
        write_table(folder / "pointing.parquet", columns(pointings))
        rows = [row(p) for p in pointings]
        pointing_picture(folder / "pointing.png", {name: [r[name] for r in rows] for name in (*NUMBERS, "mode")})
        _summary(folder, site, replay, pointings)
    if json:
        last = pointings[-1]
        told = [{"rows": len(pointings), "from_s": pointings[0].t, "to_s": last.t, "p_in_beam": last.aim.p_in_beam}]
        print_json("point", {"site": str(site), "replay": str(replay)}, told)
    else:
        print(f"wrote {output}/pointing.parquet: {len(pointings)} rows")


def columns(pointings: list[Pointing]) -> dict[str, Any]:
    """Return the columns of pointing.parquet."""
    import pyarrow as pa

    table: dict[str, Any] = {name: pa.array([row(p)[name] for p in pointings], pa.float64()) for name in NUMBERS}
    table["mode"] = pa.array([str(p.mode) for p in pointings], pa.string())
    return table


def row(p: Pointing) -> dict[str, Any]:
    """Return one command with units in its keys."""
    a = p.aim
    angles = (a.azimuth, a.elevation, a.face_azimuth, a.face_elevation, a.azimuth_rate, a.elevation_rate, a.sigma)
    values = (p.t, p.t_aim, *(math.degrees(v) for v in angles), a.p_in_beam)
    return {**dict(zip(NUMBERS, values, strict=True)), "mode": str(p.mode)}


def _summary(folder: Path, site: Path, replay: Path, pointings: list[Pointing]) -> None:
    import json

    from boresight._version import __version__

    modes = [str(p.mode) for p in pointings]
    about = {
        "command": "point", "version": __version__, "site": str(site), "replay": str(replay), "rows": len(pointings),
        "modes": {m: modes.count(m) for m in sorted(set(modes))},
    }  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
