#pragma once

#include <cstdint>

namespace prehensile::internal {

/// SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014).
class SplitMix {
 public:
  explicit SplitMix(std::uint64_t seed) : state_(seed) {}
  std::uint64_t operator()() {
    std::uint64_t z = state_ += 0x9E3779B97F4A7C15u;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
    z = (z ^ z >> 27) * 0x94D049BB133111EBu;
    return z ^ z >> 31;
  }
  /// Below n, a number under 2^32; uneven by less than n / 2^32.
  int Below(int n) { return static_cast<int>(((*this)() >> 32) * std::uint64_t(n) >> 32); }

 private:
  std::uint64_t state_;
};

}  // namespace prehensile::internal
