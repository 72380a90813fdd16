"""Files that are whole or not there: atomic output, and input errors that name the file."""

from __future__ import annotations

import contextlib
import fcntl
import glob
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

from boresight.errors import UserError

RECORDING, RESULTS = "recording.toml", "summary.json"  # what tells that a folder is one of ours, to be replaced
TABLES = ("detections.parquet", "platform.parquet", "truth.parquet", "ignore.parquet")
MADE = {  # what lies beside a marker that commands wrote; whoever finds anything else there leaves the folder alone
    RECORDING: (*TABLES, "mapping.toml", "registration.json"),
    RESULTS: (
        "tracks.parquet", "smoothed.parquet", "registration.parquet", "decisions.parquet", "report.html",
        "pointing.parquet", "pointing.png",
    ),
    "compare.json": ("compare.png",),
}  # fmt: skip
PART = ".boresight-"  # in the hidden names of what is being written


def reason(error: OSError) -> str:
    """Return the operating system's words for an error, without its number."""
    return (error.strerror or str(error)).lower()


def read_bytes(path: Path) -> bytes:
    """Read a whole file; raises UserError when it is missing, empty or cannot be read."""
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({reason(error)})") from None
    if not data:
        raise UserError(f"{path}: the file is empty")
    return data


def read_text(path: Path) -> str:
    """Read a whole UTF-8 file; raises UserError when it is missing, empty or binary."""
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not a text file (byte {error.start} is not UTF-8)") from None
    if "\0" in text:
        raise UserError(f"{path}: not a text file (it holds zero bytes)")
    if not text.strip():
        raise UserError(f"{path}: the file is empty")
    return text


def holds_others(names: Iterable[str]) -> str:
    """Return in words that a folder holds what no command wrote, and what to do."""
    return f"holds {next(iter(names))}, which this command did not write; move it, or choose another output folder"


def check_output(
    path: Path,
    force: bool,
    marker: str = RESULTS,
    inputs: Iterable[Path | None] = (),
    beside: Iterable[str] = (),
) -> None:
    """Raise UserError when `path` may not become an output folder.

    It may not when it exists without `force`, holds anything but what commands write (a folder with `marker` is ours,
    and in it the files of `MADE` and those named `beside`), or when one of the `inputs` lies in it, which replacing it
    would destroy. What a killed run left of the same output is put right first.
    """
    _put_right(path)
    here = path.resolve()
    for given in inputs:
        if given is not None and (given.resolve() == here or here in given.resolve().parents):
            raise UserError(f"{path}: the output would replace its own input {given}; choose another output folder")
    if path.is_dir():
        if not force:
            raise UserError(f"{path}: the output folder exists; give --force to replace it")
        inside = {p.name for p in path.iterdir()}
        ours = {marker, *MADE[marker], *beside}
        others = sorted(name for name in inside - ours if not _is_part(name, ours))
        if others or (inside and marker not in inside):
            raise UserError(f"{path}: {holds_others(others or sorted(inside))}")
    elif path.exists() or path.is_symlink():
        raise UserError(f"{path}: exists and is not a folder; choose another output folder")
    try:
        path.absolute().parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{path}: the output folder cannot be made ({reason(error)})") from None


@contextlib.contextmanager
def output_folder(
    path: Path | str, force: bool = False, marker: str = RESULTS, beside: Iterable[str] = ()
) -> Iterator[Path]:
    """Give a temporary folder beside `path` that takes its name when the block ends well, and vanishes when not.

    Raises UserError when `path` exists and `force` is not given, or cannot be written.
    """
    path = Path(path)
    check_output(path, force, marker, beside=beside)
    parent = path.absolute().parent
    try:
        work = Path(tempfile.mkdtemp(prefix=f".{path.absolute().name}{PART}", dir=parent))
        lock = os.open(work, os.O_RDONLY)  # held until the end, whatever that is: who can take it finds us dead
        fcntl.flock(lock, fcntl.LOCK_EX)
    except OSError as error:
        raise UserError(f"{path}: the output folder cannot be written ({reason(error)})") from None
    try:
        new = work / "new"
        new.mkdir()
        yield new
        if path.exists():
            path.rename(work / "old")
        new.rename(path)
    except OSError as error:
        if (work / "old").exists() and not path.exists():
            (work / "old").rename(path)
        raise UserError(f"{path}: writing failed ({reason(error)})") from None
    finally:
        shutil.rmtree(work, ignore_errors=True)
        os.close(lock)


def _put_right(path: Path) -> None:
    """Remove what killed runs left of an output; the one they were about to replace takes its name again."""
    here = path.absolute()
    with contextlib.suppress(OSError):  # another folder, another disk: the command will say what it cannot do
        for left in sorted(here.parent.glob(f".{glob.escape(here.name)}{PART}*")):
            lock = os.open(left, os.O_RDONLY | os.O_NOFOLLOW)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                if (left / "old").is_dir() and not here.exists():
                    (left / "old").rename(here)
                if left.is_dir():
                    shutil.rmtree(left, ignore_errors=True)
                else:
                    left.unlink(missing_ok=True)
            except BlockingIOError:  # it is being written now
                pass
            finally:
                os.close(lock)


def _is_part(name: str, ours: Iterable[str]) -> bool:
    """Whether a hidden name is that of one of our files while it was written."""
    return any(name.startswith(f".{one}{PART}") for one in ours)


def write_text(path: Path | str, text: str, force: bool = False) -> None:
    """Write one UTF-8 file at once; raises UserError when it exists and `force` is not given, or cannot be written."""
    path = Path(path)
    _put_right(path)
    if path.exists() and not force:
        raise UserError(f"{path}: the file exists; give --force to replace it")
    try:
        path.absolute().parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}{PART}", dir=path.absolute().parent)
        fcntl.flock(handle, fcntl.LOCK_EX)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({reason(error)})") from None
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="") as file:
            file.write(text)
        Path(name).chmod(0o666 & ~_umask())
        Path(name).replace(path)
    except OSError as error:
        raise UserError(f"{path}: writing failed ({reason(error)})") from None
    finally:
        Path(name).unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
