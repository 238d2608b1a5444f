"""Run a campaign: the chunks that are missing, on the cores of this machine or on a Dask cluster.

A task is one chunk; its worker writes what it has computed. Numbers depend on nothing but the campaign, so workers, their
order and their deaths leave no trace in them.
"""

from __future__ import annotations

import logging
import os
import pickle
import signal
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from importlib.metadata import version
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import TypeVar

from gossamer_files.inputs import followed
from gossamer_files.options import option

from ..errors import GossamerError, StateError
from .chunk import Kernels, build_kernels, run_chunk
from .description import CampaignPlan
from .store import count_failed, create_store, missing_chunks, open_store, remove_leftovers, write_cases

A = TypeVar("A")
R = TypeVar("R")
SCHEDULER_PATIENCE = 10.0  # [s] for a scheduler to answer
WORKER_PATIENCE = 60.0  # [s] for its first worker
log = logging.getLogger(__name__)
DEATHS = 3  # workers lost in a row, without a finished chunk between, after which a campaign stops


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

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # a lost scheduler is one sentence here
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


@dataclass(frozen=True)
class Summary:
    """What a run of a campaign did.

    Attributes
    ----------
    cases, failed : int
        Cases in the store, and those of them whose simulation broke.
    simulated : int
        Cases that this run added.
    seconds : float
        Wall time of the simulations [s], without compilation.
    """

    cases: int
    failed: int
    simulated: int
    seconds: float


@dataclass(frozen=True)
class ChunkTask:
    """What a worker needs for any chunk of a campaign.

    Attributes
    ----------
    campaign, path
        Campaign, and the folder of its store.
    kernels : bytes
        Its compiled models, pickled: only paths of libraries, which another machine may not have.
    version : str
        Of Gossamer; a worker of another one refuses.
    """

    campaign: CampaignPlan
    kernels: bytes
    path: Path
    version: str


def run_campaign(
    campaign: CampaignPlan,
    path: Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    source: str = "",
    progress: Callable[[int, int], None] = lambda *_: None,
) -> Summary:
    """Run the chunks of a campaign that its store does not have yet.

    Parameters
    ----------
    campaign : CampaignPlan
        What to run.
    path : Path
        Folder of the store; created if it is not there.
    workers : int, optional
        Processes; all cores by default.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://host:8786``, to run there; its workers need this version of Gossamer
        and the same folders.
    source : str
        Text of the file that the campaign was read from; kept in the store.
    progress : callable
        Called with the number of finished and of all cases.

    Returns
    -------
    Summary

    Raises
    ------
    CampaignStoppedError
        A disk is full, workers keep dying, or the scheduler is lost; run it again to go on.
    DataError
        The folder holds something else.
    OSError
        The folder cannot be created.
    """
    path = followed(path)
    kernels = build_kernels(campaign)
    task = ChunkTask(campaign, pickle.dumps(kernels), path, version("gossamer"))
    if not path.exists():
        create_store(path, campaign, kernels, source)
    group = open_store(path, campaign, kernels)
    missing = missing_chunks(group, campaign)
    simulated = sum(len(campaign.numbers(chunk)) for chunk in missing)
    done = campaign.count - simulated
    begun = time.perf_counter()
    log.info("%d of %d cases are to be simulated, in %d chunks", simulated, campaign.count, len(missing))
    progress(done, campaign.count)
    work = partial(write_chunk, task)
    for chunk in on_cluster(work, missing, scheduler) if scheduler else _on_cores(task, missing, workers):
        done += len(campaign.numbers(chunk))
        log.info("chunk %d is finished after %.1f s", chunk, time.perf_counter() - begun)
        progress(done, campaign.count)
    seconds = time.perf_counter() - begun
    lost = len(missing_chunks(group, campaign))
    if lost:
        advice = f"Name a shared one with {option('out')}."
        msg = f"{lost} chunks did not arrive in {path}: the workers see another folder there. {advice}"
        raise CampaignStoppedError(msg)
    remove_leftovers(path)
    return Summary(campaign.count, count_failed(group), simulated, seconds)


def write_chunk(task: ChunkTask, chunk: int) -> int:
    """Simulate a chunk and write it, in a worker; return its number.

    Raises
    ------
    CampaignStoppedError
        It cannot be written, or the worker has another version of Gossamer.
    """
    from threadpoolctl import threadpool_limits

    if version("gossamer") != task.version:
        msg = f"a worker has Gossamer {version('gossamer')}, this is {task.version}. Install one version everywhere."
        raise CampaignStoppedError(msg)
    with threadpool_limits(1):
        kernels = _kernels(task.kernels) or build_kernels(task.campaign)
        content = run_chunk(task.campaign, kernels, chunk)
    try:
        group = open_store(task.path, task.campaign, kernels)
        write_cases(group, task.campaign.numbers(chunk), content)
    except OSError as error:
        advice = "Finished chunks are kept: make room, and run it again to go on."
        msg = f"cannot write to {task.path}: {error.strerror or error}. {advice}"
        raise CampaignStoppedError(msg) from error
    return chunk


@lru_cache(maxsize=4)
def _kernels(pickled: bytes) -> Kernels | None:
    """Return the compiled models; None on another machine than the one that compiled them."""
    try:
        kernels: Kernels = pickle.loads(pickled)
    except StateError:
        return None
    return kernels


def _on_cores(task: ChunkTask, chunks: Sequence[int], workers: int | None) -> Iterator[int]:
    """Run chunks in processes of this machine and yield each that is finished; replace workers that die."""
    workers = workers or (len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)
    left = list(chunks)
    deaths = 0
    while left:
        pool = ProcessPoolExecutor(min(workers, len(left)), get_context("spawn"), initializer=_begin_worker)
        try:
            with _without_ctrl_c():  # workers are started by these calls
                futures = [pool.submit(write_chunk, task, chunk) for chunk in left]
            for future in as_completed(futures):
                left.remove(future.result())
                deaths = 0
                yield future.result()
        except BrokenExecutor as error:
            deaths += 1
            if deaths == DEATHS:
                advice = "Finished chunks are kept: run it again with fewer workers."
                msg = f"workers died {deaths} times in a row, for want of memory perhaps. {advice}"
                raise CampaignStoppedError(msg) from error
        finally:
            pool.shutdown(cancel_futures=True)


@contextmanager
def _without_ctrl_c() -> Iterator[None]:
    """Hold Ctrl-C back, for ever in processes that are started meanwhile: one that imports would end with a traceback."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, which lets chunks finish, and end with it if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
