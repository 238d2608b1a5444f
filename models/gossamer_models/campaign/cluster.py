"""Call a function many times on a Dask cluster."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from ..errors import GossamerError

SCHEDULER_PATIENCE = 10.0  # [s] for a scheduler to answer
WORKER_PATIENCE = 60.0  # [s] for its first worker

A = TypeVar("A")
R = TypeVar("R")


class CampaignStoppedError(GossamerError, RuntimeError):
    """Many simulations that ended before the last one; what is finished stays."""


def on_cluster(function: Callable[[A], R], arguments: Sequence[A], scheduler: str) -> Iterator[R]:
    """Call a function with each argument and yield what it returns; Dask gives the calls of a dead worker to another.

    Raises
    ------
    CampaignStoppedError
        There is no scheduler or no worker, or they are lost.
    """
    from distributed import CancelledError, Client, KilledWorker, as_completed
    from distributed.comm.core import CommClosedError

    try:
        client = Client(scheduler, timeout=SCHEDULER_PATIENCE)
    except (OSError, ValueError) as error:
        msg = f"there is no Dask scheduler at {scheduler}: {error}. Start one with 'dask scheduler'."
        raise CampaignStoppedError(msg) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=WORKER_PATIENCE)
        except TimeoutError as error:
            msg = f"the Dask scheduler at {scheduler} has no workers. Start some with 'dask worker {scheduler}'."
            raise CampaignStoppedError(msg) from error
        name = f"gossamer-{uuid.uuid4().hex}"
        try:
            futures = [
                client.submit(function, argument, key=f"{name}-{k}", pure=False) for k, argument in enumerate(arguments)
            ]
            for future in as_completed(futures):
                yield future.result()
        except KilledWorker as error:
            msg = f"workers of the cluster keep dying: {error}. What is finished is kept: run it again to go on."
            raise CampaignStoppedError(msg) from error
        except (CancelledError, CommClosedError, TimeoutError) as error:
            msg = f"the Dask scheduler at {scheduler} is gone. What is finished is kept: start it and run it again."
            raise CampaignStoppedError(msg) from error
