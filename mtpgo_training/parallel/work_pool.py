# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Applies a function to many items, in this process or in others, in the order of the items."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Generic, TypeVar

from mtpgo_core.errors import ConfigurationError, MtpgoError
from mtpgo_training.data.code_hash import code_sha256
from mtpgo_training.parallel.dask_settings import dask_settings
from mtpgo_training.parallel.fork_server import start_fork_server
from mtpgo_training.parallel.late_interrupt import interrupt_afterwards
from mtpgo_training.parallel.pool_options import PoolOptions
from mtpgo_training.parallel.work_item import LOG, Failure, WorkItem, attempt, attempt_elsewhere

Client = Any
"""A ``distributed.Client``: Dask is imported only where several processes are wanted."""

I = TypeVar("I", bound=WorkItem)  # noqa: E741  the item
R = TypeVar("R")

TIMEOUT_S = 10.0
"""Time within which a scheduler and its first worker must answer (s); chosen: a network's."""

AT_ONCE = 2
"""Batches that a process has at the same time: the one it works on, and the next. Without the
next it would be idle for 15 ms after each batch (measured)."""

BATCH_S = 1.0
"""Time that a batch of small items should take (s); chosen: handing it out and taking its results
costs 15 ms of the processes together (measured)."""

LARGEST_BATCH = 32
"""Items handed out together at most; chosen: they are lost together if their process ends."""

LOOK_S = 2.0
"""Time between two queries of the number of processes (s); chosen: one takes milliseconds."""

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
    distributor = _Distributor(client, function, items)
    given = 0
    while given < len(items):
        distributor.hand_out()
        distributor.take_next()
        while given in distributor.results:
            yield distributor.results.pop(given)
            given += 1


class _Distributor(Generic[I, R]):
    """Hands out batches of items to the processes of a cluster and takes their results.

    Args:
        client: of the cluster.
        function: called with each item.
        items: the items.

    Attributes:
        results: by the number of the item; the caller removes them.
    """

    def __init__(self, client: Client, function: Callable[[I], R], items: Sequence[I]) -> None:
        from distributed import as_completed

        self._client, self._function, self._items = client, function, items
        self._running = as_completed()
        self._numbers: dict[Any, range] = {}  # of the items in each running batch, by its key
        self._suspects: list[int] = []  # items that processes had when they ended
        self._alone = -1  # the suspect that is worked on with no other item beside it
        self._begun = self._done = 0
        self._spent_s = 0.0
        self._processes, self._next_look_s = 1, 0.0
        self.results: dict[int, R | Failure] = {}

    def hand_out(self) -> None:
        """Hand out batches until all processes have enough to do."""
        if time.monotonic() >= self._next_look_s:  # processes come and go
            self._processes = max(1, sum(self._client.nthreads().values()))
            self._next_look_s = time.monotonic() + LOOK_S
        self._alone = -1
        if self._suspects:
            # A process that ends takes along the items that it works on and those that wait for
            # it. Working on each of them alone shows which one ends a process.
            if not self._numbers:
                self._alone = self._suspects.pop(0)
                self._submit(range(self._alone, self._alone + 1))
            return
        total, wanted = len(self._items), AT_ONCE * self._processes
        while self._begun < total and len(self._numbers) < wanted:
            if self._numbers and len(self.results) >= MOST_EARLY * self._processes:
                break
            # The last batches are small, so that no process is left with a long one.
            share = -(-(total - self._begun) // wanted)
            count = min(_batch_size(self._spent_s, self._done), share)
            self._submit(range(self._begun, self._begun + count))
            self._begun += count

    def take_next(self) -> None:
        """Wait for the next batch that ends, and take its results.

        Raises:
            MtpgoError: the cluster is lost, or something is wrong for every item.
        """
        from distributed import CancelledError, KilledWorker

        future = next(self._running)
        batch = self._numbers.pop(future.key)
        try:
            outcomes = future.result()
        except KilledWorker:
            if batch[0] == self._alone:
                reason = "its process ended without an answer, as when the memory is full"
                self.results[self._alone] = Failure(self._items[self._alone].name, reason)
            else:
                self._suspects.extend(batch)
        except CancelledError as error:
            raise MtpgoError(f"the connection to the cluster is lost: {error}") from error
        else:
            for number, outcome in zip(batch, outcomes, strict=True):
                self.results[number] = outcome.result
                for remark in outcome.remarks:
                    LOG.warning("%s", remark)
                self._done += 1
                self._spent_s += outcome.took_s

    def _submit(self, batch: range) -> None:
        import cloudpickle  # a part of Dask; readers of some layouts are lambdas

        pickled = cloudpickle.dumps((self._function, [self._items[number] for number in batch]))
        future = self._client.submit(attempt_elsewhere, pickled, pure=False)
        self._numbers[future.key] = batch
        self._running.add(future)


def _batch_size(spent_s: float, done: int) -> int:
    """Return how many items take :data:`BATCH_S` by the mean of those done, one before any is."""
    if not done:
        return 1
    return max(1, min(LARGEST_BATCH, int(BATCH_S * done / max(spent_s, 1e-9))))


@contextlib.contextmanager
def _client(options: PoolOptions, items: int) -> Iterator[Client]:
    """Yield a client of the given cluster, or of one on this machine that ends with the block."""
    from distributed import Client as DaskClient

    if not options.cluster:
        with contextlib.ExitStack() as started:
            with interrupt_afterwards():
                cluster = started.enter_context(_processes(min(options.jobs, items)))
                client = started.enter_context(DaskClient(cluster))
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
