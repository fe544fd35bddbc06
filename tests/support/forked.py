"""The command in a fork of a process that has imported what it needs: thousands of runs are spared their start.

Each run has a process, streams, a folder and an end of its own, as one that is started by its name. Where a test gives
it another environment, or there is no fork, it is started so.
"""

from __future__ import annotations

import atexit
import gc
import json
import os
import pkgutil
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path

MESHFIX = str(Path(sys.executable).parent / "meshfix")
_LONGEST = 1 << 20  # bytes of what is asked for
_APART = ("meshfix_cli.workers", "meshfix_cli.__main__")  # MPI and Dask begin where they are imported


def run(arguments: Sequence[str], data: bytes) -> subprocess.CompletedProcess[bytes]:
    """Run the command to its end."""
    if not hasattr(os, "fork") or _environment() != _AT_FIRST:
        return subprocess.run([MESHFIX, *arguments], input=data, capture_output=True, check=False)
    channel = _server()
    pipes = [os.pipe() for _ in range(3)]
    theirs, ours = [pipes[0][0], pipes[1][1], pipes[2][1]], [pipes[0][1], pipes[1][0], pipes[2][0]]
    socket.send_fds(channel, [json.dumps([*arguments, str(Path.cwd())]).encode()], theirs)
    for end in theirs:
        os.close(end)
    said: dict[int, bytes] = {}
    threads = [threading.Thread(target=_read, args=(end, said)) for end in ours[1:]]
    for thread in threads:
        thread.start()
    with suppress(BrokenPipeError), os.fdopen(ours[0], "wb") as stdin:
        stdin.write(data)
    for thread in threads:
        thread.join()
    code = int(channel.recv(16))
    return subprocess.CompletedProcess([MESHFIX, *arguments], code, said[ours[1]], said[ours[2]])


def _environment() -> Mapping[str, str]:
    return {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}


_AT_FIRST = _environment()


@cache
def _server() -> socket.socket:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        server = subprocess.Popen(
            [sys.executable, __file__, str(theirs.fileno())], pass_fds=[theirs.fileno()], env=_AT_FIRST,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,  # as those of the runs
        )  # fmt: skip

    @atexit.register
    def end() -> None:
        ours.close()
        server.wait()

    return ours


def _read(end: int, said: dict[int, bytes]) -> None:
    with os.fdopen(end, "rb") as stream:
        said[end] = stream.read()


def _serve(channel: socket.socket) -> None:
    """Begin a run for each that is asked for, and tell its end; return in the process of a run."""
    while True:
        asked, streams, *_ = socket.recv_fds(channel, _LONGEST, 3)
        if not asked:
            sys.exit()
        child = os.fork()
        if child == 0:
            break
        for stream in streams:
            os.close(stream)
        channel.send(str(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])).encode())
    channel.close()
    for place, stream in enumerate(streams):
        os.dup2(stream, place)
        os.close(stream)
    *arguments, folder = json.loads(asked)
    os.chdir(folder)
    sys.argv = ["meshfix", *arguments]


def _import_all() -> None:
    import_module("meshfix_cli.__main__")
    import meshfix_cli

    for module in pkgutil.walk_packages(meshfix_cli.__path__, "meshfix_cli."):
        if not module.name.startswith(_APART) and "kernels._" not in module.name:
            import_module(module.name)
    gc.freeze()


if __name__ == "__main__":
    del sys.path[0]  # the modules of the tests
    _import_all()
    _serve(socket.socket(fileno=int(sys.argv[1])))
    from meshfix_cli.cli import main

    main(prog_name="meshfix")
