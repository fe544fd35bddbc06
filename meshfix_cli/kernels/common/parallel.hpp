// Work items over threads. The pool is made once and kept; its threads sleep between calls.
#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "common/compiler.hpp"

#if defined(__unix__) || defined(__APPLE__)
#include <unistd.h>
#endif

namespace meshfix {

constexpr std::int64_t PER_ITEM = 16384;  // of a pass over vertices or simplices

class Pool {
 public:
    // The pool of this process: a child that was forked has none of its parent's threads.
    static Pool& instance() {
        static std::atomic<Pool*> pool{nullptr};
        Pool* here = pool.load();
        while (here == nullptr || here->process_ != process()) {
            auto* fresh = new Pool;  // never deleted: its threads wait until the process ends
            if (pool.compare_exchange_strong(here, fresh)) return *fresh;
            delete fresh;
        }
        return *here;
    }

    // Runs `work` here and on up to `helpers` other threads at once; fewer where the machine allows no more, or where
    // somebody else uses the pool.
    void run(std::int64_t helpers, const std::function<void()>& work) {
        const std::unique_lock<std::mutex> alone(user_, std::try_to_lock);
        if (!alone.owns_lock()) return work();
        std::unique_lock<std::mutex> lock(state_);
        try {
            for (; threads_ < helpers; ++threads_) std::thread([this] { serve(); }).detach();
        } catch (const std::system_error&) {
        }
        work_ = &work;
        wanted_ = helpers;
        lock.unlock();
        wake_.notify_all();
        work();
        lock.lock();
        wanted_ = 0;  // who has not come by now is not needed any more
        done_.wait(lock, [this] { return running_ == 0; });
    }

 private:
    static long process() {
#if defined(__unix__) || defined(__APPLE__)
        return static_cast<long>(getpid());
#else
        return 0;
#endif
    }

    void serve() {
        std::unique_lock<std::mutex> lock(state_);
        for (;;) {
            wake_.wait(lock, [this] { return wanted_ > 0; });
            --wanted_;
            ++running_;
            const auto& work = *work_;
            lock.unlock();
            work();
            lock.lock();
            if (--running_ == 0) done_.notify_one();
        }
    }

    const long process_ = process();
    std::mutex user_, state_;
    std::condition_variable wake_, done_;
    const std::function<void()>* work_ = nullptr;
    std::int64_t threads_ = 0, wanted_ = 0, running_ = 0;
};

// Calls work(item) for item = 0 .. items-1, each once, in any order, on at most `threads` threads.
// The items must be independent; then the result does not depend on the number of threads.
template <class Work>
void for_each_item(std::int64_t items, int threads, const Work& work) {
    const std::int64_t helpers = std::min<std::int64_t>(threads, items) - 1;
    if (helpers <= 0) {
        for (std::int64_t i = 0; i < items; ++i) work(i);
        return;
    }
    std::atomic<std::int64_t> next{0};
    std::atomic<bool> failed{false};
    std::exception_ptr error;  // the first one, such as out of memory; the other threads stop
    Pool::instance().run(helpers, [&] {
        try {
            for (std::int64_t i = next++; i < items && !failed; i = next++) work(i);
        } catch (...) {
            if (!failed.exchange(true)) error = std::current_exception();
        }
    });
    if (error) std::rethrow_exception(error);
}

// Calls work(begin, end, item) for the ranges of `size` that 0 .. count-1 is cut into.
template <class Work>
void for_each_range(std::int64_t count, std::int64_t size, int threads, const Work& work) {
    for_each_item((count + size - 1) / size, threads, [&](std::int64_t item) {
        work(item * size, std::min(count, (item + 1) * size), item);
    });
}

// A byte that several threads may write at once.
inline std::uint8_t load_relaxed(const std::uint8_t& byte) {
#if MESHFIX_GNU
    return __atomic_load_n(&byte, __ATOMIC_RELAXED);
#else
    return *static_cast<const volatile std::uint8_t*>(&byte);
#endif
}
inline void store_relaxed(std::uint8_t& byte, std::uint8_t value) {
#if MESHFIX_GNU
    __atomic_store_n(&byte, value, __ATOMIC_RELAXED);
#else
    *static_cast<volatile std::uint8_t*>(&byte) = value;
#endif
}

// Says that something will be read soon.
inline void prefetch(const void* p) {
#if MESHFIX_GNU
    __builtin_prefetch(p);
#else
    static_cast<void>(p);
#endif
}

// Things that each thread needs one of at a time, kept for the next that comes as long as this lives.
template <class T>
class Spares {
 public:
    // Calls f(thing).
    template <class F>
    void with(const F& f) {
        T thing = take();
        f(thing);
        const std::lock_guard<std::mutex> lock(mutex_);
        kept_.push_back(std::move(thing));
    }

 private:
    T take() {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (kept_.empty()) return T();
        T thing = std::move(kept_.back());
        kept_.pop_back();
        return thing;
    }

    std::mutex mutex_;
    std::vector<T> kept_;
};

// How many threads the passes over the text of files may take.
inline std::atomic<int> text_threads{1};

}  // namespace meshfix
