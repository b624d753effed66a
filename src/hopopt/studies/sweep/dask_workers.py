"""A study's points on the workers of a Dask scheduler: one that runs already, or one of this computer's own."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from hopopt.errors import HopoptError, UsageError
from hopopt.studies.sweep.crew import GO_ON, Workers

LOCAL = "local"
PATIENCE = 10  # seconds for a scheduler to answer
LOSSES = 10  # workers that may die at a point before it is given up


@contextmanager
def dask_workers(count: int, scheduler: str) -> Iterator[Workers]:
    """``count`` processes of a cluster of its own ("local"), or the workers of the scheduler at an address.

    What a worker that dies was at, another does; only this process writes, so workers need no common disk. UsageError
    if Dask is missing or nothing answers at the address, HopoptError if the scheduler is lost on the way.
    """
    try:
        from dask.config import set as settings
        from distributed import Client
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise UsageError("--scheduler needs Dask: pip install 'hopopt[dask]', or leave --scheduler out") from None
    quiet = {"distributed.scheduler.allowed-failures": LOSSES, "distributed.admin.large-graph-warning-threshold": "1GB"}
    with settings(quiet), _silent(), _cluster(count, scheduler) as address:
        try:
            client = Client(address, timeout=PATIENCE)
        except (OSError, ValueError) as error:
            raise UsageError(f"--scheduler {scheduler}: no Dask scheduler answers there") from error
        try:
            number = count if scheduler == LOCAL else _count(client, scheduler)
            yield Workers(number, lambda job, *given: client.submit(job, *given, pure=False), _first_of)
        except (KilledWorker, OSError, _cancelled()) as error:
            raise HopoptError(f"the Dask scheduler or all its workers were lost; {GO_ON}") from error
        finally:
            client.close(timeout=PATIENCE)


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

    with LocalCluster(
        n_workers=count, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=logging.CRITICAL
    ) as cluster:
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


def _cancelled() -> type[BaseException]:
    from distributed.client import FutureCancelledError

    return FutureCancelledError


def _first_of(futures: set[Any]) -> tuple[set[Any], set[Any]]:
    from distributed import wait

    done, running = wait(futures, return_when="FIRST_COMPLETED")  # type: ignore[misc]
    return set(done), set(running)
