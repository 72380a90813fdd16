"""`boresight paper`: the tables of the papers, as printed, corrected, and ours."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from cyclopts import App

from boresight.errors import UserError

app = App(name="paper", help="Print a paper's table: as printed, corrected, and ours.", help_format="plaintext")

# One line a paper: module:function, and the sentence that `boresight paper --help` shows.
PAPERS: dict[str, tuple[str, str]] = {
    "shao2012": ("boresight.cli.paper_shao2012:shao2012", "Radar and infrared in modified spherical coordinates."),
    "async_ekf": ("boresight.cli.paper_async_ekf:async_ekf", "Radar and infrared at different times."),
    "mao2015": ("boresight.cli.paper_mao2015:mao2015", "Radar angles and a window of infrared samples around them."),
    "wang2009": ("boresight.cli.paper_wang2009:wang2009", "Pixels of a moving camera, steadied: the paper's 8 frames."),
    "phased_array": ("boresight.cli.paper_phased_array:phased_array", "Several guide sources steer one beam."),
}

for _name, (_target, _help) in PAPERS.items():
    app.command(_target, name=_name, help=_help)


def say(what: str) -> None:
    """Say on standard error what is being done, where that is a terminal."""
    if sys.stderr.isatty():
        print(f"boresight: {what} …", file=sys.stderr, flush=True)


def check_runs(runs: int, seed: int) -> None:
    """Raise UserError unless there is a run to make and the seed is one."""
    if runs < 1:
        raise UserError(f"--runs must be at least 1, not {runs}")
    if seed < 0:
        raise UserError(f"--seed must be 0 or more, not {seed}")


LOADING = "loading kernels (the first run compiles them, about half a minute)"


def write_image(path: Path, draw: Callable[[Path], None]) -> None:
    """Draw to a temporary name, then rename; raises UserError for an unknown suffix or a folder that is not there."""
    kinds = (".svg", ".png", ".pdf")
    if path.suffix not in kinds:
        raise UserError(f"--plot {path}: the file must end in {', '.join(kinds)}")
    if not path.absolute().parent.is_dir():
        raise UserError(f"--plot {path}: there is no folder {path.parent}")
    part = path.with_name(f".part{path.suffix}")
    try:
        draw(part)
        part.replace(path)
    except OSError as error:
        raise UserError(f"--plot {path}: cannot be written ({(error.strerror or str(error)).lower()})") from None
