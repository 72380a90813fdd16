"""report.html: one file that works offline. The page and its script are package files; the data is JSON inside."""

from __future__ import annotations

import html
import json
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

from boresight.report.data import collect
from boresight.types import Recording, Results


def write_report(path: Path, results: Results, recording: Recording | None) -> None:
    """Write the report of results, with detections, truth and scores where the recording is given."""
    path.write_text(render(collect(results, recording)), encoding="utf-8")


def render(data: dict[str, Any]) -> str:
    """Return the page for collected data."""
    here = files("boresight.report")
    page, style, script = ((here / name).read_text(encoding="utf-8") for name in ("page.html", "page.css", "page.js"))
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    embedded = text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
    title = html.escape(f"{data['name']} – boresight report")
    parts = {"@@TITLE@@": title, "@@STYLE@@": style, "@@SCRIPT@@": script, "@@DATA@@": embedded}
    # one pass, so that no name that looks like a mark is taken for one
    return re.sub("|".join(parts), lambda found: parts[found[0]], page)
