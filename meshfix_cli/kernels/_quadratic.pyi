"""Types of what the kernels know of curved elements."""

from collections.abc import Sequence

from meshfix_cli.kernels import Float64, Int32, Uint8

# For each type of `mesh.quadratic.SECOND_ORDER` its dimension, the corners whose mean each node is in the straight
# element, and the weight of scaled Jacobians.
QUADRATIC_SHAPES: list[tuple[int, list[list[int]], float]]
QUADRATIC_PROVED: int

class QuadraticType:
    """A type of more than second order."""

    def __init__(self, factors: Sequence[int], order: int, places: Float64, weight: float) -> None:
        """Take the simplices whose product it is, and the barycentric coordinates (nodes, c) of its nodes in these.

        The corners are the first of them; `weight` is that of scaled Jacobians. ValueError: there is no room for it.
        """

class QuadraticMesh:
    """Elements of second and higher order; see quadratic/mesh.hpp."""

    def __init__(self, codes: Uint8, nodes: Int32, n: int, types: Sequence[QuadraticType] = ()) -> None:
        """Take the types (m,), the nodes, one element behind the other, and the number of points.

        Types that are not of second order are numbered behind these.
        """
    def coefficients(self, points: Float64) -> Float64:
        """Bezier coefficients of det J of the first element."""
    def columns(self, points: Float64, shares: Float64) -> Float64:
        """Gradients (k, d) of these by x, where each node moves by its share of x; they are affine in it."""
    def judge(
        self, points: Float64, threads: int, elements: Int32 | None = None
    ) -> tuple[Uint8, Float64, Float64, Float64]:
        """Verdicts, smallest relative coefficients, measures and scaled Jacobians of all elements or some of them."""
    def ceilings(self, points: Float64, free: Uint8, threads: int) -> Float64:
        """The smallest scaled Jacobian (m,) at nodes where it depends on no free node; infinite where none is so."""
    def sizes(self, points: Float64, threads: int) -> Float64:
        """det J (m,) of the straight elements, in the mean, which coefficients are compared with."""
    def smallest(self, points: Float64, sizes: Float64, free: Uint8, of_free: bool, threads: int) -> Float64:
        """The smallest coefficient (m,) relative to sizes, of those that depend on a free node, or of the others."""
    def relocate(
        self,
        points: Float64,
        sizes: Float64,
        free: Uint8,
        nodes: Int32,
        start: Float64,
        reach: float,
        goal: float,
        tied: bool,
        halvings: int = 0,
    ) -> tuple[Float64, int]:
        """One sweep of the linear programme over nodes (k,): the points (n, d) after it, and how many nodes moved.

        It visits those that have a coefficient below the goal; `tied`: nodes between go along with them. Elements with
        such a coefficient are halved so many times, and the coefficients are those of the parts.
        """
    def impossible(self, points: Float64, free: Uint8) -> Uint8:
        """Mark elements (m,) that cannot be valid while fixed nodes stay: 1 by themselves, 2 together with others.

        Only proofs that a node of an element is part of that is not valid now are found, see quadratic/proofs.hpp.
        """

class QuadraticEnergy:
    """Minimises the energy of quadratic/energy.hpp over the free nodes, for one goal after the other."""

    def __init__(
        self,
        mesh: QuadraticMesh,
        points: Float64,
        rest: Float64,
        sizes: Float64,
        free: Uint8,
        start: Float64,
        reach: float,
        threads: int,
    ) -> None:
        """Take positions (n, d), those whose corners make the straight elements at rest, and det J of these (m,)."""
    def minimise(
        self, eps: float, floor: float, iterations: int, kept: float | None = None
    ) -> tuple[float, float, float]:
        """Go on from where the last one ended, until all coefficients are above the floor.

        With `kept` that is the floor of the scaled Jacobians at nodes, and this one that of the coefficients. Returns
        the energy before and after, and the smallest of what the floor is of, coefficients relative to the sizes.
        """
    def evaluate(
        self, variables: Float64, eps: float, floor: float, kept: float | None = None
    ) -> tuple[float, Float64]:
        """Return the value and its gradient at steps of the free nodes, each in its own unit."""
    def points(self, dimension: int) -> Float64:
        """Return the points (n, d)."""
