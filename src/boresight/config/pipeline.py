"""`[pipeline]`, `[screen]`, `[smooth]`, `[align]`, `[fuse]` of a tracker configuration: what may be chosen."""

from __future__ import annotations

from typing import Any

from boresight.errors import UserError, did_you_mean
from boresight.io.toml import TableModel, convert

FOLLOW = ("sensors", "gate", "memory_s", "max_speed_m_s", "max_rate_deg_s")
ALIGN = ("slow", "fast", "gate", "hold_s")
# stage -> kind -> the options that it has
OPTIONS: dict[str, dict[str, tuple[str, ...]]] = {
    "screen": {
        "none": (),
        "prediction": (*FOLLOW, "reopen"),
        "hampel": (*FOLLOW, "window"),
        "plausible": ("sensors", "memory_s", "reopen", "max_speed_m_s", "slack_m", "range_m", "elevation_deg"),
    },
    "smooth": {"none": (), "savitzky_golay": (*FOLLOW, "samples", "order")},
    "align": {
        "none": (),
        "interpolate": (*ALIGN, "max_rate_deg_s"),
        "compress": (*ALIGN, "max_rate_deg_s"),
        "compress_innovations": ALIGN,
        "window": (*ALIGN, "max_rate_deg_s", "order", "past", "future", "time_distance"),
    },
    "fuse": {
        "none": (),
        "inverse_variance": ("gate", "wait_s"),
        "dynamic": ("gate", "wait_s"),
        "covariance_intersection": ("gate", "wait_s"),
    },
}


class PipelineTable(TableModel, frozen=True):
    """`[pipeline]`: which kind of each stage."""

    screen: str = "none"
    smooth: str = "none"
    align: str = "none"
    fuse: str = "none"


class OptionsTable(TableModel, frozen=True):
    """`[screen]`, `[smooth]`, `[align]` or `[fuse]`: None takes the default."""

    sensors: tuple[str, ...] | None = None
    slow: str | None = None
    fast: tuple[str, ...] | None = None
    gate: float | None = None
    memory_s: float | None = None
    reopen: int | None = None
    window: int | None = None
    range_m: tuple[float, float] | None = None
    elevation_deg: tuple[float, float] | None = None
    max_speed_m_s: float | None = None
    max_rate_deg_s: float | None = None
    slack_m: float | None = None
    samples: int | None = None
    order: int | None = None
    past: int | None = None
    future: int | None = None
    time_distance: bool | None = None
    hold_s: float | None = None
    wait_s: float | None = None


def take_pipeline(raw: dict[str, Any], where: str) -> dict[str, Any]:
    """Take the pipeline's tables out of a configuration file's plain values, checked: what a summary shows.

    Raises UserError for a kind or an option that is not there.
    """
    kinds = convert(raw.pop("pipeline", {}), PipelineTable, f"{where}: pipeline")
    out: dict[str, Any] = {}
    for stage, known in OPTIONS.items():
        kind = getattr(kinds, stage)
        if kind not in known:
            near = did_you_mean(kind, known)
            raise UserError(f"{where}: pipeline.{stage} = '{kind}' is not known{near}; give one of {', '.join(known)}")
        given = raw.pop(stage, None)
        if given is not None and kind == "none":
            raise UserError(f'{where}: [{stage}] has options, but pipeline.{stage} is "none"; choose a kind there')
        if given is not None and isinstance(given, dict):
            for key in given:
                if key not in known[kind]:
                    near = did_you_mean(key, known[kind])
                    raise UserError(
                        f"{where}: unknown key '{key}' in {stage}{near}; \"{kind}\" has {', '.join(known[kind])}"
                    )
        if kind != "none":
            table = convert(given or {}, OptionsTable, f"{where}: {stage}")
            out[stage] = {"kind": kind, **{k: v for k in known[kind] if (v := getattr(table, k)) is not None}}
    if "fuse" in out and out.get("align", {"kind": "none"})["kind"] in ("none", "compress_innovations"):
        raise UserError(
            f'{where}: pipeline.fuse needs align = "interpolate", "compress" or "window": reports of one time'
        )
    return out
