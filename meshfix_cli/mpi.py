"""MPI behind a wall. The only importer of mpi4py."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import TYPE_CHECKING, cast

from meshfix_cli.errors import MeshfixError

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


def world(launched: int | None = None) -> Intracomm:
    """Return the communicator of all processes.

    Parameters
    ----------
    launched : int, optional
        How many processes the launcher says it has started.

    Raises
    ------
    MeshfixError
        There is no mpi4py or no MPI library, or the launcher is another MPI's than mpi4py's, so that each process
        believes that it is alone.
    """
    try:
        with warnings.catch_warnings():  # what it suspects of the launcher is looked at below
            warnings.filterwarnings("ignore", "suspicious MPI execution environment", RuntimeWarning)
            from mpi4py import MPI
    except ImportError as error:
        raise MeshfixError(
            f"MPI needs mpi4py and an MPI library: pip install 'meshfix-cli[mpi]' mpich, or the cluster's own ({error})"
        ) from error
    except RuntimeError as error:
        raise MeshfixError("mpi4py finds no MPI library: load the cluster's own, or pip install mpich") from error
    comm = MPI.COMM_WORLD
    if launched is not None and comm.Get_size() < launched:
        raise MeshfixError(
            f"the launcher started {launched} processes, and mpi4py sees {comm.Get_size()}: it uses another MPI, "
            f"{MPI.Get_library_version().splitlines()[0].strip()}; use that one's mpiexec, or build mpi4py with yours"
        )
    return comm


@contextmanager
def workers(launched: int | None = None) -> Iterator[tuple[Executor | None, int]]:
    """Let all processes but the first work; the first gets an executor and their number, the others None at the end.

    Parameters
    ----------
    launched : int, optional

    Raises
    ------
    MeshfixError
        See `world`.
    """
    comm = world(launched)
    from mpi4py.futures import MPICommExecutor

    serving = comm.Get_rank() > 0
    try:
        with MPICommExecutor(comm, root=0) as opened:
            serving, executor = False, cast("Executor | None", opened)
            try:
                yield executor, max(1, comm.Get_size() - 1)
            except BaseException:
                if executor is not None:
                    executor.shutdown(cancel_futures=True)
                raise
    except BaseException:
        if serving:  # the others would wait for this one for ever
            comm.Abort(1)
        raise
