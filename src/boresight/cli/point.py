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
    from boresight.config.site import Station
    from boresight.pointing.mount import MountState
    from boresight.pointing.pointer import Pointing

NUMBERS = (
    "t_s", "t_aim_s", "az_deg", "el_deg", "face_az_deg", "face_el_deg", "az_rate_deg_s", "el_rate_deg_s", "sigma_deg",
    "p_in_beam", "mount_az_deg", "mount_el_deg",
)  # fmt: skip


def point(
    site: Path,
    /,
    *,
    replay: Path | None = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    log: Path | None = None,
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
        A recording, or the log of a live run, instead of live input; needs -o.
    output
        Folder for pointing.parquet.
    log
        Live: folder for the log of everything that arrives; --replay takes it again.
    force
        Replace the output folder, or the log.
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
        if output is not None:
            raise UserError("-o goes with --replay; live commands go where [output] says")
        counts = _live(site, station, log, force, duration_s, quiet)
        if json:
            print_json("point", {"site": str(site), "duration_s": duration_s}, [counts])
        return
    if log is not None:
        raise UserError("--log goes with live input; --replay LOG -o FOLDER takes one again")
    if output is None:
        raise UserError("--replay needs -o FOLDER for pointing.parquet")
    from boresight.io.files import check_output, output_folder
    from boresight.io.livelog import LogReader, is_log, is_point_log
    from boresight.io.recording import read_recording
    from boresight.io.table import write_table
    from boresight.report.pointing import pointing_picture
    from boresight.service.live import replay_log
    from boresight.service.replay import replay as run

    check_output(output, force)
    if is_log(replay) and is_point_log(replay):
        reader = LogReader(replay)
        rows = [row(p) for p, _ in replay_log(station, pointer_for(station), reader)]
        for words in reader.damage:
            print(f"boresight: {replay}: {words}", file=sys.stderr)
    else:
        recording = read_recording(replay)
        rows = [row(p, m) for p, _, m in run(station, site.parent, pointer_for(station, recording), recording)]
    if not rows:
        raise UserError(f"{replay}: no report with a range or a position: nothing to point at")
    with output_folder(output, force) as folder:
        write_table(folder / "pointing.parquet", columns(rows))
        pointing_picture(folder / "pointing.png", {name: [r[name] for r in rows] for name in (*NUMBERS, "mode")})
        _summary(folder, site, replay, rows)
    if json:
        told = [{"rows": len(rows), "from_s": rows[0]["t_s"], "to_s": rows[-1]["t_s"]}]
        told[0]["p_in_beam"] = rows[-1]["p_in_beam"]
        print_json("point", {"site": str(site), "replay": str(replay)}, told)
    else:
        print(f"wrote {output}/pointing.parquet: {len(rows)} rows")


def _live(
    site: Path, station: Station, log: Path | None, force: bool, duration_s: float | None, quiet: bool
) -> dict[str, Any]:
    from boresight.config.site import pointer_for
    from boresight.io.files import read_text
    from boresight.io.livelog import LogTable
    from boresight.service.live import run_live
    from boresight.service.signals import until_signalled
    from boresight.service.writing import new_log, said_ready

    pointer = pointer_for(station)
    writer = None if log is None else new_log(log, read_text(site), "", force, LogTable())
    with until_signalled() as stop:
        status = None if quiet else sys.stderr
        return run_live(station, pointer, duration_s, status, stop=stop, log=writer, ready=said_ready)


def columns(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the columns of pointing.parquet."""
    import pyarrow as pa

    table: dict[str, Any] = {name: pa.array([r[name] for r in rows], pa.float64()) for name in NUMBERS}
    table["mode"] = pa.array([r["mode"] for r in rows], pa.string())
    return table


def row(p: Pointing, mount: MountState | None = None) -> dict[str, Any]:
    """Return one command with units in its keys; `mount` is where the mount is sent (else what the beam asks for)."""
    a = p.aim
    angles = (a.azimuth, a.elevation, a.face_azimuth, a.face_elevation, a.azimuth_rate, a.elevation_rate, a.sigma)
    sent = (p.mount_azimuth, p.mount_elevation) if mount is None else (mount.azimuth, mount.elevation)
    values = (p.t, p.t_aim, *(math.degrees(v) for v in angles), a.p_in_beam, *(math.degrees(v) for v in sent))
    return {**dict(zip(NUMBERS, values, strict=True)), "mode": str(p.mode)}


def _summary(folder: Path, site: Path, replay: Path, rows: list[dict[str, Any]]) -> None:
    import json

    from boresight._version import __version__

    modes = [r["mode"] for r in rows]
    about = {
        "command": "point", "version": __version__, "site": str(site), "replay": str(replay), "rows": len(rows),
        "modes": {m: modes.count(m) for m in sorted(set(modes))},
    }  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")
