// Work items over threads of the standard library.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <exception>
#include <system_error>
#include <thread>
#include <vector>

namespace meshfix {

// Calls work(item) for item = 0 .. items-1, each once, in any order, on at most `threads` threads.
// The items must be independent; then the result does not depend on the number of threads.
template <class Work>
void for_each_item(std::int64_t items, int threads, const Work& work) {
    std::atomic<std::int64_t> next{0};
    std::atomic<bool> failed{false};
    std::exception_ptr error;  // the first one, such as out of memory; the other threads stop
    const auto run = [&] {
        try {
            for (std::int64_t i = next++; i < items && !failed; i = next++) work(i);
        } catch (...) {
            if (!failed.exchange(true)) error = std::current_exception();
        }
    };
    const std::int64_t helpers = std::min<std::int64_t>(threads, items) - 1;
    std::vector<std::thread> pool;
    if (helpers > 0) pool.reserve(static_cast<std::size_t>(helpers));
    try {
        for (std::int64_t t = 0; t < helpers; ++t) pool.emplace_back(run);
    } catch (const std::system_error&) {  // the machine allows no more threads: those it gave do the work
    }
    run();
    for (auto& thread : pool) thread.join();
    if (error) std::rethrow_exception(error);
}

}  // namespace meshfix
