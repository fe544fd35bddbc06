// The inverse of a small matrix.
#pragma once

#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace meshfix {

// Gauss and Jordan with the largest pivot of each column. values (n, n): of full rank.
inline std::vector<double> inverse_of(std::vector<double> values, int n) {
    const std::size_t size = static_cast<std::size_t>(n);
    std::vector<double> inverse(size * size, 0.0);
    for (std::size_t i = 0; i < size; ++i) inverse[i * size + i] = 1.0;
    for (std::size_t column = 0; column < size; ++column) {
        std::size_t pivot = column;
        for (std::size_t i = column + 1; i < size; ++i)
            if (std::fabs(values[i * size + column]) > std::fabs(values[pivot * size + column])) pivot = i;
        for (std::size_t j = 0; j < size; ++j) {
            std::swap(values[pivot * size + j], values[column * size + j]);
            std::swap(inverse[pivot * size + j], inverse[column * size + j]);
        }
        const double scale = 1.0 / values[column * size + column];
        for (std::size_t j = 0; j < size; ++j) {
            values[column * size + j] *= scale;
            inverse[column * size + j] *= scale;
        }
        for (std::size_t i = 0; i < size; ++i) {
            const double share = values[i * size + column];
            if (i == column || share == 0.0) continue;
            for (std::size_t j = 0; j < size; ++j) {
                values[i * size + j] -= share * values[column * size + j];
                inverse[i * size + j] -= share * inverse[column * size + j];
            }
        }
    }
    return inverse;
}

}  // namespace meshfix
