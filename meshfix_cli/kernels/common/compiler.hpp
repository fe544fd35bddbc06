// What compilers have beyond C++17. Beside each use stands plain C++ that does the same, with the same bits, which is what
// others compile (MSVC), and what MESHFIX_PLAIN asks for (`make clang`).
#pragma once

#if defined(__GNUC__) && !defined(MESHFIX_PLAIN)
#define MESHFIX_GNU 1
#else
#define MESHFIX_GNU 0
#endif
