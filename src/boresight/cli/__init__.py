"""The command line: `boresight COMMAND …`. Each command lives in a module of its own and is loaded when called."""

from __future__ import annotations

import errno
import os
import sys

from cyclopts import App, CycloptsError, Parameter

from boresight._version import __version__
from boresight.errors import UserError

app = App(
    name="boresight",
    help="From radar, infrared and optical reports to tracks and pointing commands.",
    version=__version__,
    help_format="plaintext",
    default_parameter=Parameter(negative=""),
)

# One line a command: module:function, and the sentence that `boresight --help` shows.
COMMANDS: dict[str, tuple[str, str]] = {
    "demo": ("boresight.cli.demo:demo", "Simulate, track, score and report an example: see it work."),
    "import": ("boresight.cli.import_:app", "Turn other formats into a recording."),
    "simulate": ("boresight.cli.simulate:simulate", "Turn a scenario into a recording with truth."),
    "track": ("boresight.cli.track:track", "Track the targets of a recording."),
    "register": (
        "boresight.cli.register:register",
        "Find sensors' time offsets and biases from targets of opportunity.",
    ),
    "tune": ("boresight.cli.tune:tune", "Find process and measurement noise from a recording's innovations."),
    "score": ("boresight.cli.score:score_command", "Score tracks against the truth of their recording."),
    "compare": ("boresight.cli.compare:compare", "Run several configurations on one recording, side by side."),
    "study": ("boresight.cli.study:study", "Run a scenario many times over a grid of parameters, on all cores."),
    "report": ("boresight.cli.report:report", "Write a page that shows what the tracker did."),
    "play": ("boresight.cli.play:play", "Replay tracks in the terminal, or as GIF, MP4 or PNG."),
    "info": ("boresight.cli.info:info", "Say what is in a recording."),
    "export": ("boresight.cli.export:export", "Write tracks as CSV, GeoJSON or KML."),
    "convert": ("boresight.cli.convert:convert", "Turn pixels, az/el, ENU, NED, ECEF and geodetic into each other."),
    "serve": ("boresight.cli.serve:serve", "Track live reports, log them, send the tracks on; follow one."),
    "send": ("boresight.cli.send:send", "Send a recording as live JSON lines, at its own speed or faster."),
    "point": ("boresight.cli.point:point", "Point an antenna or beam at what the sources report."),
    "passes": ("boresight.cli.passes:passes", "List satellite passes, and whether the mount can follow."),
    "paper": ("boresight.cli.paper:app", "Print a paper's table: as printed, corrected, and ours."),
}

for _name, (_target, _help) in COMMANDS.items():
    app.command(_target, name=_name, help=_help)


def main() -> None:
    """Run the command line; exit 0 done, 2 bad usage or input (one line on standard error), 1 our fault."""
    try:
        app(sys.argv[1:], exit_on_error=False, print_error=False)
        sys.stdout.flush()
    except UserError as error:
        _usage(str(error))
    except CycloptsError as error:
        _usage(str(error))
    except BrokenPipeError:  # the reader of our output has gone (`| head`)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except OSError as error:  # files are written by io.files, which says which; what is left is standard output
        if error.filename is not None:
            _usage(f"{error.filename}: {(error.strerror or str(error)).lower()}")
        if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO):
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _usage(f"standard output cannot be written ({(error.strerror or str(error)).lower()})")
    except KeyboardInterrupt:
        sys.exit(130)


def _usage(message: str) -> None:
    print(f"boresight: {' '.join(message.split())}", file=sys.stderr)
    sys.exit(2)
