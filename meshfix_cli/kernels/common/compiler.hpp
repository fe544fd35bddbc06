// What only some compilers have. Beside each use stands plain C++ that does the same, with the same bits, which is what
// others compile: MSVC, and Apple's library, which cannot read numbers with <charconv>. MESHFIX_PLAIN asks for all of it.
#pragma once

#if defined(__GNUC__) && !defined(MESHFIX_PLAIN)
#define MESHFIX_GNU 1
#else
#define MESHFIX_GNU 0
#endif
