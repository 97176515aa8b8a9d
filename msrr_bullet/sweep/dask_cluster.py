"""Sweeps on a cluster of Dask: its executor, and how many trials it can run at the same time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, NamedTuple

from msrr_bullet.sweep.spawned_pool import starting_deaf
from msrr_bullet.sweep.worker_pool import SupportsSubmit
from msrr_scenes.errors import MsrrError

#: Address that starts workers on this machine: ``local:N``.
_LOCAL = "local:"

#: Time that the scheduler may take to answer, and workers to appear [s].
_TIMEOUT_S = 30


class ClusterError(MsrrError):
    """A cluster that cannot be used."""


class Cluster(NamedTuple):
    """A cluster of Dask, which runs functions in its workers.

    ``slots`` returns the number of trials that it runs at the same time now, at least 1.
    """

    executor: SupportsSubmit
    slots: Callable[[], int]


@contextmanager
def dask_cluster(address: str) -> Iterator[Cluster]:
    """Connect to a cluster, or start workers on this machine.

    The address is that of a scheduler, such as ``tcp://host:8786``, or ``local:N`` for N processes on this
    machine, which end with the context.

    Raises:
        ClusterError: Dask is not installed, there is no scheduler or no worker, or a worker has several
            threads, which would only take turns.
    """
    try:
        from distributed import Client, LocalCluster
    except ModuleNotFoundError as error:  # of it, or of what it needs
        needed = f"--dask needs the package {error.name}: pip install 'msrr-bullet[dask]'"
        raise ClusterError(needed) from None
    with ExitStack() as stack:
        target: Any = address
        if address.startswith(_LOCAL):
            number = _number(address)
            with starting_deaf():
                target = stack.enter_context(
                    LocalCluster(  # on the loopback interface
                        n_workers=number, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
                    )
                )
        try:
            client = stack.enter_context(Client(target, timeout=_TIMEOUT_S))
            client.wait_for_workers(1, timeout=_TIMEOUT_S)
        except (OSError, TimeoutError, ValueError) as error:
            raise ClusterError(f"--dask {address}: no scheduler with a worker answers: {error}") from None

        def slots() -> int:
            return max(len(client.scheduler_info(n_workers=-1)["workers"]), 1)

        threads = {name: w["nthreads"] for name, w in client.scheduler_info(n_workers=-1)["workers"].items()}
        several = sorted(name for name, number in threads.items() if number > 1)
        if several:
            raise ClusterError(
                f"--dask {address}: worker {several[0]} has {threads[several[0]]} threads; start workers "
                "with --nthreads 1 and --nworkers as many as there are cores"
            )
        yield Cluster(client.get_executor(pure=False), slots)


def _number(address: str) -> int:
    text = address.removeprefix(_LOCAL)
    if not text.isdecimal() or not 1 <= int(text) <= 1024:
        raise ClusterError(f"--dask {address}: expected local:N with a number of workers from 1 to 1024")
    return int(text)
