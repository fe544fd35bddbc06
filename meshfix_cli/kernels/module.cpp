// Built once for any processor and, where the compiler can, once for those with wider vectors; see __init__.py.
#include "arrays.hpp"
#include "common/compiler.hpp"
#include "common/pack.hpp"

#define MODULE(name, variable) NB_MODULE(name, variable)
MODULE(MESHFIX_MODULE, m) {
    nanobind::set_leak_warnings(false);  // what a library keeps until the process ends is none of the user's
#if MESHFIX_GNU && defined(__x86_64__)
    m.def("has_avx2", [] { return __builtin_cpu_supports("avx2") != 0; });
#else
    m.def("has_avx2", [] { return false; });
#endif
    m.attr("LANES") = meshfix::LANES;
    meshfix::bind_mesh(m);
    meshfix::bind_measures(m);
    meshfix::bind_moves(m);
    meshfix::bind_quadratic(m);
    meshfix::bind_surface(m);
    meshfix::bind_text(m);
}
