// Work items over threads of the standard library.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <system_error>
#include <thread>
#include <vector>

namespace meshfix {

// Calls work(item) for item = 0 .. items-1, each once, in any order, on at most `threads` threads.
// The items must be independent; then the result does not depend on the number of threads.
template <class Work>
void for_each_item(std::int64_t items, int threads, const Work& work) {
    std::atomic<std::int64_t> next{0};
    const auto run = [&] {
        for (std::int64_t i = next++; i < items; i = next++) work(i);
    };
    const std::int64_t helpers = std::min<std::int64_t>(threads, items) - 1;
    std::vector<std::thread> pool;
    try {
        for (std::int64_t t = 0; t < helpers; ++t) pool.emplace_back(run);
    } catch (const std::system_error&) {  // the machine allows no more threads: those it gave do the work
    }
    run();
    for (auto& thread : pool) thread.join();
}

}  // namespace meshfix
