#pragma once

#include <cstddef>

#include "cell_columns.h"

namespace prehensile::internal {

/// Length of the vectors in which candidates are taken.
inline constexpr std::size_t kCandidateLanes = 8;
/// Covariances whose eigenvectors are found at once.
inline constexpr std::size_t kCovarianceLanes = 8;

/// Arrays of coordinates.
struct Coordinates {
  const float *x, *y, *z;
};

/// Σ over the neighbours of a point of: 1, x, y, z, xx, xy, xz, yy, yz, zz, from the point.
struct Moments {
  float sums[10];
};

/// Upper triangles of covariances, and what is found in them; one lane each.
struct CovarianceBlock {
  double xx[kCovarianceLanes], xy[kCovarianceLanes], xz[kCovarianceLanes];
  double yy[kCovarianceLanes], yz[kCovarianceLanes], zz[kCovarianceLanes];
  /// Unit vectors along which the least is, or zero where there is no such direction.
  double nx[kCovarianceLanes], ny[kCovarianceLanes], nz[kCovarianceLanes];
  /// Least eigenvalue over the sum of all; zero where the sum is.
  double variation[kCovarianceLanes];
};

struct NormalsKernel {
  /// Sums over candidates within distance 1 of each of m queries.
  ///
  /// @param candidates a multiple of kCandidateLanes, at most 1e3 from the queries.
  void (*sum)(const Coordinates& candidates, std::size_t count, const Coordinates& queries,
              std::size_t m, Moments* moments);
  /// Writes (source - center) · scale for runs of the source, one after the other. Reads and writes
  /// up to 2 kCandidateLanes - 1 numbers too many.
  void (*gather)(const double* source, const CellRun* runs, std::size_t num_runs, double center,
                 double scale, float* target);
  void (*solve)(CovarianceBlock* block);
};

#define PREHENSILE_DECLARE_NORMALS_KERNEL(level) \
  namespace level {                              \
  extern const NormalsKernel kNormalsKernel;     \
  }
PREHENSILE_DECLARE_NORMALS_KERNEL(baseline)
PREHENSILE_DECLARE_NORMALS_KERNEL(avx2)
PREHENSILE_DECLARE_NORMALS_KERNEL(avx512)
#undef PREHENSILE_DECLARE_NORMALS_KERNEL

}  // namespace prehensile::internal
