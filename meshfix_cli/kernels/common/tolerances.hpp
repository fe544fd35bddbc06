// Every tolerance of the kernels, dimensionless, in one place.
#pragma once

#include <cstddef>

namespace meshfix {

// A simplex is valid if det > VALID * (product of the edges of the determinant): ten times its rounding error.
constexpr double VALID = 1e-14;

// A Bezier coefficient is positive if it is larger than VALID * (product of the edges), the mean over its determinants.
// Where all are larger than so many times that of the longest edges, so are the corners, from whichever vertex.
constexpr double BEZIER_PLAIN = 2.0;
constexpr int BEZIER_DEPTH = 60;    // halvings of a hexahedron: 20 in each direction, if it is bent in all
constexpr int BEZIER_PARTS = 4096;  // of it that are looked at; what is not decided then is not valid
constexpr int HELD_DEPTH = 8;       // halvings of a piece of a curve or surface on which a vertex has a place, or none
constexpr int QUADRATIC_PARTS = 4096;  // the same of a curved element
constexpr int QUADRATIC_PROVED = 6;    // the highest order of which anything is proved: beyond, rounding has a part in it

// Linear programme. All are relative to the largest number of their kind in the star.
constexpr double LP_DROPPED_FACE2 = 1e-24;  // |n|^2 below which co-located neighbours leave the star
constexpr double LP_PINNED2 = 1e-12;        // of |n|^2, below which a function does not depend on where a vertex slides
constexpr double LP_RANK = 1e-9;            // residual below which the normals do not span R^d
constexpr double LP_PRICING = 1e-13;        // reduced cost that still counts as negative
constexpr double LP_PIVOT = 1e-11;          // pivot element that still counts as positive
constexpr double LP_BOX = 1.0;              // half width of the box that bounds the vertex, in star sizes
constexpr double LP_IMPOSSIBLE = 1e-15;     // of the determinants: no smallest one that is larger is told from zero
constexpr double HELD_IMPOSSIBLE = 1e-14;   // of the star's size: heights up to which a vertex that slides makes nothing valid
constexpr double HELD_FAR = 100.0;          // star sizes: how far it is looked for a place in a line or plane
constexpr double LP_CLEAR = 1e-9;           // smallest height, in star sizes, where what is left of a star counts as mended
constexpr int LP_MOST_LEFT_OUT = 64;        // elements of a star that stay wrong: where these are more, all of it stays
constexpr double LP_PINCHED_SINE2 = 3e-4;     // sine squared, of one degree: below it smoothing tries the programme
constexpr double LP_AXIS2 = 0.1;            // squared length, of the largest, at which a neighbour may set an axis
constexpr int LP_BLAND_AFTER = 20;          // plus one per face: pivots before Bland's rule
constexpr int LP_MAX_PIVOTS = 1000;         // plus ten per face: never reached with Bland's rule but for rounding

// Order: squared distance, of the largest, at which a vertex may set an axis.
constexpr double ORDER_AXIS2 = 0.8;

// Active-set method. Function values are sines; lengths are in star sizes.
constexpr double ACTIVE = 1e-4;           // a sine this close to the smallest is active
constexpr double ACTIVE_MIN_STEP = 1e-6;  // stopping rule 1
constexpr int ACTIVE_MAX_STEPS = 20;      // stopping rule 2
constexpr double ACTIVE_MIN_GAIN = 1e-4;  // stopping rule 3
constexpr double ACTIVE_KKT = 1e-6;       // stopping rule 4: length of the steepest ascent direction
constexpr double ACTIVE_ACCEPT = 0.9;     // share of the predicted gain at which a step is taken

// Smoothing of the mean ratio.
constexpr double SAME_SINE2 = 1e-12;   // by which a smallest sine^2 may differ and count as the same
constexpr double NEWTON_PIVOT = 1e-8;  // of a diagonal element: below it the sum of mean ratios counts as not convex
constexpr int NEWTON_TRIALS = 5;       // steps, each half as long as the one before

// Steps of smoothing, each half as long as the one before, that are tried where an element would not be valid inside.
constexpr int GUARD_TRIALS = 4;

// Weights of the corners of a piece from which on a foot is on it: beside one at a corner or side, rounding must not choose.
constexpr double ON_PIECE = -1e-10;

// The quadric through points that sample a surface: what is added to its normal equations, and from how many points on it
// tells more than these.
constexpr double QUADRIC_RIDGE = 1e-9;
constexpr int QUADRIC_LEAST = 7;
constexpr double QUADRIC_SAME2 = 1e-18;  // squared distance, of the largest, up to which a point is the place itself

// Areas as vectors, of all that is around a vertex: what their sum is less than, of the products of edges, is rounding, as that
// of something closed.
constexpr double AREA_AROUND = 1e-12;

// Of the square of how far facets are from their shapes: what draws a vertex back makes it as much smaller.
constexpr double DRAWN_BACK = 0.9;

// Of the way back: smaller shares are not worth a step, and would have no end.
constexpr double LEAST_SHARE = 0.01;

// Shape of all elements at once: what a mean ratio of one and, by default, a degree are worth, and the gain an element, in the mean,
// below which an iteration is the last; the floor counts so many times the goal.
constexpr double SHAPE_RATIO = 100.0, SHAPE_ANGLE = 0.3, SHAPE_GAIN = 1e-3, SHAPE_FLOOR = 30.0;
constexpr double SHAPE_SHARP_GAIN = 1e-5;  // where elements are judged by their worst corners: many small steps pay
constexpr double SHAPE_MEASURE = 1e5, SHAPE_MARGIN = 0.02;  // of the smallest determinant, which may not get smaller

// Facets cross where every determinant that says so is larger than this, relative to its points' largest distance^d:
// files of six digits, or in single precision, make facets that only touch interpenetrate by less.
constexpr double CROSSING = 1e-5;
constexpr double IN_LINE = 1e-12;  // of the largest coordinate: what facets of one line or plane may be apart
constexpr std::size_t CROSSINGS_PER_FACET = 16;  // that are looked for; a tangled boundary has no end of them

// L-BFGS.
constexpr int LBFGS_PAIRS = 8;         // of vectors that it keeps
constexpr int LBFGS_TRIALS = 20;       // along one direction
constexpr double LBFGS_FARTHER = 4.0;  // times the last trial, where the minimum is beyond it
constexpr double WOLFE_VALUE = 1e-4;   // share of the first slope by which the value must fall
constexpr double WOLFE_SLOPE = 0.9;    // share of it that may be left

// Foldover-free energy: an iteration that lowers it by less, relative, ends a minimisation; vertices are drawn into balls
// of so much of the radius.
constexpr double FOLDOVER_EXACT = 2e-9, FOLDOVER_INNER = 0.9999;

// Energy of curved elements: what it costs to differ from the straight element, and the relative gain of the last
// iteration of a minimisation.
constexpr double QUADRATIC_GAIN = 1e-6;  // by which a linear programme must raise the smallest coefficient
constexpr double QUADRATIC_FLAT = 0.01;  // of what its edges span, the least size of an element
constexpr double QUADRATIC_STRAIGHT = 1.0, QUADRATIC_EXACT = 1e-6;

// Embedding: length of the residual, of that at the start.
constexpr double EMBEDDING_EXACT = 1e-5;
constexpr int EMBEDDING_ITERATIONS = 1000;

// Minimum-norm point: relative optimality gap.
constexpr double MIN_NORM_GAP = 1e-12;

}  // namespace meshfix
