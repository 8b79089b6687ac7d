# SPDX-License-Identifier: Apache-2.0
"""Who simulates the parts: this machine's cores, or a Dask cluster."""

from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from typing import Any

import twinmill_native as native

from twinmill.arguments import option
from twinmill.programs import available_cores
from twinmill.swarm.request import Request, run_part
from twinmill.version import __version__

Done = tuple[int, dict[str, list[Any]]]
CONNECT_S = 15


def run_here(request: Request, parts: dict[int, range], workers: int | None) -> Iterator[Done]:
    """Runs parts in threads, which the kernel leaves free to run; yields them as they end."""
    count = workers or available_cores()
    queue = iter(parts.items())
    with ThreadPoolExecutor(count) as pool:
        running = {}
        try:
            while True:
                for number, worlds in queue:
                    running[pool.submit(run_part, request, worlds)] = number
                    if len(running) >= 2 * count:
                        break
                if not running:
                    return
                for done in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(done), done.result()
        finally:
            for future in running:
                future.cancel()


def _run_remote(text: str, worlds: range) -> dict[str, list[Any]]:
    """On a worker of the cluster."""
    request = Request.from_json(text)
    if __version__ != request.version:
        raise ValueError(
            f"a worker has twinmill {__version__}, but this is {request.version}: "
            "install the same on both."
        )
    if request.to_json() != text:
        raise ValueError(
            f"a worker simulates with {native.MUJOCO_PHYSICS}, and this machine otherwise: install "
            "the same on both."
        )
    return run_part(request, worlds)


def run_on_dask(request: Request, parts: dict[int, range], address: str) -> Iterator[Done]:
    """Sends parts to an existing cluster; what a lost worker had is sent to another.

    Raises:
        ValueError: nobody answers at the address.
    """
    from dask.distributed import Client, as_completed

    try:
        client = Client(address, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        raise ValueError(
            f"{option('dask', address)}: no scheduler answers there ({error})."
        ) from error
    with client:
        text = client.scatter(request.to_json(), broadcast=True, hash=False)
        number_of = {
            client.submit(_run_remote, text, worlds, pure=False, retries=2): number
            for number, worlds in parts.items()
        }
        for future in as_completed(number_of):
            yield number_of[future], future.result()
            future.release()
