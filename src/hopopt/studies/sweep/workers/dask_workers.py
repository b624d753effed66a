"""A study's points on the workers of a Dask scheduler: one that runs already, or one of this computer's own."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from hopopt.errors import HopoptError, UsageError
from hopopt.storage.folder import reason_of
from hopopt.studies.sweep.workers.crew import HOW_TO_RESUME, Job, Kept, Workers

LOCAL = "local"
LOOPBACK = "127.0.0.1"  # nobody on the network may give a cluster of this computer work
SCHEDULER_TIMEOUT = 10  # seconds for a scheduler to answer
LOSSES = 10  # workers that may die at a point before it is given up


@contextmanager
def dask_workers(count: int, scheduler: str) -> Iterator[Workers]:
    """``count`` processes of a cluster of its own ("local"), or the workers of the scheduler at an address.

    What a worker that dies was at, another does; only this process writes, so workers need no common disk. UsageError
    if Dask is missing or nothing answers at the address, HopoptError for what goes wrong on the way.
    """
    try:
        from dask.config import set as settings
        from distributed import Client, wait
    except ImportError:
        raise UsageError("--scheduler needs Dask: pip install 'hopopt[dask]', or leave --scheduler out") from None
    quiet = {"distributed.scheduler.allowed-failures": LOSSES, "distributed.admin.large-graph-warning-threshold": "1GB"}
    with settings(quiet), _silent(), _cluster(count, scheduler) as address:
        try:
            client = Client(
                address, timeout=SCHEDULER_TIMEOUT, set_as_default=False
            )  # else xarray would ask for it, gone
        except (OSError, ValueError) as error:
            raise UsageError(f"--scheduler {scheduler}: no Dask scheduler answers there") from error

        def submit(job: Job, *given: Any) -> Any:
            with _told_apart(scheduler):
                return client.submit(job, *given, pure=False)

        def collect(futures: set[Any]) -> tuple[list[Kept], set[Any]]:
            with _told_apart(scheduler), client.as_current():
                done, running = wait(futures, return_when="FIRST_COMPLETED")  # type: ignore[misc]
                return [future.result() for future in done], set(running)

        try:
            yield Workers(count if scheduler == LOCAL else _count(client, scheduler), submit, collect)
        finally:
            client.close(timeout=SCHEDULER_TIMEOUT)


@contextmanager
def _told_apart(scheduler: str) -> Iterator[None]:
    """HopoptError that says which of the many things went wrong that Dask, or a job on a worker, raises."""
    from distributed.client import FutureCancelledError
    from distributed.comm.core import CommClosedError
    from distributed.scheduler import KilledWorker

    try:
        yield
    except HopoptError:
        raise
    except KilledWorker as error:
        raise HopoptError(
            f"a point ended {LOSSES + 1} workers one after another (out of memory?); {HOW_TO_RESUME}"
        ) from error
    except (FutureCancelledError, CommClosedError, TimeoutError) as error:
        raise HopoptError(f"the Dask scheduler ({scheduler}) was lost; {HOW_TO_RESUME}") from error
    except ImportError as error:
        words = f"a worker lacks {error.name or 'a package'}: install the same hopopt there"
        raise HopoptError(f"--scheduler {scheduler}: {words}; {HOW_TO_RESUME}") from error
    except Exception as error:
        words = f"a worker failed with {type(error).__name__}: {reason_of(error)}"
        raise HopoptError(f"--scheduler {scheduler}: {words}; {HOW_TO_RESUME}") from error


def _count(client: Any, scheduler: str) -> int:
    """Points side by side: one for each worker, for CasADi's work cannot be shared by threads."""
    number = len(client.scheduler_info(n_workers=-1)["workers"])
    if not number:
        raise UsageError(f"--scheduler {scheduler}: that scheduler has no workers: start some with dask worker")
    return number


@contextmanager
def _cluster(count: int, scheduler: str) -> Iterator[Any]:
    if scheduler != LOCAL:
        yield scheduler
        return
    from distributed import LocalCluster

    options: dict[str, Any] = {"dashboard_address": f"{LOOPBACK}:0", "silence_logs": logging.CRITICAL}
    with LocalCluster(host=LOOPBACK, n_workers=count, threads_per_worker=1, processes=True, **options) as cluster:
        yield cluster


@contextmanager
def _silent() -> Iterator[None]:
    """Dask's own log is not the study's: a worker that dies is replaced, and what cannot be is said here."""
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)
