"""Docs that cannot rot: examples run, links resolve, and nothing names a package registry or a machine's paths."""

from __future__ import annotations

import doctest
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_examples_in_docs_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    failures, _ = doctest.testfile(str(page), module_relative=False, optionflags=flags)
    assert failures == 0


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_in_docs_resolve(page: Path) -> None:
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.S)
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text):
        if not target.startswith(("http://", "https://", "mailto:")):
            assert (page.parent / target).exists(), f"{page.relative_to(ROOT)}: broken link to {target}"


def test_every_page_is_reachable_from_the_readme() -> None:
    linked, todo = set(), [ROOT / "README.md"]
    while todo:
        page = todo.pop().resolve()
        if page in linked or not page.exists():
            continue
        linked.add(page)
        for target in re.findall(r"\]\(([^)#\s]+\.md)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            todo.append(page.parent / target)
    assert {p.resolve() for p in PAGES} <= linked


def test_no_registry_host_and_no_path_of_a_machine() -> None:
    files = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split("\n")
    host = re.compile(
        r"py" + r"pi\.org|python" + r"hosted|registry\.np" + r"mjs|/ro" + r"ot/|/ho" + r"me/|/wo" + r"rk/"
    )
    for name in filter(None, files):
        if Path(name).suffix in {".py", ".md", ".toml", ".txt", ".html", ".yml", ""} and (ROOT / name).is_file():
            found = host.search((ROOT / name).read_text(encoding="utf-8", errors="replace"))
            assert not found, f"{name}: names '{found and found.group()}'"
