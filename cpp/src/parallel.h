#pragma once

#include <algorithm>
#include <cstddef>
#include <exception>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace prehensile::internal {

/// Calls task(0), ..., task(num_tasks - 1), each on a thread of its own (the last on this one), and
/// waits for all. The first exception that a task throws is thrown again here.
template <typename Task>
void RunParallel(int num_tasks, const Task& task) {
  std::exception_ptr error;
  std::mutex mutex;
  const auto guarded = [&](int i) {
    try {
      task(i);
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!error) error = std::current_exception();
    }
  };
  std::vector<std::thread> threads;
  threads.reserve(num_tasks - 1);
  int started = 0;
  try {
    for (; started < num_tasks - 1; ++started) threads.emplace_back(guarded, started);
  } catch (const std::system_error&) {
    // No more threads to be had: the rest runs here.
  }
  for (int i = started; i < num_tasks; ++i) guarded(i);
  for (std::thread& thread : threads) thread.join();
  if (error) std::rethrow_exception(error);
}

/// Into how many shares to divide so many rows: num_threads, or fewer for few rows.
///
/// @throws std::invalid_argument if num_threads is below 1.
inline int NumShares(std::size_t rows, std::size_t rows_per_share, int num_threads) {
  if (num_threads < 1) {
    throw std::invalid_argument("num_threads: must be at least 1, not " +
                                std::to_string(num_threads));
  }
  return static_cast<int>(std::clamp<std::size_t>(rows / rows_per_share, 1, num_threads));
}

/// The first row of a share; that of the next one is its end.
inline std::size_t ShareBegin(std::size_t rows, int share, int num_shares) {
  return rows * share / num_shares;
}

/// Calls task(begin, end) for every share of the rows, in parallel.
template <typename Task>
void RunShares(std::size_t rows, std::size_t rows_per_share, int num_threads, const Task& task) {
  const int num_shares = NumShares(rows, rows_per_share, num_threads);
  RunParallel(num_shares, [&](int share) {
    task(ShareBegin(rows, share, num_shares), ShareBegin(rows, share + 1, num_shares));
  });
}

}  // namespace prehensile::internal
