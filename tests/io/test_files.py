"""What may be replaced, and what a killed run leaves."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from boresight.errors import UserError
from boresight.io.files import RESULTS, check_output, output_folder, write_text

WRITES = """
import sys, time
from pathlib import Path
from boresight.io.files import output_folder
with output_folder(Path(sys.argv[1]), force=True) as folder:
    (folder / "summary.json").write_text("new")
    if sys.argv[2] == "between":
        Path(sys.argv[1]).rename(folder.parent / "old")
    print("there", flush=True)
    time.sleep(60)
"""


def _killed(path: Path, when: str) -> None:
    with subprocess.Popen([sys.executable, "-c", WRITES, path, when], stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == b"there\n"
        child.send_signal(signal.SIGKILL)


def test_only_a_folder_of_ours_is_replaced(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / RESULTS).write_text("{}", encoding="utf-8")
    (out / "tracks.parquet").write_bytes(b"")
    check_output(out, True)
    (out / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(UserError, match=r"holds notes\.txt"):
        check_output(out, True)
    (out / "notes.txt").unlink()
    (out / "more").mkdir()
    with pytest.raises(UserError, match="holds more"), output_folder(out, True):
        pass
    assert (out / "more").is_dir()


@pytest.mark.parametrize("when", ["writing", "between"])
def test_a_killed_run_leaves_nothing_and_loses_nothing(tmp_path: Path, when: str) -> None:
    out = tmp_path / "o[u]t"
    with output_folder(out) as folder:
        (folder / RESULTS).write_text("old", encoding="utf-8")
    _killed(out, when)
    assert len(list(tmp_path.iterdir())) >= 1
    with pytest.raises(UserError, match="give --force"):
        check_output(out, False)
    assert [p.name for p in tmp_path.iterdir()] == [out.name]
    assert (out / RESULTS).read_text(encoding="utf-8") == "old"
    with output_folder(out, True) as folder:
        (folder / RESULTS).write_text("new", encoding="utf-8")
    assert (out / RESULTS).read_text(encoding="utf-8") == "new"
    assert [p.name for p in tmp_path.iterdir()] == [out.name]


def test_what_another_run_is_writing_stays(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with subprocess.Popen([sys.executable, "-c", WRITES, out, "writing"], stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        child.stdout.readline()
        check_output(out, True)
        assert len(list(tmp_path.iterdir())) == 1
        child.kill()


def test_a_file_left_half_written_is_removed(tmp_path: Path) -> None:
    (tmp_path / ".page.html.boresight-abc").write_text("half", encoding="utf-8")
    (tmp_path / ".page.html.mine").write_text("mine", encoding="utf-8")
    write_text(tmp_path / "page.html", "whole")
    assert sorted(os.listdir(tmp_path)) == [".page.html.mine", "page.html"]
