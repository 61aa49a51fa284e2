# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Many items through one function, in the order of the items, wherever they are worked on."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from mtpgo_core.errors import ConfigurationError, MtpgoError
from mtpgo_training.data.code_hash import code_sha256
from mtpgo_training.parallel.dask_settings import dask_settings
from mtpgo_training.parallel.fork_server import start_fork_server
from mtpgo_training.parallel.pool_options import PoolOptions
from mtpgo_training.parallel.work_item import LOG, Failure, WorkItem, attempt, attempt_elsewhere

Client = Any
"""A ``distributed.Client``: Dask is imported only where several processes are wanted."""

I = TypeVar("I", bound=WorkItem)  # noqa: E741  the item
R = TypeVar("R")

TIMEOUT_S = 10.0
"""Time within which a scheduler and its first worker must answer (s); chosen: a network's."""

AT_ONCE = 2
"""Batches that a process has at the same time: one that it works on, and the next. Without the
next it would wait for one after each batch, which took 15 ms (measured)."""

BATCH_S = 1.0
"""Time that a batch of small items should take (s); chosen: handing it out and taking its results
costs 15 ms of the processes together (measured)."""

LARGEST_BATCH = 32
"""Items handed out together at most; chosen: they are lost together if their process ends."""

LOOK_S = 2.0
"""Time between two looks at the number of processes (s); chosen: a look takes milliseconds."""

MOST_EARLY = 64
"""Results that wait for one of an earlier item, per process; chosen, bounds the memory."""


def work_through(
    function: Callable[[I], R], items: Sequence[I], options: PoolOptions
) -> Iterator[R | Failure]:
    """Yield the function's result of each item, or why there is none, in the order of the items.

    Each process works on one item at a time. Items are handed out as processes become free, small
    ones several together, so that the memory needed does not grow with the number of items.

    Args:
        function: can be pickled, as can its results. It does not depend on other items.
        items: what it is called with.
        options: where it is called.

    Raises:
        ConfigurationError: the cluster cannot be used.
        MtpgoError: something is wrong for every item, such as a model, or the cluster is lost.
        ModuleNotFoundError: the extra ``fleet`` is needed and not installed.
    """
    if options.here or (len(items) < 2 and not options.cluster):
        for item in items:
            yield attempt(function, item)
        return
    start_fork_server(options, function.__module__)
    with dask_settings(), _client(options, len(items)) as client:
        if options.cluster:
            _require_same_code(client, options.cluster, function)
        yield from _elsewhere(client, function, items)


def _elsewhere(
    client: Client, function: Callable[[I], R], items: Sequence[I]
) -> Iterator[R | Failure]:
    """Yield the results from the processes of a cluster, in the order of the items."""
    import cloudpickle  # a part of Dask; readers of some layouts are lambdas
    from distributed import CancelledError, KilledWorker, as_completed

    numbers: dict[Any, range] = {}  # of the items that are worked on
    suspects: list[int] = []  # items that processes had when they ended
    early: dict[int, R | Failure] = {}
    running = as_completed()
    begun = given = done = 0
    spent_s = 0.0
    processes, next_look_s = 1, 0.0

    def hand_out(batch: range) -> None:
        pickled = cloudpickle.dumps((function, [items[number] for number in batch]))
        future = client.submit(attempt_elsewhere, pickled, pure=False)
        numbers[future.key] = batch
        running.add(future)

    while given < len(items):
        if time.monotonic() >= next_look_s:  # processes come and go
            processes = max(1, sum(client.nthreads().values()))
            next_look_s = time.monotonic() + LOOK_S
        alone = -1
        if suspects:
            # A process that ends takes along what it has and what waits for it. Which item it was
            # shows when each is worked on with no other beside it.
            if not numbers:
                alone = suspects.pop(0)
                hand_out(range(alone, alone + 1))
        else:
            while begun < len(items) and len(numbers) < AT_ONCE * processes:
                if numbers and len(early) >= MOST_EARLY * processes:
                    break
                # The last batches are small, so that no process is left with a long one.
                count = min(
                    _batch_size(spent_s, done), -(-(len(items) - begun) // (AT_ONCE * processes))
                )
                hand_out(range(begun, begun + count))
                begun += count
        future = next(running)
        batch = numbers.pop(future.key)
        try:
            outcomes = future.result()
        except KilledWorker:
            if batch[0] == alone:
                reason = "its process ended without an answer, as when the memory is full"
                early[alone] = Failure(items[alone].name, reason)
            else:
                suspects.extend(batch)
        except CancelledError as error:
            raise MtpgoError(f"the connection to the cluster is lost: {error}") from error
        else:
            for number, outcome in zip(batch, outcomes, strict=True):
                early[number] = outcome.result
                for remark in outcome.remarks:
                    LOG.warning("%s", remark)
                done += 1
                spent_s += outcome.took_s
        while given in early:
            yield early.pop(given)
            given += 1


def _batch_size(spent_s: float, done: int) -> int:
    """Return how many items take :data:`BATCH_S`, by those that are done; one before any is."""
    if not done:
        return 1
    return max(1, min(LARGEST_BATCH, int(BATCH_S * done / max(spent_s, 1e-9))))


@contextlib.contextmanager
def _client(options: PoolOptions, items: int) -> Iterator[Client]:
    """Yield a client of the given cluster, or of one on this machine that ends with the block."""
    from distributed import Client as DaskClient

    if not options.cluster:
        with _processes(min(options.jobs, items)) as cluster, DaskClient(cluster) as client:
            yield client
        return
    try:
        client = DaskClient(options.cluster, timeout=TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise ConfigurationError(
            f"the cluster is {options.cluster}, where no Dask scheduler answers, expected its "
            f"address such as tcp://host:8786"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=TIMEOUT_S)
        except TimeoutError as error:
            raise ConfigurationError(
                f"the cluster {options.cluster} has no worker, expected at least one"
            ) from error
        yield client


@contextlib.contextmanager
def _processes(number: int) -> Iterator[Any]:
    """Yield a cluster of processes on this machine, which end with the block."""
    from distributed import LocalCluster

    cluster = LocalCluster(
        n_workers=number,
        threads_per_worker=1,
        dashboard_address=None,
        silence_logs=logging.CRITICAL,
        # Encrypted: others who work on this machine could otherwise hand it their code.
        security=True,
    )
    try:
        yield cluster
    finally:
        # Killed processes whose end is not known within 5 s, as where too many share the cores,
        # must not take along the results.
        with contextlib.suppress(TimeoutError):
            cluster.close()


def _require_same_code(client: Client, cluster: str, function: Callable[..., Any]) -> None:
    """Check that the workers of a cluster would compute the same.

    Raises:
        ConfigurationError: they have another version of this project, or none.
    """
    own = code_sha256(function)
    try:
        found = client.run(code_sha256, function)
    except ImportError as error:
        raise ConfigurationError(
            f"the workers of the cluster {cluster} cannot load the project: {error}"
        ) from error
    others = [worker for worker, code in found.items() if code != own]
    if others:
        raise ConfigurationError(
            f"{len(others)} of {len(found)} workers of the cluster {cluster} have another version "
            f"of the project, such as {others[0]}"
        )
