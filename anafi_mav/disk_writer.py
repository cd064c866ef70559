"""Threads for files: a disk that hangs must stop neither a drone nor the end of the program.

The interpreter joins the threads of the standard library's pools when it ends, however long that takes. These are
daemons. The owner of data that must be on the disk waits for it, within a bound.
"""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any, TypeVar

T = TypeVar("T")

HANGS = "the disk does not answer"
"""Reason of data that is not written in time."""

_Job = Callable[[], object]


class DiskWriter(Executor):
    """Runs jobs in daemon threads, in their order. For `run_in_executor`, or by itself."""

    def __init__(self, name: str, *, threads: int = 1, max_waiting: int = 0) -> None:
        """`name`: of its threads.

        `max_waiting`: jobs that `post` accepts while none is done; 0: any number.
        """
        self._name = name
        self._threads = threads
        self._jobs: queue.Queue[_Job | None] = queue.Queue(max_waiting)
        self._started = 0
        self._lock = threading.Lock()

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """Run a job later; return the future of its result."""
        future: Future[T] = Future()

        def work() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                result = fn(*args, **kwargs)
            except BaseException as error:  # as the standard library's: the caller gets it
                future.set_exception(error)
            else:
                future.set_result(result)

        self._jobs.put(work)
        self._start()
        return future

    def post(self, job: Callable[[], object]) -> bool:
        """Run a job, which raises nothing, later; return False when too many wait. Never blocks."""
        try:
            self._jobs.put_nowait(job)
        except queue.Full:
            return False
        self._start()
        return True

    def wait(self, timeout: float) -> bool:
        """Block until all jobs are done, `timeout` s at most; return True if they are."""
        with self._jobs.all_tasks_done:
            return self._jobs.all_tasks_done.wait_for(lambda: not self._jobs.unfinished_tasks, timeout)

    async def drain(self, timeout: float) -> bool:
        """Wait until the jobs of one thread are done, `timeout` s at most; return True if they are."""
        if not self._jobs.unfinished_tasks:
            return True
        last = asyncio.get_running_loop().run_in_executor(self, lambda: None)
        done, _ = await asyncio.wait([last], timeout=timeout)
        last.cancel()
        return bool(done)

    def shutdown(self, wait: bool = False, *, cancel_futures: bool = False) -> None:
        """End the threads behind their last job. Never blocks, whatever `wait` is."""
        with self._lock:
            for _ in range(self._started):
                with contextlib.suppress(queue.Full):
                    self._jobs.put_nowait(None)

    def _start(self) -> None:
        """Start one more thread, while there are not enough."""
        with self._lock:
            if self._started == self._threads:
                return
            self._started += 1
        threading.Thread(target=self._run, name=self._name, daemon=True).start()

    def _run(self) -> None:
        while True:
            job = self._jobs.get()
            try:
                if job is None:
                    return
                job()
            finally:
                del job  # its data, too, while the thread waits
                self._jobs.task_done()
