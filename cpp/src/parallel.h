#pragma once

#include <exception>
#include <mutex>
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

}  // namespace prehensile::internal
