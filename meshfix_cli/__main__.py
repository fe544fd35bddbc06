"""`meshfix` and `python -m meshfix_cli`: from here on signals end the process without a word."""

import os
import signal

# Before what takes a while to import; `cli.process` has handlers of its own.
for _name in ("SIGINT", "SIGTERM", "SIGHUP"):
    if hasattr(signal, _name) and signal.getsignal(getattr(signal, _name)) != signal.SIG_IGN:  # as nohup does
        signal.signal(getattr(signal, _name), lambda number, _: os._exit(128 + number))

import atexit
import gc

# What is imported makes many objects, and no garbage: looking for some after each 700 takes a tenth of a small run, and
# looking through all of them at the end, when all memory goes back, another.
gc.set_threshold(200_000)
atexit.register(gc.freeze)

from meshfix_cli.cli import main

if __name__ == "__main__":
    main(prog_name="meshfix")
