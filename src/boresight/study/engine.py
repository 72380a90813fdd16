"""Where a study's runs are worked on: `local`, processes of this machine, or `ray`, a cluster. Both give the same rows.

A worker that dies takes one run with it; that run is given to another worker, twice, and what happened is told.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from typing import Any

from boresight.errors import UserError, did_you_mean

ENGINES = ("local", "ray")
ATTEMPTS = 3
Work = Callable[[Any], dict[str, Any]]
Tell = Callable[[str], None]


def run_all(
    engine: str, work: Work, tasks: Sequence[Any], workers: int, tell: Tell
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield (index of the task, its row) as runs end; `work` must be importable by a worker.

    Raises UserError for an unknown engine, for `ray` where it is not installed, and where a task's worker died three
    times or its work failed.
    """
    if engine not in ENGINES:
        raise UserError(f"unknown engine '{engine}'{did_you_mean(engine, ENGINES)}; give local or ray")
    yield from (_ray if engine == "ray" else _local)(work, tasks, workers, tell)


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _serve(work: Work, pipe: Connection) -> None:
    """A worker: take tasks until the pipe closes (the parent may have been killed)."""
    while True:
        try:
            i, task = pipe.recv()
            try:
                pipe.send((i, work(task), None))
            except Exception as error:
                pipe.send((i, None, f"{type(error).__name__}: {error}"))
        except (EOFError, OSError):
            return


@contextmanager
def _deaf() -> Iterator[None]:
    """Ignore Ctrl-C, and let processes begun here ignore it for good: this process hears it and ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _local(work: Work, tasks: Sequence[Any], workers: int, tell: Tell) -> Iterator[tuple[int, dict[str, Any]]]:
    context = multiprocessing.get_context("spawn")
    waiting, tries = deque(range(len(tasks))), [0] * len(tasks)
    crew: dict[Connection, tuple[Any, int]] = {}  # pipe -> its process and the task it has

    def hire() -> None:
        ours, theirs = context.Pipe()
        process = context.Process(target=_serve, args=(work, theirs), daemon=True)
        with _deaf():
            process.start()
        theirs.close()
        give(ours, process)

    def give(pipe: Connection, process: Any) -> None:
        i = waiting.popleft()
        tries[i] += 1
        pipe.send((i, tasks[i]))
        crew[pipe] = process, i

    try:
        for _ in range(min(workers, len(tasks))):
            hire()
        while crew:
            for pipe in wait(list(crew)):
                assert isinstance(pipe, Connection)
                process, i = crew.pop(pipe)
                try:
                    i, row, failure = pipe.recv()
                except (EOFError, OSError):
                    process.join()
                    pipe.close()
                    _again(i, tries[i], f"died with exit code {process.exitcode}", tell)
                    waiting.appendleft(i)
                    hire()
                    continue
                if failure is not None:
                    raise UserError(f"run {i + 1} of {len(tasks)} failed: {failure}")
                if waiting:
                    give(pipe, process)
                else:
                    pipe.close()
                    process.join()
                yield i, row
    finally:
        for pipe, (process, _) in crew.items():
            process.terminate()
            process.join()
            pipe.close()


def _again(i: int, tries: int, what: str, tell: Tell) -> None:
    tell(f"a worker {what} in run {i + 1}; attempt {tries} of {ATTEMPTS}")
    if tries >= ATTEMPTS:
        raise UserError(f"run {i + 1}: its worker died {ATTEMPTS} times; the other runs are kept, start again to go on")


def _ray(work: Work, tasks: Sequence[Any], workers: int, tell: Tell) -> Iterator[tuple[int, dict[str, Any]]]:
    try:
        import ray
        from ray.exceptions import RayTaskError, WorkerCrashedError
    except ImportError:
        raise UserError("engine ray: Ray is not installed; install the extra ray, or give --engine local") from None
    mine = not ray.is_initialized()
    if mine:
        ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False, logging_level=logging.ERROR)
    remote = ray.remote(max_retries=0)(work)
    tries = [0] * len(tasks)
    waiting = deque(range(len(tasks)))
    flying: dict[Any, int] = {}
    try:
        while waiting or flying:
            while waiting and len(flying) < 2 * workers:
                i = waiting.popleft()
                tries[i] += 1
                flying[remote.remote(tasks[i])] = i
            done, _ = ray.wait(list(flying), num_returns=1)
            i = flying.pop(done[0])
            try:
                row = ray.get(done[0])
            except WorkerCrashedError:
                _again(i, tries[i], "died", tell)
                waiting.appendleft(i)
                continue
            except RayTaskError as error:
                raise UserError(f"run {i + 1} of {len(tasks)} failed: {error.cause}") from None
            yield i, row
    finally:
        if mine:
            ray.shutdown()
