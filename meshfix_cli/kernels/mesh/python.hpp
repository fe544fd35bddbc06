// The mesh as Python holds it.
#pragma once

#include <atomic>
#include <mutex>

#include "arrays.hpp"
#include "mesh/edges.hpp"
#include "mesh/freedom.hpp"
#include "mesh/star.hpp"
#include "mesh/stars.hpp"

namespace meshfix {

struct PyConnectivity {
    int dimension = 0;
    Connectivity mesh{};
    std::mutex building{};  // of the stars, which come later
    std::atomic<bool> has_stars{false};
};

using PyEdges = std::pair<Vector<const std::int32_t>, Vector<const std::int32_t>>;  // offsets and ends

inline EdgesView edges_view(const PyEdges& edges) { return {edges.first.data(), edges.second.data()}; }

inline const std::uint8_t* bytes_of(const Vector<const bool>& mask, std::int64_t expected) {
    if (static_cast<std::int64_t>(mask.shape(0)) != expected) throw nb::value_error("the mask is of another mesh");
    return reinterpret_cast<const std::uint8_t*>(mask.data());
}

inline void check_freedom(const Freedom* freedom, std::int64_t n) {
    if (freedom != nullptr && static_cast<std::int64_t>(freedom->frame.size()) != n)
        throw nb::value_error("the freedom is of another mesh");
}

template <class T>
void check_points(const Matrix<T>& points, const PyConnectivity& self) {
    if (static_cast<int>(points.shape(1)) != self.dimension || static_cast<std::int64_t>(points.shape(0)) != self.mesh.n())
        throw nb::value_error("the points are of another mesh");
}

inline StarsView stars_of(const Connectivity& mesh) {
    return {mesh.offsets.data(), mesh.faces.data(), mesh.neighbour_offsets.data(), mesh.neighbours.data(),
            mesh.corners.data(), mesh.elements.empty() ? nullptr : &mesh.elements};
}

}  // namespace meshfix
