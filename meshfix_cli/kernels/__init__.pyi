"""The compiled kernels; arrays are C-contiguous and of exactly these types (nothing is converted)."""

from typing import overload

import numpy as np
from numpy.typing import NDArray

from meshfix_cli.kernels._obstacles import crossings as crossings
from meshfix_cli.kernels._obstacles import crossings_and_folds as crossings_and_folds
from meshfix_cli.kernels._obstacles import enclosing as enclosing
from meshfix_cli.kernels._obstacles import exclusive as exclusive
from meshfix_cli.kernels._quadratic import QUADRATIC_PROVED as QUADRATIC_PROVED
from meshfix_cli.kernels._quadratic import QUADRATIC_SHAPES as QUADRATIC_SHAPES
from meshfix_cli.kernels._quadratic import QuadraticEnergy as QuadraticEnergy
from meshfix_cli.kernels._quadratic import QuadraticMesh as QuadraticMesh
from meshfix_cli.kernels._quadratic import QuadraticType as QuadraticType
from meshfix_cli.kernels._surface import Reference as Reference
from meshfix_cli.kernels._surface import Sample as Sample
from meshfix_cli.kernels._surface import area_vectors as area_vectors
from meshfix_cli.kernels._surface import around_pieces as around_pieces
from meshfix_cli.kernels._surface import check_unfolded as check_unfolded
from meshfix_cli.kernels._surface import counted_order as counted_order
from meshfix_cli.kernels._surface import dots_between as dots_between
from meshfix_cli.kernels._surface import edge_lengths as edge_lengths
from meshfix_cli.kernels._surface import fan_normals as fan_normals
from meshfix_cli.kernels._surface import joints as joints
from meshfix_cli.kernels._surface import normals_around as normals_around
from meshfix_cli.kernels._surface import off_reference as off_reference
from meshfix_cli.kernels._surface import pairs_from as pairs_from
from meshfix_cli.kernels._surface import relocate_on_surface as relocate_on_surface
from meshfix_cli.kernels._surface import rows_of_pairs as rows_of_pairs
from meshfix_cli.kernels._surface import sines_between as sines_between
from meshfix_cli.kernels._surface import summed as summed
from meshfix_cli.kernels._surface import unfold as unfold
from meshfix_cli.kernels._surface import unit_vectors as unit_vectors

Int8 = NDArray[np.int8]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Integers = Int32 | Int64
Float64 = NDArray[np.float64]
Uint8 = NDArray[np.uint8]

BUILD: str  # what processors these are for
DONE: int
DUE: int
SHAPES: list[
    tuple[int, int, list[list[int]], list[list[int]], list[int], float]
]  # by code: dimension, number of nodes, corner simplices, facets, order of the mirrored, weight
BLOCK_SIZE: int  # block b holds the vertices from b * BLOCK_SIZE on

class Connectivity:
    """A mesh in the order of the kernels; the arrays are described in mesh/order.hpp, facets, elements and stars.hpp.

    All of them are views; faces and what follows it are empty until the stars are built. Elements that are not all
    simplices of one type are given by their codes (m,), in the order of `elements.JUDGED`, and their nodes, one element
    behind the other; they have corner simplices once they are taken apart.
    """

    @overload
    def __init__(self, points: Float64, simplices: Int32, used: Int32, threads: int) -> None: ...
    @overload
    def __init__(self, points: Float64, codes: Uint8, nodes: Int32, used: Int32, threads: int) -> None: ...
    def take_apart(self, flipped: NDArray[np.bool_], threads: int) -> None:
        """Give some elements (m,) the other orientation, and make the corner simplices of all."""
    @overload
    @staticmethod
    def part(simplices: Int32, n: int, threads: int) -> Connectivity: ...
    @overload
    @staticmethod
    def part(codes: Uint8, nodes: Int32, n: int, dimension: int, threads: int) -> Connectivity:
        """A part of a mesh that has an order already: n vertices and simplices or elements that stay as they are.

        Of what the facets tell, it has nothing.
        """

    def flip(self, flipped: NDArray[np.bool_], threads: int) -> None:
        """Give some simplices (m,) the other orientation."""

    def signed_sizes(self, points: Float64) -> Float64:
        """Return d! times the size of each component as its boundary tells, numbered as `against` tells."""

    def build_stars(self, threads: int) -> None:
        """Do it, where it is not done; ValueError where a star or the mesh is too large to be numbered."""

    def grown(self, mask: NDArray[np.bool_], rings: int) -> NDArray[np.uint8]:
        """Mark these vertices (n,) and rings of neighbours; needs the stars."""

    def stuck(self, movable: NDArray[np.bool_], threads: int) -> Int32:
        """Elements without a movable vertex."""

    def boundary(self) -> NDArray[np.uint8]:
        """1 for the vertices (k,) of facets that belong to one element."""

    def edges(self, table: Int8, threads: int) -> tuple[Int32, Int32]:
        """Offsets (n+1,) and larger ends (e,) of the edges, which are at their smaller ends; ascending.

        The table has a row for each edge of a type, (code, group of parallel edges, node, node), those of a group
        together. All of this is of elements that are not all simplices.
        """

    def rows_of_edges(self, table: Int8, edges: tuple[Int32, Int32]) -> Int32:
        """Return the row (e,) of each edge: those that are parallel in the ideal element are of one."""

    def fixed_facets(
        self, movable: NDArray[np.bool_], threads: int, other_diagonal: bool = False
    ) -> tuple[Int32, Int32, Uint8]:
        """Facets (f, d) without a movable vertex, each once, an element of each, and 1 where two share it.

        They are oriented: the elements are all on the same side of them. Quadrilaterals are two triangles, by one or
        the other diagonal.
        """

    @property
    def simplicial(self) -> bool:
        """Whether all elements are simplices of one type; what follows, up to `owners`, is empty then.

        A part of a mesh of others may have no elements.
        """

    @property
    def codes(self) -> Uint8: ...
    @property
    def node_offsets(self) -> Int32: ...
    @property
    def nodes(self) -> Int32: ...
    @property
    def facet_offsets(self) -> Int32: ...
    @property
    def facet_owners(self) -> Int32: ...
    @property
    def facet_mates(self) -> Int32: ...
    @property
    def simplex_offsets(self) -> Int32: ...
    @property
    def owners(self) -> Int32: ...
    @property
    def crowded(self) -> int:
        """A corner whose facet is shared by too many simplices, then there is no more; or -1."""

    @property
    def orientable(self) -> bool: ...
    @property
    def vertices(self) -> Int32: ...
    @property
    def rows(self) -> Int32: ...
    @property
    def simplices(self) -> Int32: ...
    @property
    def mates(self) -> Int32: ...
    @property
    def component(self) -> Int32: ...
    @property
    def against(self) -> NDArray[np.uint8]: ...
    @property
    def offsets(self) -> Int32: ...
    @property
    def corners(self) -> Int32: ...
    @property
    def faces(self) -> NDArray[np.uint16]: ...
    @property
    def neighbour_offsets(self) -> Int32: ...
    @property
    def neighbours(self) -> Int32: ...
    @property
    def colour_offsets(self) -> Int32: ...
    @property
    def colour_blocks(self) -> Int32: ...

class Freedom:
    """Where vertices may go, see mesh/freedom.hpp; copies of what it is given."""

    def __init__(
        self, frame: Int32, directions: Uint8, axes: Float64, offsets: Int32, neighbours: Int32,
        reference: Reference | None = None,
    ) -> None:  # fmt: skip
        """Take the frame (n,) of each vertex, -1: it may go anywhere; the directions (f,) and axes (f, d, d) of frames.

        The neighbours of a vertex in its line or plane begin at its offset (n + 1,); both may be empty where only
        gradients are asked for. With a reference, the last frames are its shapes, and have no axes.
        """

    def keep_near(self, offsets: Int32, around: Int32, bound: float) -> None:
        """Take what is around vertices on the reference, see mesh/freedom.hpp, and how far it may be from that."""

def joined(pairs: Int32, n: int) -> Int32:
    """Number things (n,) so that those which pairs (p, 2) join have one number: the smallest of them."""

def check_simplices(simplices: Int32, n: int, threads: int) -> tuple[int, int]:
    """The first row with a number outside 0 .. n-1, and the first that names a vertex twice; -1: none."""

def used_vertices(simplices: Int32, n: int) -> Int32:
    """Return the vertices of simplices, ascending."""

def arcsin(values: Float64) -> Float64:
    """The C library's, which has the same bits on all processors: numpy's has not."""

def arccos(values: Float64) -> Float64:
    """See `arcsin`."""

def sin(values: Float64) -> Float64:
    """See `arcsin`."""

def check(points: Float64, simplices: Int32, threads: int) -> tuple[Int32, float]:
    """Rows of the inverted simplices, and the smallest signed measure."""

def rows(values: Float64, which: Int32) -> Float64:
    """Rows (k, d) of positions (n, d), as numpy's `take` gives them, in a fraction of the time."""

def moved(before: Float64, after: Float64, threads: int) -> NDArray[np.uint8]:
    """1 for the rows (n,) that differ."""

def summarise(
    points: Float64, mesh: Connectivity, bins: int, width: float, threads: int
) -> tuple[Float64, Int64, float, Int32, int, float, float]:
    """Smallest angles (m,), their histogram and sum, inverted simplices, folded facets, smallest measure.

    Last comes the largest angle. Angles are in radians, as is the width of the bins.
    """

def below(points: Float64, simplices: Int32, least: float, threads: int) -> Int32:
    """Return the simplices, ascending, of which the smallest sine^2 is below some value; also those not valid."""

def min_sine2(points: Float64, simplices: Int32, threads: int) -> float:
    """Return the smallest sine^2 of the valid simplices; 1: there are none."""

def measure(points: Float64, simplices: Int32, threads: int) -> tuple[Float64, NDArray[np.uint8]]:
    """Signed measure and validity, each (m,)."""

def judge(points: Float64, codes: Uint8, offsets: Int32, nodes: Int32, threads: int) -> tuple[Uint8, Float64, Float64]:
    """Verdict, signed measure and quality, each (m,), of elements with types (m,) numbered as SHAPES.

    Element e has the vertices nodes[offsets[e] : offsets[e + 1]]. Verdicts: 0 valid, 1 not valid inside, or not proved
    to be so, 2 not valid at a corner. Quality is the smallest sine of a simplex, with the sign of its measure, and the
    smallest scaled Jacobian at the corners of anything else; 0 where an edge has no length.
    """

def coefficients(nodes: Float64, code: int) -> Float64:
    """Bezier coefficients (k,) of det J of one element with nodes (n, d), those at its corner simplices first."""

def coefficient_columns(nodes: Float64, code: int, node: int) -> tuple[Float64, Float64]:
    """Of the coefficients that depend on a node, the values (k,) with it at 0, and the gradients (k, d) by it."""

def angles(points: Float64, simplices: Int32, threads: int) -> tuple[Float64, Float64]:
    """Smallest and largest (dihedral) angle in radians, each (m,)."""

def relocate(
    move: int,
    points: Float64,
    states: NDArray[np.uint8],
    mesh: Connectivity,
    blocks: Int32,
    threshold_sine2: float,
    min_measure: float,
    start: Float64,
    max_move: float,
    threads: int,
    freedom: Freedom | None = None,
) -> tuple[int, int]:
    """Relocate, in place, the vertices that are due, of some blocks of one colour; the numbers visited and moved.

    States (n,): 0 for a vertex that is held, DUE, or DONE when it has been visited and neither it nor a neighbour has
    moved.

    The threshold is that of the active-set method, or the floor of MEAN_RATIO. Smoothing makes no
    measure smaller than `min_measure`, no vertex goes farther than `max_move` from `start`.
    """

def receive(
    points: Float64, states: NDArray[np.uint8], mesh: Connectivity, vertices: Int32, positions: Float64
) -> None:
    """Put vertices (k,) that another process moved at their positions (k, d); what has such a neighbour is due."""

def linear_program(
    neighbours: Float64, faces: NDArray[np.uint16], heights: bool
) -> tuple[int, Float64, Float64, Float64, int]:
    """Status (0 optimal, 1 degenerate, 2 failed), (x, t), dual weights of faces and box sides, axes of the box, pivots.

    heights: t is the smallest height over a face instead of the smallest determinant.
    """

def embedding(
    points: Float64,
    mesh: Connectivity,
    free: NDArray[np.bool_],
    edges: tuple[Int32, Int32],
    weights: Float64,
    threads: int,
    freedom: Freedom | None = None,
) -> Float64:
    """Return the points (n, d) with each free one (n,) at the mean of its neighbours; needs the stars.

    With a freedom, the neighbours are those in its line or plane.

    Where elements are not all simplices, the neighbours are those of `Connectivity.edges`, with weights (e,).
    """

class Foldover:
    """Minimises the foldover-free energy, for one eps after the other; see moves/foldover_problem.hpp."""

    def __init__(
        self,
        points: Float64,
        simplices: Int32,
        targets: Float64,
        centres: Float64,
        radius: float,
        drawn: bool,
        threads: int,
        freedom: Freedom | None = None,
    ) -> None:
        """Take a region's points (n, d), the free ones first; each free one has a ball around its centre (free, d).

        Targets (m,) are the d-th roots of the determinants that the simplices (m, d+1) should have, those (m, d, d) the
        inverses of matrices whose columns are the edges that they should have; all in model units. Where they are
        `drawn`, vertices may be outside the balls, and are drawn in.
        """
    def minimise(
        self, eps: float, weight: float, iterations: int, gain: float, pull: float = 0.0, until_valid: bool = True
    ) -> tuple[float, float]:
        """Go on from where the last one ended, until all is valid and inside, if that is enough.

        Returns the energy before and after.

        It ends as well where an iteration lowers the energy by less than this share of that of the inverted simplices.
        """
    def evaluate(self, variables: Float64, eps: float, weight: float, pull: float) -> tuple[float, Float64]:
        """Return the value, and its gradient, at variables (free, d), which are those of moves/foldover_problem.hpp."""
    def points(self) -> Float64:
        """Return the free points (free, d)."""
    @property
    def min_det(self) -> float:
        """The smallest determinant of J there."""
    @property
    def evaluations(self) -> int:
        """How often the energy was evaluated."""

def foldover_energy(
    simplices: Int32, points: Float64, targets: Float64, eps: float, weight: float, free: int, threads: int
) -> tuple[float, Float64, float]:
    """Energy, its gradient (free, d) by the first `free` points, and the smallest determinant of J; see `Foldover`."""

def shape_energy(
    points: Float64, simplices: Int32, corners: Float64, owners: Int32, hexahedra: Int32, free: int, goal: float,
    floor: float, measure: float, weight: float, sharpness: float, evenness: float, threads: int,
    freedom: Freedom | None = None, angle: float = ...,
) -> tuple[float, Float64]:  # fmt: skip
    """Energy of moves/shape.hpp and its gradient (free, d), in a unit of about an edge.

    Simplices that are corners of elements have their weights in `corners` (m,), others 0; (0,): none is a corner. The
    elements of the simplices are `owners` (m,), one behind the other; (0,) will do where the sharpness is 0. Of each of
    these elements `hexahedra` (e, 8) has the nodes, if its centre counts as one more corner, else -1; (0, 8): of none.
    """

def shaped(
    points: Float64,
    simplices: Int32,
    corners: Float64,
    owners: Int32,
    hexahedra: Int32,
    free: int,
    goal: float,
    floor: float,
    measure: float,
    weight: float,
    sharpness: float,
    evenness: float,
    iterations: int,
    threads: int,
    freedom: Freedom | None = None,
    angle: float = ...,
) -> Float64:
    """Return the first `free` points (free, d) of a valid mesh where so many iterations of L-BFGS end.

    The goal and the floor are angles in degrees, the measure is in model units, `weight` is for what lacks a degree of
    the goal, and `angle` what a degree of a smallest angle is worth.
    """

def min_norm_point(vectors: Float64) -> Float64:
    """Return the point of smallest norm in the convex hull of the rows."""

def sines(neighbours: Float64, faces: NDArray[np.uint16], x: Float64) -> tuple[Float64, Float64, float]:
    """Sines of a star, their gradients, and sign * (smallest sine)^2 (-1 where the star is not valid)."""

def mean_ratio(neighbours: Float64, faces: NDArray[np.uint16], x: Float64) -> tuple[float, float, Float64, Float64]:
    """Sum of the powered inverse mean ratios of a star, the same without derivatives, gradient (d,), Hessian (d, d)."""

def cells_of_faces(
    offsets: Integers, vertices: Integers, owner: Integers, neighbour: Integers, cells: int, threads: int
) -> tuple[Integers, Integers, Int8, Integers]:
    """Cells that are given by their faces, whose vertices have offsets (f + 1,); all integers are of one type.

    Where the faces of each cell begin (cells + 1,), and which they are; by its corners (cells,), 4, 5, 6 or 8, which
    element it is, 0 if none; and its nodes (cells, 4 or 6 or 8) in the order of its type, with what room the largest
    may need.
    """

def find_words(data: bytes, at: int, count: int, brackets: bool = False) -> Int64:
    """Spans (count, 2) of the first words at or behind an offset; fewer where the data end.

    With `brackets` round ones separate words, as blanks do.
    """

def line_words(data: bytes, offsets: Int64, count: int) -> Int64:
    """Spans (k * count, 2) of the first words behind each offset (k,), -1 for those that the line does not have."""

def find_lines(data: bytes, at: int, count: int) -> tuple[Int64, Int64, int]:
    """Words of the first lines behind an offset that have some.

    Spans (k, 2), the number of the first word of each line and of all (lines + 1,), and the offset behind the last.
    """

def read_lines(data: bytes, at: int, count: int) -> tuple[Int64, Int64, int]:
    """Integers of the words of the same lines, and their starts and end.

    A word that is none has a number whose bits are the highest and, from the lowest on, those of its first seven bytes.
    """

def find_cards(data: bytes) -> tuple[Uint8, Int32, Int64, Int64, Int32, Int32]:
    """Cards of Nastran: the different names (k, 8) in capitals and, for each of n cards, what follows.

    Which name it has (n,), its offset (n,), its fields up to the last that is not blank (n,), or -1 where lines that
    follow it continue another card, and the integers in its first two (n, 2) and the next four (n, 4): the smallest
    where a field is blank, the next one where it, or one before it, is something else or larger, or on another line.
    """

def card_integers(data: bytes, offsets: Int64, first: int, last: int, texts: bool) -> tuple[Int64, int]:
    """Integers (k, last - first) in fields of cards at offsets (k,), and where there is none, or -1.

    Blank fields are the smallest integer of 32 bits, and so are, if `texts`, those from a text on.
    """

def card_fields(data: bytes, offsets: Int64, most: int, whole: bool) -> tuple[Int64, Int64, Uint8]:
    """Fields of cards at offsets (k,), at most so many of each; whole: all their columns, and those that are blank.

    Spans (f, 2), -1 for what a line does not reach that another continues; the number of the first field of each card
    and of all (k + 1,); and the columns of each (f,), 0 where it is free.
    """

def use_threads(threads: int) -> None:
    """Let the passes over text, from here to the end of this file, take as many threads: 1 at first."""

def behind_words(data: bytes, at: int, count: int) -> int:
    """Return the offset behind the next words; -1: there are fewer."""

def scan_integers(data: bytes, at: int, count: int, brackets: bool = False) -> tuple[Int32 | Int64, int, int]:
    """Values, in 32 bits where these do, the offset behind them, and the offset of what is not an integer or -1.

    With `brackets` round ones separate words, as blanks do.
    """

def read_integer_lists(data: bytes, at: int, count: int) -> tuple[Integers, Integers, int, bool]:
    """Lists as in `3(0 4 7)`: offsets (lists + 1,), values (k,), the offset behind the last, and whether all are there.

    Both have 32 bits where these do.
    """

def integers(data: bytes, spans: Int64, slash: bool) -> tuple[Int64, int]:
    """Values of the words at spans (n, 2), up to a slash if it may be there, and the row of the first bad one or -1."""

def numbers(data: bytes, spans: Int64, single: bool) -> tuple[Float64, int]:
    """Values of the words at spans (n, 2), and the row of the first that is not a number or -1; single: of float32."""

def read_fields(data: bytes, spans: Int64) -> tuple[Float64, int]:
    """The same of fields: blank ones are 0, and an exponent may have no letter, as in 1.5-3."""

def write_fields(values: Float64, columns: int, padded: bool) -> tuple[bytes, Int64]:
    """Texts of at most so many columns, with a point, joined, and their spans; padded: all columns are filled."""

def shortest(values: Float64, single: bool, longest: int) -> tuple[bytes, Int64]:
    """The shortest texts that read back to the values, joined, and their spans; longest: characters at most, or 0."""

def replace(data: bytes, first: int, last: int, spans: Int64, words: bytes, word_spans: Int64) -> bytes:
    """The data between two offsets, with each span (k, 2), in their order, replaced by a span of `words`."""
