"""The table in docs/speed.md, from the rows of one run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

PAGE = Path(__file__).parents[1] / "docs" / "speed.md"
BEGIN, END = "<!-- table: written by make bench -->", "<!-- end of table -->"


def markdown(result: dict[str, Any]) -> str:
    """Return the rows as a table, and under it what they were measured on."""
    lines = ["| work | contender | | | ratio |", "|---|---|---:|---|---:|"]
    before = None
    for r in result["rows"]:
        work = r["work"] if r["work"] != before else ""
        before = r["work"]
        ratio = f"{r['ratio']:,.0f}×" if r["ratio"] >= 10 else f"{r['ratio']:.2g}×"
        lines.append(f"| {work} | {r['contender']} | {r['value']:.3g} | {r['unit']} | {ratio} |")
    about = ", ".join(f"{k} {v}" for k, v in result["parameters"].items() if k != "machine")
    return "\n".join([*lines, "", f"Measured on: {result['parameters']['machine']}; {about}."])


def write(result: dict[str, Any]) -> None:
    """Put the table between its marks in the page."""
    text = PAGE.read_text(encoding="utf-8")
    head, rest = text.split(BEGIN, 1)
    PAGE.write_text(f"{head}{BEGIN}\n\n{markdown(result)}\n\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")
