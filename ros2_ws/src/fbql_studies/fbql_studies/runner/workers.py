"""Runs tasks in parallel: a process for each, or on a Dask cluster. A task whose worker dies is retried once."""

from __future__ import annotations

import ctypes
import logging
import os
import signal
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from time import monotonic
from traceback import format_exception_only
from typing import Any, NamedTuple
from uuid import uuid4

from fbql.cli.output import complain, say
from fbql.cli.words import counted
from fbql_common.checkout import how_to_install
from fbql_common.core.errors import BadInput
from fbql_common.files import DISK_FAILURES

from fbql_studies.runner.store import Store, write_failure, write_result
from fbql_studies.runner.study import Result, StudyTask

ATTEMPTS = 2
_POLL_S = 0.2
_CONNECT_S = 10
_WITHOUT_WORKERS_S = 2.0
"""Time after which a cluster without workers is reported."""
_LACKING = ("Error during deserialization", "No module named 'fbql")
"""What Dask says of a scheduler, and Python of a worker, that cannot import this project."""
_PR_SET_PDEATHSIG = 1
_DISK_FAILED = 64
"""Exit code of a worker that could not write its result, plus the index of the reason in DISK_FAILURES."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class TaskEnd(NamedTuple):
    """The end of a task: done, or failed for good."""

    key: str
    failure: str
    """Why it failed; empty when it is done."""
    seconds: float
    """How long it took."""
    workers: int
    """How many tasks are worked on at a time."""


def run_locally(
    module: str, tasks: Sequence[StudyTask], store: Store, jobs: int, stopped: Callable[[], bool]
) -> Iterator[TaskEnd]:
    """Runs each task in a fresh process, `jobs` at a time; yields each as it ends.

    The worker writes its result itself, so that no finished work is lost when the launcher dies. `stopped` is called
    a few times a second; when it returns True, the running workers are ended.

    Args:
        module: the study's module, which the workers can import.
    """
    for name in _THREADS:
        os.environ.setdefault(name, "1")  # the workers share the cores already
    _announce(tasks, f"{min(jobs, len(tasks))} at a time", store)
    context = get_context("spawn")
    pending = deque((task, 1) for task in tasks)
    running: dict[int, tuple[BaseProcess, StudyTask, int, float]] = {}
    try:
        while (pending or running) and not stopped():
            while pending and len(running) < jobs:
                task, attempt = pending.popleft()
                process = context.Process(target=_work, args=(module, task, str(store.directory), os.getpid()))
                process.start()
                running[process.sentinel] = (process, task, attempt, monotonic())
            for sentinel in wait(list(running), timeout=_POLL_S):
                process, task, attempt, begun_s = running.pop(sentinel)  # type: ignore[arg-type]  # sentinels are ints here
                process.join()
                seconds = monotonic() - begun_s
                _raise_disk_failure(process.exitcode, store)
                if process.exitcode == 0:
                    yield TaskEnd(task.key, "", seconds, jobs)
                elif attempt < ATTEMPTS:
                    pending.appendleft((task, attempt + 1))
                else:
                    if process.exitcode != 1:  # 1: it recorded the failure itself
                        write_failure(store.directory, task.key, f"the worker was ended by {_ender(process.exitcode)}")
                    yield TaskEnd(task.key, store.failure_of(task.key) or "the worker failed", seconds, jobs)
    finally:
        for process, *_ in running.values():
            process.terminate()
        for process, *_ in running.values():
            process.join()


def _announce(tasks: Sequence[StudyTask], how: str, store: Store) -> None:
    """Says what begins now: the first task may take an hour."""
    say(f"{counted(len(tasks), 'task')}, {how}; results go to {store.directory}, and Ctrl-C loses none that are done")


def _ender(exitcode: int | None) -> str:
    """The signal or exit code that ended a process."""
    with suppress(ValueError):
        return signal.Signals(-(exitcode or 0)).name
    return f"exit code {exitcode}"


def _work(module: str, task: StudyTask, directory: str, launcher: int) -> None:
    """One task in its own process. It ends with the launcher, which alone handles Ctrl-C."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != launcher:
        os._exit(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        try:
            result = import_module(module).run(task.parameters)
        except Exception as error:  # any error is reported, and the other tasks continue
            write_failure(directory, task.key, error_line(error))
            sys.exit(1)
        write_result(directory, task.key, result)
    except (OSError, ValueError) as error:  # ValueError: a number that is not finite
        if isinstance(error, OSError) and error.errno in DISK_FAILURES:
            sys.exit(_DISK_FAILED + DISK_FAILURES.index(error.errno))
        with suppress(OSError):
            write_failure(directory, task.key, error_line(error))
        sys.exit(1)


def _raise_disk_failure(exitcode: int | None, store: Store) -> None:
    """Raises the OSError that kept a worker from writing its result: every other task would fail in the same way."""
    index = (exitcode or 0) - _DISK_FAILED
    if 0 <= index < len(DISK_FAILURES):
        number = DISK_FAILURES[index]
        raise OSError(number, os.strerror(number), str(store.directory))


def error_line(error: BaseException) -> str:
    """An exception in one line, with its type."""
    return " ".join("".join(format_exception_only(error)).split())


def run_on_cluster(
    scheduler: str, module: str, tasks: Sequence[StudyTask], store: Store, stopped: Callable[[], bool]
) -> Iterator[TaskEnd]:
    """Runs the tasks on a Dask cluster, whose workers must have this project's environment; yields each as it ends.

    Raises:
        BadInput: Dask is not installed, the scheduler does not answer or ended, or the cluster lacks this project.
    """
    try:
        from distributed import CancelledError, Client, Future, wait  # an optional extra
    except ModuleNotFoundError:
        raise BadInput(f"--scheduler needs Dask, which is not installed: {how_to_install('studies')}") from None
    with _without_logs():  # Dask logs tracebacks of errors that are reported here in one line
        try:
            client = Client(scheduler, timeout=_CONNECT_S)
        except (OSError, ValueError) as error:
            raise BadInput(
                f"--scheduler {scheduler}: {error_line(error)}; is a Dask scheduler running there?"
            ) from None
    _announce(tasks, f"on the cluster of {scheduler}", store)
    with _without_logs(), client:
        run = uuid4().hex  # two runs on one cluster must not mistake each other's results for their own
        waiting: dict[Future, StudyTask] = {
            client.submit(
                _remote, module, task.parameters, key=f"{run}-{task.key}", retries=ATTEMPTS - 1, pure=False
            ): task
            for task in tasks
        }
        told = False
        begun_s = monotonic()
        while waiting and not stopped():
            if not told and monotonic() - begun_s > _WITHOUT_WORKERS_S and not client.scheduler_info()["workers"]:
                told = True
                complain(
                    f"--scheduler {scheduler}: it has no workers; waiting until one connects (dask worker {scheduler})"
                )
            try:
                ended = wait(list(waiting), timeout=_POLL_S, return_when="FIRST_COMPLETED").done
                workers = max(sum(each["nthreads"] for each in client.scheduler_info()["workers"].values()), 1)
                done = {future: future.result() for future in ended if future.status == "finished"}
                failed = {future: error_line(future.exception()) for future in ended if future.status == "error"}
            except TimeoutError:
                continue
            except (CancelledError, OSError):
                raise BadInput(f"--scheduler {scheduler}: it ended; the same command resumes from here") from None
            # One that is neither lost its result with a worker that died, and is computed again.
            for future, (result, seconds) in done.items():
                key = waiting.pop(future).key
                write_result(store.directory, key, result)
                yield TaskEnd(key, "", seconds, workers)
            if any(words in reason for reason in failed.values() for words in _LACKING):
                raise BadInput(
                    f"--scheduler {scheduler}: it, or a worker, cannot import this project, or has another revision of it; "
                    "docs/studies.md describes what each machine needs"
                )
            for future, reason in failed.items():
                key = waiting.pop(future).key
                write_failure(store.directory, key, reason)
                yield TaskEnd(key, store.failure_of(key), 0.0, workers)
        client.cancel(list(waiting))


@contextmanager
def _without_logs() -> Iterator[None]:
    """Disables logging up to the level of errors."""
    before = logging.root.manager.disable
    logging.disable(logging.ERROR)
    try:
        yield
    finally:
        logging.disable(before)


def _remote(module: str, parameters: dict[str, Any]) -> tuple[Result, float]:
    """The result of a task, and how long it took [s]."""
    begun_s = monotonic()
    return import_module(module).run(parameters), monotonic() - begun_s


def time_left_s(elapsed_s: float, took_s: Sequence[float], left: int, workers: int) -> float:
    """How long the tasks that have not ended will take, from those that have [s].

    The workers have been busy all the time; what they did beyond the tasks that ended is part of those that run.

    Args:
        elapsed_s: time since the first task began.
        took_s: how long each task took that has ended.
        left: number of those that have not.
        workers: how many are worked on at a time.
    """
    if not took_s or not left:
        return 0.0
    begun_s = max(min(workers, len(took_s) + left) * elapsed_s - sum(took_s), 0.0)
    return max(sum(took_s) / len(took_s) * left - begun_s, 0.0) / min(workers, left)
