"""Imports point only down; packages on one level never import each other (docs/architecture.md)."""

from __future__ import annotations

import ast
from pathlib import Path

import boresight

ROOT = Path(boresight.__file__).parent
LEVELS = [
    {"errors", "_version"},
    {"types"},
    {"kernels"},
    {"frames"},
    {"models"},
    {"filters", "association"},
    {"screen", "align", "fuse", "sim", "bounds", "metrics", "io"},
    {"tracking", "register", "pointing"},
    {"stages"},
    {"engine"},
    {"config"},
    {"door"},
    {"cli", "report", "papers", "service", "study"},
]
LEVEL = {name: i for i, names in enumerate(LEVELS) for name in names}
# The shells may call each other: a command writes a report, prints a paper's table.
SHELLS = len(LEVELS) - 1


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [a.name for a in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names = [node.module or ""]
            if node.module == "boresight":
                names = [f"boresight.{a.name}" for a in node.names]
        found |= {n.split(".")[1] for n in names if n.startswith("boresight.")}
    return found


def test_imports_point_down() -> None:
    wrong = []
    for path in ROOT.rglob("*.py"):
        part = path.relative_to(ROOT).parts[0].removesuffix(".py")
        if part in {"__init__", "__main__"}:
            continue
        assert part in LEVEL, f"{path.name}: '{part}' has no level"
        for other in imports(path) - {part, "__version__"}:
            assert other in LEVEL, f"{path}: imports boresight.{other}, which has no level"
            if LEVEL[other] > LEVEL[part] or (LEVEL[other] == LEVEL[part] != SHELLS):
                wrong.append(f"{path.relative_to(ROOT)} ({part}) imports {other}")
    assert not wrong, "\n".join(wrong)
