"""The strategies of section 4 and the smoothing of section 3.3 as data: phases, and the moves of their sweeps.

Light to import: the command line reads `STRATEGIES` for its help.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final, Literal

SWEEPS = 40  # section 4: the untangling stops after 40 sweeps
SMOOTH: Final = "auto"  # the smoothing where none is asked for
PASSES = 3  # section 4: three passes of smoothing
MOST_PASSES = 1_000_000
THRESHOLD = {2: 30.0, 3: 15.0}  # section 3.3, degrees, for plane and solid meshes
SMOOTHING = "smoothing"
BACK_TO_SHAPE = "back to the shape"
FEATURE_ANGLE, MAX_DEVIATION = 40.0, 0.03  # degrees, and mean edge lengths: see `curved.Smooth`
ROUNDS = 8  # of "best", at most, after the first
TURNS, RATIO_SWEEPS, MEANS = 6, 6, 4  # of "best" where elements are not all simplices
MORE_SWEEPS = 100  # at most, where the passes leave angles below the threshold
# From where to where the numbers of options go, of the command line and of Python; None: there is no end.
RANGES: dict[str, tuple[int, int | None]] = {
    "sweeps": (0, None),
    "smooth": (0, MOST_PASSES),
    "threshold": (0, 90),
    "feature_angle": (0, 180),
    "percent": (0, 100),
    "seed": (0, None),
    "threads": (1, 1024),
}
RINGS = (4,)  # around inverted elements in which the work begins
REGIONS = (0, 2, 4, 8, None)  # rings around inverted elements that sweeps take in, where only those may move


class Move(IntEnum):
    """Codes of the vertex moves in kernels/moves/relocate.hpp."""

    LAPLACIAN = 0
    UNTANGLE = 1
    COMBINED_UNTANGLE = 2
    SMART_LAPLACIAN = 3
    COMBINED_SMOOTH = 4
    UNTANGLE_HEIGHTS = 5
    MEAN_RATIO = 6
    RAISE_SMALLEST = 7
    COME_BACK = 8
    UNTANGLE_COEFFICIENTS = 9
    DRAW_BACK = 10
    UNTANGLE_MOST = 11


Smooth = int | Literal["auto", "best"]


@dataclass(frozen=True)
class Phase:
    """Sweeps of vertex moves, or minimisations of the foldover-free energy.

    Attributes
    ----------
    name : str
        As shown in the report.
    moves : tuple of Move
        Those of the sweeps, in turn. None: the phase minimises the energy of `foldover.py`.
    max_sweeps : int or None
        None: the limit of all untangling sweeps, `SWEEPS` where there is none.
    until : {"valid", "stalled", "settled", "threshold", "goal", "ceiling"}
        When to stop early. "valid": no element that can be mended is inverted; "stalled": as well, or for
        `untangle.PATIENCE` turns through the moves neither were there fewer inverted elements nor was the smallest
        measure larger;
        "settled": no vertex moved, which stops every phase; "goal": no angle is below it, or nothing gets better any
        more; "threshold": as well, and at once where no angle is below that and the tangle was not a hard one;
        "ceiling": the smallest sine is that of the simplices without a free vertex, or does not rise any more. The last
        four are phases of smoothing.
    only_invalid : bool
        LP moves visit only stars with an inverted element and those whose neighbours moved in the sweep before.
    from_best : bool
        Start from the best mesh met so far, that of the input included, not from the last.
    rings : tuple of (int or None)
        The regions, so many rings around the inverted elements; None: the whole mesh. Those of the energy are tried one
        after the other; sweeps have one, and leave a mesh alone of which that is more than half. Smoothing that has
        one keeps to what untangling has moved, and to what is below the threshold.
    embeds : bool
        One sweep that puts all vertices of the region at the means of their neighbours at once. It is another start,
        for meshes that Laplacian sweeps did not mend; the next phase from the best mesh takes the better one.
    shapes : {"first", "lost", "risen", "even", "sharp", "mean", "few"}, optional
        One minimisation of the shape of all elements at once, from a valid mesh. "lost": from where the last one began,
        if the smallest angle is smaller than there, with that held; "risen": if it has risen since the last one began;
        "even": where the phase before had something to do or untangling took another start, from where the
        foldover-free energy makes the sizes even, if that is better; "sharp": elements are judged by
        their worst corners, and the smallest quality is held; "mean": as well, from the best of the meshes that were
        compared, and nothing else counts; "few": from there, the few that are little better than the worst, alone.
    to_reference : str
        Of phases without moves, the function of `towards.py` that gives the points after each sweep. Smoothing that
        has one takes the place of the other, where there is a reference or layers were followed.
    layers : bool
        The function is that of `layers.py`, which makes up a reference.
    elements : bool or None
        For meshes of other elements than simplices alone; False: of simplices alone; None: of any.
    slides : bool, "curved" or None
        False: vertices of the boundary stay, whether or not they may slide: a boundary that is not tangled loses by it.
        True: for meshes in which some may; "curved": on surfaces or along curves, and the energy moves these as well,
        by `on_surfaces.py`; None: for any, and they do.
    compares : bool
        Where elements are not all simplices, the last mesh is the best one of those after such phases, of which no
        figure is below those after the first.
    patience : int
        It is left out where so many turns, of two phases that compare each, have gained little; 0: it never is.
    """

    name: str
    moves: tuple[Move, ...] = ()
    max_sweeps: int | None = None
    until: Literal["valid", "stalled", "settled", "threshold", "goal", "ceiling"] = "valid"
    only_invalid: bool = False
    from_best: bool = False
    rings: tuple[int | None, ...] = ()
    embeds: bool = False
    shapes: Literal["first", "lost", "risen", "even", "sharp", "mean", "few"] | None = None
    to_reference: Literal["", "follow", "mend", "approach"] = ""
    layers: bool = False
    elements: bool | None = None
    slides: bool | Literal["curved"] | None = None
    compares: bool = False
    patience: int = 0

    @property
    def smooths(self) -> bool:
        """Whether it is a phase of smoothing."""
        return self.until in ("settled", "threshold", "goal", "ceiling")


_LAPLACIAN = Phase("Laplacian", (Move.LAPLACIAN,))
_LP = Phase("LP", (Move.UNTANGLE,))
_LP_CYCLES = (*(Move.UNTANGLE_HEIGHTS,) * 3, Move.SMART_LAPLACIAN)
_STALLING = replace(_LAPLACIAN, max_sweeps=SWEEPS, until="stalled")
_LP_INVALID = Phase("LP on invalid stars", _LP_CYCLES, 300, "stalled", only_invalid=True, from_best=True)
_LP_COEFFICIENTS = Phase(
    "LP on coefficients", (Move.UNTANGLE_COEFFICIENTS,), SWEEPS, until="stalled", only_invalid=True, from_best=True,
    elements=True,
)  # fmt: skip
_LP_MOST = Phase(
    "LP on most of a star", (Move.UNTANGLE_MOST,), SWEEPS, until="stalled", only_invalid=True, from_best=True,
)  # fmt: skip
_EMBEDDING = Phase("embedding", max_sweeps=1, embeds=True)
_BACK = Phase("back to the input", (Move.COME_BACK,), 100, until="settled", from_best=True)
_TO_SHAPE = Phase(BACK_TO_SHAPE, (Move.DRAW_BACK,), 100, until="settled", from_best=True, slides="curved")
_FOLDOVER = Phase("FF", max_sweeps=200, from_best=True, rings=(None,))
_ON_SURFACES = replace(_FOLDOVER, name="FF on surfaces", max_sweeps=40, rings=(1, 2, 4, 8), slides="curved")


def _starts(rings: tuple[int, ...] = (), slides: bool = False) -> tuple[Phase, ...]:
    """Give the phases of both starts, Laplacian sweeps and the embedding, in a region."""
    again = tuple(replace(phase, from_best=False) for phase in (_LP_INVALID, _LP_COEFFICIENTS))
    starts = tuple(replace(phase, slides=slides) for phase in (_STALLING, _EMBEDDING))
    phases = (starts[0], _LP_INVALID, _LP_COEFFICIENTS, starts[1], *again)
    if slides:
        first, *others = (replace(phase, slides=True) for phase in phases)
        phases = (replace(first, from_best=True), *others)
    where = " near inverted elements" * bool(rings) + ", sliding" * slides
    return tuple(replace(phase, name=phase.name + where, rings=rings) for phase in phases)


STRATEGIES: dict[str, tuple[Phase, ...]] = {
    "auto": (
        *_starts(RINGS),
        *_starts(),
        *_starts(slides=True),
        replace(_FOLDOVER, name="FF in regions", max_sweeps=400, rings=(2, 4, 8, 16)),
        _FOLDOVER,
        _LP_COEFFICIENTS,
        _ON_SURFACES,
        *(replace(one, name=f"{one.name}, on surfaces", slides="curved") for one in (_LP_INVALID, _LP_COEFFICIENTS)),
        _LP_MOST,
    ),
    "LS": (_LAPLACIAN,),
    "US": (_LP, _LP_COEFFICIENTS),
    "CS": (Phase("Laplacian or LP", (Move.COMBINED_UNTANGLE,)), _LP_COEFFICIENTS),
    "LUS": (replace(_LAPLACIAN, max_sweeps=3), _LP, _LP_COEFFICIENTS),
    "FF": (_FOLDOVER, _ON_SURFACES, _LP_COEFFICIENTS),
}

# Where there is a reference: elements should have the shapes that they had; the strategy only mends what is left.
_FOLLOW = Phase("following the boundary", max_sweeps=1, to_reference="follow")
_TO_REFERENCE = Phase("FF towards the reference", max_sweeps=100, to_reference="mend")
_APPROACH = Phase(f"{SMOOTHING} towards the reference", until="settled", from_best=True, to_reference="approach")
_LAYERS = Phase("layers following the wall", max_sweeps=1, to_reference="follow", layers=True)
_LAYERS_SMOOTHED = Phase(f"{SMOOTHING} the layers", until="settled", to_reference="approach", layers=True)

# After three passes, where they do not suffice.
_MORE = Phase(
    f"{SMOOTHING} the rest", (*(Move.MEAN_RATIO,) * 2, *(Move.COMBINED_SMOOTH,) * 2), MORE_SWEEPS,
    until="threshold", rings=RINGS,
)  # fmt: skip

# After the passes at the threshold: all elements at once, then the few that are below the ceiling. Once more, with the
# smallest angle held, where that was lost; and again as long as it rises.
_SHAPE = Phase(f"{SMOOTHING} all at once", max_sweeps=1, until="settled", shapes="first")
_RAISE = Phase(f"{SMOOTHING} the worst", (Move.RAISE_SMALLEST,), MOST_PASSES, until="ceiling")
_HELD = replace(_SHAPE, name=f"{SMOOTHING} all at once, the worst held", shapes="lost")
_BEST = (_SHAPE, _RAISE, _HELD, _RAISE, *(replace(_HELD, shapes="risen"), _RAISE) * ROUNDS)

# Where elements are not all simplices: their energy has many valleys, out of which sweeps for the mean ratios lead.
_EVEN = Phase(f"{SMOOTHING} to even sizes", max_sweeps=1, until="settled", shapes="even", elements=True)
_RATIOS = Phase(
    f"{SMOOTHING} by mean ratios", (Move.MEAN_RATIO,), RATIO_SWEEPS, until="settled", elements=True, compares=True
)
_SHARP = replace(_SHAPE, compares=True, elements=True, shapes="sharp")
_FEW = replace(_SHARP, name=f"{SMOOTHING} the few worst", shapes="few")
_MEAN = replace(_SHARP, name=f"{SMOOTHING} for the mean", shapes="mean")


def _turns() -> Iterator[Phase]:
    """Give the phases of both kinds of turns: a first one that gained little is the last, or two of the first kind."""
    yield _RATIOS
    for turn in range(TURNS):
        yield from (replace(_SHARP, patience=min(turn, 2)), _RATIOS)
    for turn in range(MEANS):
        yield from (replace(phase, patience=min(turn, 1)) for phase in (_FEW, _MEAN))


def senseless_beside_reference(only_invalid: bool, threshold: float | None) -> tuple[str, ...]:
    """Return the names of options that are given and mean nothing where elements get the shapes of a reference."""
    given = {"only_invalid": only_invalid, "threshold": threshold is not None}
    return tuple(name for name, is_given in given.items() if is_given)


def plan(
    strategy: str, smooth: Smooth = SMOOTH, only_invalid: bool = False, to_reference: bool = False
) -> tuple[Phase, ...]:
    """Return the phases of a strategy and those of smoothing.

    With `only_invalid` the region of sweeps that stall grows; where nothing is smoothed, vertices that went farther
    than validity takes come back.

    Parameters
    ----------
    strategy : str
    smooth : int, "auto" or "best"
        So many passes; "auto": `PASSES`, and more where they leave angles below the threshold; "best": what can be had.
    only_invalid : bool
        See `untangle.steps`.
    to_reference : bool
        Elements should have the shapes of a reference. A pass of smoothing is a minimisation then.

    Raises
    ------
    ValueError
        There is no such strategy, or no such smoothing; or with a reference only invalid elements should move.
    """
    if only_invalid and to_reference:
        raise ValueError("with a reference all elements get their shapes back, not only those that are invalid")
    if smooth not in ("auto", "best") and not (isinstance(smooth, int) and 0 <= smooth <= MOST_PASSES):
        raise ValueError(f'smooth is {smooth!r}, and must be a number of passes, "auto" or "best"')
    if strategy not in STRATEGIES:
        raise ValueError(f"strategy is {strategy!r}, and must be one of {', '.join(STRATEGIES)}")
    untangling = STRATEGIES[strategy]
    if only_invalid:
        untangling = tuple(region for phase in untangling for region in _in_regions(phase))
    most = smooth if isinstance(smooth, int) else PASSES if smooth == "auto" else MORE_SWEEPS
    if to_reference:
        return (_FOLLOW, _TO_REFERENCE, _LP_COEFFICIENTS, *untangling, _TO_SHAPE, replace(_APPROACH, max_sweeps=most))
    if strategy == "auto" and not only_invalid:
        untangling = (_LAYERS, *untangling, replace(_LAYERS_SMOOTHED, max_sweeps=most))
    untangling = (*untangling, _TO_SHAPE)
    passes = Phase(SMOOTHING, (Move.COMBINED_SMOOTH,), PASSES, until="settled", from_best=True)
    if only_invalid and smooth == 0:
        return (*untangling, _BACK)
    more = () if only_invalid else (replace(_SHAPE, rings=RINGS, elements=True), _MORE, _EVEN)
    if smooth == "best":
        default = tuple(replace(phase, elements=True) for phase in (replace(passes, rings=RINGS), *more))
        first = (*default[:-1], replace(default[-1], compares=True))
        simplicial = replace(passes, elements=False), replace(_MORE, until="goal", elements=False)
        return (*untangling, *first, *simplicial, *_BEST, *_turns())
    if smooth == "auto":
        return (*untangling, replace(passes, rings=RINGS), *more)
    return (*untangling, replace(passes, max_sweeps=smooth))


def _in_regions(phase: Phase) -> Iterator[Phase]:
    """Give a phase of sweeps that may stall once for each region, and no other start."""
    if phase.embeds or (phase.moves and phase.rings) or (phase.only_invalid and not phase.from_best):
        return
    if not (phase.moves and phase.only_invalid):
        yield phase
        return
    for rings in REGIONS:
        name = phase.name if rings == 0 else f"{phase.name} and {'all' if rings is None else rings} rings"
        yield replace(phase, name=name, rings=(rings,))
