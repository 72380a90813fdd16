"""`boresight send`: a recording as live JSON lines."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import msgspec
from cyclopts import Parameter

from boresight.errors import UserError
from boresight.io.detections import columns_of
from boresight.io.paths import platform_columns
from boresight.io.recording import read_recording
from boresight.io.scans import iter_scans
from boresight.types import Recording

DATAGRAM = 60_000  # bytes at most
NOT_SENT = ("t_recv_s", "sensor", "scan")


def send(
    rec: Path,
    to: str,
    /,
    *,
    speed: Annotated[float, Parameter(name="--speed")] = 1.0,
    now: bool = False,
) -> None:
    """Send a recording over UDP or TCP as the JSON lines that `boresight serve` takes, in order of arrival.

    Parameters
    ----------
    rec
        Folder of the recording.
    to
        udp://host:port or tcp://host:port.
    speed
        How many times faster than it was recorded.
    now
        Move all times, so that the first arrival is now (with --speed 1); else lines carry the recorded times, for
        an [input] with arrival = "recorded".
    """
    from boresight.service.sockets import address

    if not 0.0 < speed < math.inf:
        raise UserError(f"--speed: {speed}; give a number above zero")
    if now and speed != 1.0:
        raise UserError("--now goes with --speed 1: the receiver's clock runs at that")
    scheme, _, _ = to.partition("://")
    if scheme not in ("udp", "tcp"):
        raise UserError(f"'{to}': give udp://host:port or tcp://host:port")
    where = address(to, "to")
    recording = read_recording(rec)
    kind = socket.SOCK_DGRAM if scheme == "udp" else socket.SOCK_STREAM
    sent = size = 0
    try:
        with socket.socket(socket.AF_INET, kind) as out:
            if scheme == "tcp":
                out.connect(where)
            begun, first = time.monotonic(), math.nan
            shift = 0.0
            for t_recv, row in lines_of(recording):
                if math.isnan(first):
                    first = t_recv
                    shift = time.time() - first if now else 0.0
                wait = (t_recv - first) / speed - (time.monotonic() - begun)
                if wait > 0.0:
                    time.sleep(wait)
                line = msgspec.json.encode(moved(row, shift) if now else row) + b"\n"
                if len(line) > DATAGRAM and scheme == "udp":
                    raise UserError(f"a look of {len(line)} bytes does not fit into a datagram; send it over tcp")
                if scheme == "tcp":
                    out.sendall(line)
                else:
                    out.sendto(line, where)  # a receiver that is not there is its own affair
                sent, size = sent + 1, size + len(line)
    except OSError as error:
        raise UserError(f"{to}: {error.strerror or error} (after {sent} lines)") from None
    print(f"sent {sent} lines, {size} bytes")


def lines_of(recording: Recording) -> Iterator[tuple[float, dict[str, Any]]]:
    """Yield every look and every stamp of navigation as a line with its time of arrival (s), in order of arrival."""
    import heapq

    return heapq.merge(_navigation(recording), _looks(recording), key=lambda pair: pair[0])


def _looks(recording: Recording) -> Iterator[tuple[float, dict[str, Any]]]:
    d = recording.detections
    table = {name: _plain(values) for name, values in columns_of(d, recording.sensors).items()}
    names = [name for name in table if name not in (*NOT_SENT, "attributes")]
    for scan in iter_scans(recording):
        rows = scan.empty_rows if not len(scan.t) else scan.row.tolist()
        found = [{n: table[n][row] for n in names if table[n][row] is not None} for row in rows]
        line: dict[str, Any] = {
            "sensor": recording.sensors[scan.sensor].id,
            "t_s": scan.t_look,
            "t_recv_s": scan.t_recv,
        }
        yield scan.t_recv, {**line, "scan": int(d.scan[rows[0]]), "detections": found if len(scan.t) else []}


def _navigation(recording: Recording) -> Iterator[tuple[float, dict[str, Any]]]:
    if not recording.platforms:
        return
    table = {name: _plain(values) for name, values in platform_columns(recording.platforms).items()}
    arrived = table.get("t_recv_s", table["t_s"])
    names = [name for name in table if name != "t_recv_s"]
    for row in sorted(range(len(arrived)), key=lambda i: arrived[i]):
        line = {n: table[n][row] for n in names if table[n][row] is not None}
        yield arrived[row], {**line, "t_recv_s": arrived[row]}


def moved(line: dict[str, Any], shift: float) -> dict[str, Any]:
    """Return a line with all its times moved by `shift` (s), and without an arrival of its own."""
    out = {k: v for k, v in line.items() if k != "t_recv_s"}
    out["t_s"] += shift
    if "detections" in out:
        out["detections"] = [{**d, "t_s": d["t_s"] + shift} if "t_s" in d else d for d in out["detections"]]
    return out


def _plain(values: Any) -> list[Any]:
    return list(values.to_pylist()) if hasattr(values, "to_pylist") else list(map(_number, values))


def _number(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value
