"""The command line: `boresight COMMAND …`. Each command lives in a module of its own and is loaded when called."""

from __future__ import annotations

import sys

from cyclopts import App

from boresight._version import __version__
from boresight.errors import UserError

app = App(
    name="boresight",
    help="From radar, infrared and optical reports to tracks and pointing commands.",
    version=__version__,
    help_format="plaintext",
)

# One line a command: module:function, and the sentence that `boresight --help` shows.
COMMANDS: dict[str, tuple[str, str]] = {}

for _name, (_target, _help) in COMMANDS.items():
    app.command(_target, name=_name, help=_help)


def main() -> None:
    """Run the command line; exit 0 done, 2 bad usage or input (one line on standard error), 1 our fault."""
    try:
        app()
    except UserError as error:
        print(f"boresight: {error}", file=sys.stderr)
        sys.exit(2)
