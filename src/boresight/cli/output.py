"""How every command speaks: one JSON object, or tables that fit 80 columns, colourless when piped."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from boresight._version import __version__
from boresight.io.results import finite


def print_json(
    command: str, parameters: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], notes: Sequence[str] | None = None
) -> None:
    """Print the one object that `--json` promises on standard output; `notes` tells what rows cannot."""
    data = {"command": command, "version": __version__, "parameters": parameters, "rows": rows}
    data |= {} if notes is None else {"notes": notes}
    print(json.dumps(finite(data), indent=1, ensure_ascii=False, allow_nan=False))


def print_notes(notes: Iterable[str]) -> None:
    """Print on standard error what the user is to know of the input, a line each."""
    for note in notes:
        print(f"boresight: {plain(' '.join(note.split()))}", file=sys.stderr)


def print_table(
    columns: Mapping[str, str], rows: Sequence[Mapping[str, Any]], title: str = "", digits: int = 4
) -> None:
    """Print rows as a table: `columns` maps keys to headings; numbers are right-aligned, None is a dash.

    A heading may hold a newline. Colour and width follow the terminal; piped it is plain text of 80 columns.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, title=title or None, title_justify="left", padding=(0, 1, 0, 0), pad_edge=False)
    for key, heading in columns.items():
        number = any(isinstance(row.get(key), int | float | np.number) for row in rows)
        table.add_column(heading, justify="right" if number else "left", overflow="fold")
    for row in rows:
        table.add_row(*(Text(cell(row.get(key), digits)) for key in columns))  # a name in brackets is no markup
    console = Console(file=sys.stdout, highlight=False)
    console.print(table)


def cell(value: Any, digits: int = 4) -> str:
    """Return one cell: at most `digits` significant digits, a dash for what is not there."""
    value = finite(value)
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        text = f"{value:.{digits}g}"
        return f"{value:.0f}" if "e" in text and 1e-3 < abs(value) < 1e15 else text
    return plain(str(value))


def plain(text: str) -> str:
    """Return a text whose control characters are shown, not obeyed, by a terminal."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
