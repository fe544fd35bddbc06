"""The communicator of MPI. The only importer of mpi4py."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from meshfix_cli.errors import MeshfixError

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

INSTALL = "install it with `pip install mpi4py mpich`, or mpi4py for the MPI library of your cluster"


def world(launched: int | None) -> Intracomm:
    """Return the communicator of all processes.

    Parameters
    ----------
    launched : int or None
        How many processes the launcher says it started.

    Raises
    ------
    MeshfixError
        There is no mpi4py or no MPI library, or it does not know of the other processes.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # of launchers: it is an error, below
            from mpi4py import MPI
    except ImportError as error:
        raise MeshfixError(f"mpi4py is not installed: {INSTALL}") from error
    except RuntimeError as error:
        raise MeshfixError(f"mpi4py finds no MPI library: {INSTALL}") from error
    comm = MPI.COMM_WORLD
    if launched is not None and launched != comm.size:
        raise MeshfixError(
            f"the launcher started {launched} processes, and each would work as one of {comm.size}: it belongs to "
            "another MPI than mpi4py's"
        )
    return comm
