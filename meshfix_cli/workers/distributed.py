"""One mesh over several processes: the sweeps of `untangle.py`, with the same bits as in one process.

Process 0, the root, has the whole mesh. It gives each process some blocks (kernels/mesh/stars.hpp) and one layer of
ghosts around them, and gets the positions back. In a sweep the processes exchange the vertices at their rims after each
colour of blocks; a vertex is moved by one process only, with the positions that it would have in one process.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshfix_cli import kernels
from meshfix_cli.errors import MeshfixError, on_one_line
from meshfix_cli.mesh.freedom import Freedom
from meshfix_cli.mesh.judged import Judged
from meshfix_cli.mesh.mesh import Mesh
from meshfix_cli.mesh.mixed import MixedTopology
from meshfix_cli.mesh.topology import Topology, distinct
from meshfix_cli.quality.obstacles import find_obstacles
from meshfix_cli.repair import Method
from meshfix_cli.solve.records import Outcome, RankRecord, SweepRecord, drain
from meshfix_cli.solve.team import rank_of

if TYPE_CHECKING:
    from pathlib import Path

    from mpi4py.MPI import Intracomm, Request

    from meshfix_cli.meshfile.splice import Places
    from meshfix_cli.repair import Steps

ROOT = 0
Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Part:
    """What one process holds; its own vertices come first, in whole blocks, then the ghosts.

    Attributes
    ----------
    vertices : (n,) int32
        Their numbers in the whole, ascending among the own ones and among the ghosts.
    own : int
        How many are its own.
    points : (n, d) float64
    movable : (n,) bool
    codes : (m,) uint8 or None
        The types of the elements; None: all are simplices of one type.
    nodes : (m, d+1) int32, or (k,) int32
        The vertices of the simplices, or of elements, one behind the other: all that have an own vertex, in the order
        of the whole, so that sums over a star have its order too.
    own_elements, hopeless : (m,) bool
    owners, colours : (n - own,) int32
        Of the ghosts: the process that moves them and the colour of their block.
    block_colours : (own blocks,) int32
    reach : float
        How far vertices may move, in model units.
    reference : (n, d) float64 or None
        Where they were before the boundary moved.
    freedom : Freedom or None
        Where they may go.
    """

    vertices: Numbers
    own: int
    points: Array
    movable: Mask
    codes: NDArray[np.uint8] | None
    nodes: Numbers
    own_elements: Mask
    hopeless: Mask
    owners: Numbers
    colours: Numbers
    block_colours: Numbers
    reach: float
    reference: Array | None = None
    freedom: Freedom | None = None

    def topology(self, threads: int) -> Topology:
        """Return the topology of the part."""
        n, m, d = len(self.vertices), len(self.own_elements), self.points.shape[1]
        source, flipped = np.arange(m, dtype=np.int32), np.zeros(m, dtype=bool)
        if self.codes is None:
            return Topology(n, source, flipped, kernels.Connectivity.part(self.nodes, n, threads))
        elements = kernels.Connectivity.part(self.codes, self.nodes, n, d, threads)
        return MixedTopology(n, source, flipped, elements)


class Root:
    """What the root asks of the processes, itself among them; the others are in `serve`.

    Parameters
    ----------
    comm : Intracomm
    method : Method
        The same in all processes.
    threads : int
        Of each process.
    watch : callable
        Passes the steps through, to show them.
    """

    def __init__(self, comm: Intracomm, method: Method, threads: int, watch: Callable[[Steps], Steps] = iter) -> None:
        self.comm, self.method, self.threads, self.watch = comm, method, threads, watch
        self.owned: list[NDArray[np.int32]] = []
        self.busy = False  # the others are at work, and would wait for ever if this process ended

    def solve(self, mesh: Mesh, reach: float, reference: Array | None = None) -> Outcome:
        """Untangle a mesh; `reach`: how far vertices may move, in model units; `reference`: see `untangle.steps`.

        Raises
        ------
        MeshfixError
            pymetis is not installed.
        """
        if self.comm.size > 1 and find_spec("pymetis") is None:
            raise MeshfixError("pymetis is not installed: pip install 'meshfix-cli[mpi]'")
        if mesh.quadratic is not None or mesh.surface is not None:  # the others have nothing to do: these are little
            return self.method.solve(mesh, reach, self.threads, self.watch, reference)
        self._order("solve")
        own, self.owned, obstacles = None, [], find_obstacles(mesh, self.threads)
        hopeless = obstacles.hopeless(mesh)
        for rank, part in enumerate(parts(mesh, self.comm.size, reach, self.threads, hopeless, reference)):
            self.owned.append(mesh.topology.connectivity.vertices[part.vertices[: part.own]])
            if rank == ROOT:
                own = part
            else:
                self.comm.send(part, rank)
        assert own is not None
        before, untangled, after, records, ranks = _solved(self.comm, self.method, self.threads, own, mesh, self.watch)
        self.busy = False
        assert before is not None and untangled is not None and after is not None
        return Outcome(before, untangled, after, records, obstacles, ranks)

    def put(self, path: Path, places: Places, points: NDArray[np.floating[Any]], changed: Mask) -> None:
        """Write numbers (n, k) of a binary file where they changed (n, k), each process those of its vertices.

        Raises
        ------
        OSError
        """
        self._order("put")
        kind = places.dtype
        pieces = [
            (str(path), kind.itemsize, places.begin[rows][changed[rows]], points[rows][changed[rows]].astype(kind))
            for rows in self.owned
        ]
        failed = _put(self.comm, *self.comm.scatter(pieces, ROOT))
        self.busy = False
        if failed is not None:
            raise OSError(failed)

    def dismiss(self, code: int) -> None:
        """Let the others end, with an exit code."""
        self._order(code)

    def _order(self, order: str | int) -> None:
        self.busy = True
        self.comm.bcast(order, ROOT)


def serve(comm: Intracomm, method: Method, threads: int) -> int:
    """Do what the root asks for until it has no more work; return its exit code."""
    while True:
        order = comm.bcast(None, ROOT)
        if order == "solve":
            _solved(comm, method, threads, comm.recv(source=ROOT), None)
        elif order == "put":
            _put(comm, *comm.scatter(None, ROOT))
        else:
            return int(order)


def _put(comm: Intracomm, path: str, size: int, offsets: NDArray[np.int64], values: NDArray[Any]) -> str | None:
    """Write numbers of `size` bytes at offsets of a file, all processes at once; return what failed in any.

    Nothing else is raised, so that the root can clear up.
    """
    from mpi4py import MPI

    failed = None
    try:
        order = np.argsort(offsets)
        offsets, numbers = offsets[order], values[order].view(np.uint8)
        first = np.flatnonzero(np.diff(offsets, prepend=-size - 1) != size)  # of those that stand side by side
        lengths = np.diff(np.append(first, len(offsets))) * size
        where = MPI.BYTE.Create_hindexed(lengths.tolist(), offsets[first].tolist()).Commit()
    except Exception as error:
        said = error.strerror if isinstance(error, OSError) else str(error)
        failed = f"process {comm.rank}: {said or type(error).__name__}"
    failed = _first(comm, failed)
    if failed is not None:
        return failed
    try:
        file = MPI.File.Open(comm, path, MPI.MODE_WRONLY)
        try:
            file.Set_view(0, MPI.BYTE, where)
            file.Write_all(numbers)
        finally:
            file.Close()
    except MPI.Exception as error:
        failed = on_one_line(error.Get_error_string())
    where.Free()
    return _first(comm, failed)


def _first(comm: Intracomm, failed: str | None) -> str | None:
    return next((one for one in comm.allgather(failed) if one is not None), None)


def _solved(
    comm: Intracomm,
    method: Method,
    threads: int,
    part: Part,
    whole: Mesh | None,
    watch: Callable[[Steps], Steps] = iter,
) -> tuple[Mesh | None, Mesh | None, Mesh | None, tuple[SweepRecord, ...], tuple[RankRecord, ...]]:
    """Solve one part; the root gets the whole mesh as it came, untangled and smoothed, the others None."""
    team = Ranks(comm, part, whole, threads)
    *stages, records = drain(watch(method.steps(team.mesh, part.reach, threads, part.hopeless, team, part.reference)))
    known = {id(stages[0]): whole}
    for stage in stages:
        if id(stage) not in known:
            points = team.gathered(stage.points)
            known[id(stage)] = None if whole is None or points is None else whole.with_vertices(points)
    ranks = comm.gather(team.record(), ROOT) or []
    before, untangled, after = (known[id(stage)] for stage in stages)
    return before, untangled, after, records, tuple(ranks)


def parts(
    mesh: Mesh,
    ranks: int,
    reach: float,
    threads: int,
    hopeless: Mask | None = None,
    reference: Array | None = None,
) -> Iterator[Part]:
    """Yield what each process holds; blocks are dealt out so that few edges go from one process to another."""
    stars = mesh.topology.stars(threads)
    points, movable = mesh.along_curve(mesh.points), mesh.along_curve(mesh.movable)
    of_block = partition(stars, ranks)
    colour = np.empty(len(of_block), dtype=np.int32)
    colour[stars.colour_blocks] = np.repeat(
        np.arange(len(stars.colour_offsets) - 1, dtype=np.int32), np.diff(stars.colour_offsets)
    )
    owner, number = np.repeat(of_block, kernels.BLOCK_SIZE)[: len(points)], np.empty(len(points), dtype=np.int32)
    for rank in range(ranks):
        blocks = np.flatnonzero(of_block == rank)
        own, simplices = _stars_of(stars, blocks)
        rows = distinct(mesh.topology.owners(simplices))
        codes, nodes, first = _elements(stars, rows)
        vertices = distinct(nodes)
        ghosts = vertices[owner[vertices] != rank]
        vertices = np.concatenate([own, ghosts])
        number[vertices] = np.arange(len(vertices), dtype=np.int32)
        yield Part(
            vertices, len(own), points[vertices], movable[vertices], codes, number[nodes], owner[first] == rank,
            np.zeros(len(rows), dtype=bool) if hopeless is None else hopeless[rows],
            owner[ghosts], colour[ghosts // kernels.BLOCK_SIZE], colour[blocks], reach,
            None if reference is None else reference[vertices],
            None if mesh.freedom is None else mesh.freedom.part(vertices, len(own)),
        )  # fmt: skip


def _stars_of(stars: kernels.Connectivity, blocks: NDArray[np.intp]) -> tuple[Numbers, Numbers]:
    """Return the vertices of some blocks and the simplices of their stars, both ascending."""
    begins = blocks * kernels.BLOCK_SIZE
    ends = np.minimum(begins + kernels.BLOCK_SIZE, len(stars.vertices))
    ranges = list(zip(begins.tolist(), ends.tolist(), strict=True))
    own = [np.arange(begin, end, dtype=np.int32) for begin, end in ranges]
    corners = [stars.corners[stars.offsets[begin] : stars.offsets[end]] for begin, end in ranges]
    none = [np.empty(0, dtype=np.int32)]
    return np.concatenate(own or none), np.unique(np.concatenate(corners or none) // stars.simplices.shape[1])


def _elements(stars: kernels.Connectivity, rows: Numbers) -> tuple[NDArray[np.uint8] | None, Numbers, Numbers]:
    """Return the types and the vertices of some elements, see `Part`, and the first vertex of each."""
    elements = Judged(stars)
    nodes = elements.vertices(rows)
    if elements.simplicial:
        return None, nodes, nodes[:, 0]
    return stars.codes[rows], nodes, stars.nodes[stars.node_offsets[rows]]


def partition(stars: kernels.Connectivity, ranks: int) -> Numbers:
    """Return the process of each block, by METIS: as many corners each, and few edges between processes."""
    blocks = -(-len(stars.vertices) // kernels.BLOCK_SIZE)
    if ranks == 1 or ranks >= blocks:
        return np.arange(blocks, dtype=np.int32) % ranks
    import pymetis

    begin = np.repeat(np.arange(len(stars.vertices), dtype=np.int32), np.diff(stars.neighbour_offsets))
    pairs = begin // kernels.BLOCK_SIZE * np.int64(blocks) + stars.neighbours // kernels.BLOCK_SIZE
    pairs, edges = np.unique(pairs[pairs // blocks != pairs % blocks], return_counts=True)
    offsets = np.concatenate([[0], np.cumsum(np.bincount(pairs // blocks, minlength=blocks))])
    ends = np.minimum(np.arange(1, blocks + 1) * kernels.BLOCK_SIZE, len(stars.vertices))
    work = np.diff(stars.offsets[np.concatenate([[0], ends])])
    _, found = pymetis.part_graph(
        ranks, pymetis.CSRAdjacency(offsets, pairs % blocks), vweights=work, eweights=edges, contiguous=False
    )
    return np.asarray(found, dtype=np.int32)


@dataclass(frozen=True, eq=False)
class _Halo:
    """What goes over the rims after one colour: for each other process the vertices that it is sent, or sends."""

    sent: dict[int, Numbers]
    received: dict[int, Numbers]
    interface: Numbers  # blocks with a vertex that is sent
    inner: Numbers


class _Travelling(NamedTuple):
    """Rows of values on their way, with the vertices that those to come belong to."""

    arriving: list[tuple[Numbers, NDArray[Any], Request]]
    leaving: list[tuple[NDArray[Any], Request]]

    def received(self) -> Iterator[tuple[Numbers, NDArray[Any]]]:
        """Wait for them, and for those that leave."""
        for vertices, buffer, request in self.arriving:
            request.Wait()
            yield vertices, buffer
        for _, request in self.leaving:
            request.Wait()


class Ranks:
    """The processes of a communicator; see `team.Team`."""

    def __init__(self, comm: Intracomm, part: Part, whole: Mesh | None, threads: int) -> None:
        self.comm, self.part = comm, part
        self.whole = None if whole is None else whole.topology.stars(threads)
        self.freedom = None if whole is None else whole.freedom
        self.messages, self.bytes = 0, 0
        topology = part.topology(threads)
        self.mesh = Mesh(part.points, topology, part.movable, freedom=part.freedom)
        self.stars = topology.stars(threads)
        self.own_vertices = np.arange(len(part.vertices)) < part.own
        self.own_elements = part.own_elements
        self.halos = self._halos()
        self.numbers = comm.gather(part.vertices, ROOT) or []  # in the root

    def total(self, count: int) -> int:
        """Return the sum of a number over all processes."""
        from mpi4py import MPI

        return int(self._reduced(np.array([count], dtype=np.int64), MPI.SUM))

    def least(self, value: float) -> float:
        """Return the smallest of a value over all processes."""
        from mpi4py import MPI

        return float(self._reduced(np.array([value]), MPI.MIN))

    def ranked(self, values: Array, percent: float) -> float:
        """Return the value of a rank among all: by bisection of the bits, which sort as positive numbers do."""
        bits = np.sort((values + 0.0).view(np.int64))
        rank = rank_of(self.total(len(values)), percent)
        low, high = 0, int(np.array([np.inf]).view(np.int64)[0])
        while low < high:
            middle = (low + high) // 2
            if self.total(int(np.searchsorted(bits, middle, side="right"))) > rank:
                high = middle
            else:
                low = middle + 1
        return float(np.array([low]).view(np.float64)[0])

    def shared(self, mask: Mask) -> Mask:
        """Return a mask (n,) with what the owners of the ghosts say of them."""
        result = mask.copy()
        for halo in self.halos:
            for vertices, values in self._send(halo, mask.view(np.uint8)[:, None]).received():
                result[vertices] = values[:, 0] != 0
        return result

    def grown(self, mask: Mask, rings: int) -> Mask:
        """Return the mask and the rings around it, of which the others tell where they lead back into this part."""
        for _ in range(rings):
            mask = self.shared(self.stars.grown(mask, 1).view(bool))
        return mask

    def sweep(self, points: Array, states: NDArray[np.uint8]) -> Iterator[Numbers]:
        """Yield the blocks of each colour: first those at the rims, whose vertices travel while the others move."""
        for halo in self.halos:
            yield halo.interface
            travelling = self._send(halo, points)
            yield halo.inner
            for vertices, positions in travelling.received():
                kernels.receive(points, states, self.stars, vertices, positions)

    def of_whole(self, compute: Callable[..., Iterator[Array]], *values: NDArray[Any]) -> Iterator[Array]:
        """Yield points (n, d) that the root computes of the whole mesh."""
        whole = [self.gathered(each) for each in values]
        run = compute(self.whole, *whole) if self.whole is not None else None
        while True:
            points = None if run is None else next(run, None)
            if not self.comm.bcast(points is not None, ROOT):
                return
            pieces = None if points is None else [points[numbers] for numbers in self.numbers]
            yield self.comm.scatter(pieces, ROOT)

    def gathered(self, values: NDArray[Any]) -> NDArray[Any] | None:
        """Return values (n, ...) of the vertices as those of the whole mesh, in the root; None in the others."""
        pieces = self.comm.gather(values[: self.part.own], ROOT)
        if pieces is None:
            return None
        result = np.empty((sum(map(len, pieces)), *values.shape[1:]), dtype=values.dtype)
        for numbers, piece in zip(self.numbers, pieces, strict=True):
            result[numbers[: len(piece)]] = piece
        return result

    def record(self) -> RankRecord:
        """Return what this process held and sent."""
        own = self.part.own
        ghosts, elements = len(self.part.vertices) - own, len(self.part.own_elements)
        return RankRecord(own, ghosts, elements, peak_memory(), self.messages, self.bytes / 1e6)

    def _reduced(self, value: NDArray[Any], operation: Any) -> Any:
        from mpi4py import MPI

        self.comm.Allreduce(MPI.IN_PLACE, value, operation)
        return value[0]

    def _halos(self) -> list[_Halo]:
        """Find out who needs what: each process asks the owners of its ghosts, which know their colours."""
        part, size = self.part, self.comm.size
        colours = self.comm.allreduce(int(part.block_colours.max(initial=-1)), op=max) + 1
        asked = self.comm.alltoall([part.vertices[part.own :][part.owners == rank] for rank in range(size)])
        ours = [np.searchsorted(part.vertices[: part.own], numbers).astype(np.int32) for numbers in asked]
        sent = [_by_colour(rows, part.block_colours[rows // kernels.BLOCK_SIZE], colours) for rows in ours]
        theirs = [np.flatnonzero(part.owners == rank).astype(np.int32) for rank in range(size)]
        received = [_by_colour(part.own + rows, part.colours[rows], colours) for rows in theirs]
        blocks = _by_colour(np.arange(len(part.block_colours), dtype=np.int32), part.block_colours, colours)
        at_rim = np.zeros((colours, len(part.block_colours)), dtype=bool)
        for lists in sent:
            for colour, rows in enumerate(lists):
                at_rim[colour, rows // kernels.BLOCK_SIZE] = True
        return [
            _Halo(
                {rank: lists[colour] for rank, lists in enumerate(sent) if len(lists[colour])},
                {rank: lists[colour] for rank, lists in enumerate(received) if len(lists[colour])},
                here[at_rim[colour, here]],
                here[~at_rim[colour, here]],
            )
            for colour, here in enumerate(blocks)
        ]

    def _send(self, halo: _Halo, values: NDArray[Any]) -> _Travelling:
        """Start the exchange of rows of values."""
        arriving, leaving = [], []
        for rank, vertices in halo.received.items():
            buffer = np.empty((len(vertices), values.shape[1]), dtype=values.dtype)
            arriving.append((vertices, buffer, self.comm.Irecv(buffer, rank)))
        for rank, vertices in halo.sent.items():
            buffer = values[vertices]
            leaving.append((buffer, self.comm.Isend(buffer, rank)))
            self.messages += 1
            self.bytes += buffer.nbytes
        return _Travelling(arriving, leaving)


def _by_colour(rows: Numbers, colours: Numbers, count: int) -> list[Numbers]:
    """Return the rows of each colour, in their order."""
    order = np.argsort(colours, kind="stable")
    return np.split(rows[order], np.searchsorted(colours[order], np.arange(1, count)))


def peak_memory() -> float | None:
    """Return the most memory that this process ever had, in 10^6 bytes; None: the system does not tell."""
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6
