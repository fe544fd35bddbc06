// Small symmetric positive systems.
#pragma once

#include <cmath>

namespace meshfix {

// Solves one of N unknowns by Cholesky's factors. left: rows, of which the lower triangle is read and replaced; right becomes
// the solution; false: a pivot is not larger than a share of what stood there.
template <int N, class Rows, class Column>
inline bool solve_positive(Rows& left, Column& right, double least) {
    for (int i = 0; i < N; ++i) {
        const double whole = left[i][i];
        for (int j = 0; j <= i; ++j) {
            double sum = left[i][j];
            for (int k = 0; k < j; ++k) sum -= left[i][k] * left[j][k];
            if (i == j && !(sum > least * whole)) return false;
            left[i][j] = i == j ? std::sqrt(sum) : sum / left[j][j];
        }
    }
    for (int i = 0; i < N; ++i) {
        for (int k = 0; k < i; ++k) right[i] -= left[i][k] * right[k];
        right[i] /= left[i][i];
    }
    for (int i = N; i-- > 0;) {
        for (int k = i + 1; k < N; ++k) right[i] -= left[k][i] * right[k];
        right[i] /= left[i][i];
    }
    return true;
}

}  // namespace meshfix
