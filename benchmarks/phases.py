"""One run of what the command does, phase by phase: `python benchmarks/phases.py IN OUT THREADS START`.

Prints the wall seconds of each phase as JSON; the import is counted from START, seconds since the epoch. It is a file
of its own because benchmarks/process.py imports more than the command does.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import rich.table  # noqa: F401 (the command does)

import meshfix_cli.cli.untangle  # noqa: F401
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.meshfile.reading import read
from meshfix_cli.meshfile.writing import write
from meshfix_cli.quality.obstacles import find_obstacles
from meshfix_cli.quality.summary import ceiling, summarise
from meshfix_cli.solve.strategies import SMOOTHING
from meshfix_cli.solve.untangle import untangle

IMPORTED = time.time()
PHASES = ("import", "read", "topology", "untangle", "smooth", "write", "report")


def phases(path: str, target: str, threads: int) -> dict[str, float]:
    """Return the wall seconds of each phase but the import."""
    seconds = dict.fromkeys(PHASES[1:], 0.0)

    def timed(phase: str, work: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        start = time.perf_counter()
        result = work(*arguments, **options)
        seconds[phase] += time.perf_counter() - start
        return result

    build = Mesh.build
    Mesh.build = lambda *given, **options: timed("topology", build, *given, **options)  # type: ignore[method-assign]
    document = timed("read", read, path, threads=threads)
    seconds["read"] -= seconds["topology"]
    timed("topology", document.mesh.topology.stars, threads)
    outcome = untangle(document.mesh, threads=threads)
    for record in outcome.records:
        seconds["smooth" if record.phase.startswith(SMOOTHING) else "untangle"] += record.seconds
    after, _ = timed("write", document.first_valid_as_stored, outcome.after, threads=threads)
    timed("write", write, document, after, target)
    timed("report", find_obstacles, document.mesh, threads)
    for mesh in (outcome.before, outcome.untangled, outcome.after):
        timed("report", summarise, mesh, (), threads)
    timed("report", ceiling, document.mesh, threads)
    return seconds


if __name__ == "__main__":
    source, output, count, start = sys.argv[1:]
    print(json.dumps({"import": IMPORTED - float(start), **phases(source, output, int(count))}))
