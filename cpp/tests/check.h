#pragma once

// What the tests share: each prints what failed, and exits with the number of failures.

#include <cstdio>
#include <functional>
#include <stdexcept>
#include <string>

namespace prehensile {

inline int failures = 0;

inline void Check(bool condition, const std::string& what) {
  if (condition) return;
  std::printf("FAILED: %s\n", what.c_str());
  ++failures;
}

inline void CheckThrows(const std::string& argument, const std::function<void()>& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    Check(std::string(error.what()).starts_with(argument + ":"), "names the argument " + argument);
    return;
  }
  Check(false, "throws for " + argument);
}

}  // namespace prehensile
