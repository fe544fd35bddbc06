"""MPI behind a wall. The only importer of mpi4py."""

from __future__ import annotations

import os
import stat
import time
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import TYPE_CHECKING, NoReturn, cast

from meshfix_cli.errors import MeshfixError, on_one_line

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

# For how many seconds a launcher may take to read the error of a process before all are ended.
PATIENCE = 5.0


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
            f"MPI needs mpi4py and an MPI library: pip install 'meshfix-cli[mpi]' mpich, or the cluster's own "
            f"({on_one_line(error)})"
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


def abort(comm: Intracomm, code: int) -> NoReturn:
    """End all processes, once the launcher has read what this one has written to stderr, or after `PATIENCE`.

    Parameters
    ----------
    comm : mpi4py.MPI.Intracomm
    code : int
        The exit code.
    """
    try:
        drained(2, PATIENCE)  # MPICH's launcher drops what it has not read: the error of one run in thirty
    finally:  # also where a signal ends the wait: the others would wait for this process for ever
        comm.Abort(code)
        os._exit(code)  # Abort may return before the launcher ends this process


def drained(descriptor: int, patience: float) -> bool:
    """Return whether all that was written to a pipe is read, within a time; only Linux can tell, of its writing end.

    Parameters
    ----------
    descriptor : int
        Where it was written; what is not a pipe is taken for read.
    patience : float
        Seconds.
    """
    end = time.monotonic() + patience
    while _holds(descriptor):
        if time.monotonic() > end:
            return False
        time.sleep(1e-3)
    return True


def _holds(descriptor: int) -> bool:
    try:
        import fcntl
        import termios

        if not stat.S_ISFIFO(os.fstat(descriptor).st_mode):
            return False
        return any(fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4)))
    except (ImportError, OSError):  # Windows, or it is closed
        return False


@contextmanager
def workers(
    comm: Intracomm, failed: Callable[[Intracomm, BaseException], NoReturn]
) -> Iterator[tuple[Executor | None, int]]:
    """Let all processes but the first work; the first gets an executor and their number, the others None at the end.

    Parameters
    ----------
    comm : mpi4py.MPI.Intracomm
    failed : callable
        Tells an error of a process that works, and ends all: the first would wait for it for ever.
    """
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
    except BaseException as error:
        if serving:
            failed(comm, error)
        raise
