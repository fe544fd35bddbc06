"""Dask behind a wall. The only importer of distributed."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshfix_cli.errors import MeshfixError, on_one_line

if TYPE_CHECKING:
    from distributed import Client


@contextmanager
def workers(scheduler_file: str) -> Iterator[tuple[Executor | None, int]]:
    """Connect to a cluster; give an executor and the number of its threads.

    Parameters
    ----------
    scheduler_file : str
        What `dask scheduler --scheduler-file` writes.

    Raises
    ------
    MeshfixError
        Dask is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise MeshfixError(f"Dask is not installed: pip install 'meshfix-cli[dask]' ({on_one_line(error)})") from error
    for name in ("distributed", "distributed.client"):  # they log what is told below, with tracebacks
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        address = json.loads(Path(scheduler_file).read_bytes())["address"]
    except OSError as error:
        raise MeshfixError(f"{scheduler_file}: {error.strerror}; is the Dask scheduler running?") from error
    except (ValueError, KeyError, TypeError) as error:
        raise MeshfixError(f"{scheduler_file}: is not a file of a Dask scheduler") from error
    try:
        client = Client(address)
    except (OSError, ValueError) as error:
        raise MeshfixError(f"{scheduler_file}: no Dask scheduler answers at {address}: {on_one_line(error)}") from error
    with client:  # at its end the scheduler forgets what was not begun
        yield _Cluster(client), sum(client.nthreads().values())


class _Cluster(Executor):
    """What `client.get_executor()` gives, but for a scheduler that has gone, where that one waits for ever."""

    def __init__(self, client: Client) -> None:
        self._client, self._executor = client, client.get_executor()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        if self._client.status != "running":
            raise MeshfixError("the Dask scheduler has gone")
        future: Future[Any] = self._executor.submit(fn, *args, **kwargs)
        return future
