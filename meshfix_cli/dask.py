"""Dask behind a wall. The only importer of distributed."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

from meshfix_cli.errors import MeshfixError


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
        raise MeshfixError(f"Dask is not installed: pip install 'meshfix-cli[dask]' ({error})") from error
    if not Path(scheduler_file).is_file():  # the client would wait for it
        raise MeshfixError(f"{scheduler_file}: No such file: is the Dask scheduler running?")
    try:
        client = Client(scheduler_file=scheduler_file)
    except (OSError, ValueError, KeyError) as error:
        raise MeshfixError(f"{scheduler_file}: no Dask scheduler answers: {error}") from error
    with client:
        executor = client.get_executor()
        try:
            yield executor, max(1, sum(client.nthreads().values()))
        finally:
            executor.shutdown(wait=False)
