#pragma once

#include "field_lookup.h"
#include "prehensile/robust_loss.h"

namespace prehensile::internal {

/// Points that the kernel takes at once; arrays are padded to a multiple of it.
inline constexpr int kRefineLanes = 8;

/// Points, by coordinate, padded to a multiple of kRefineLanes.
struct RefinePoints {
  const float* x;
  const float* y;
  const float* z;
  /// Normals; nullptr for none.
  const float* nx;
  const float* ny;
  const float* nz;
  /// 1, or 0 for padding.
  const float* present;
};

/// What is found at the points; as long as they are.
struct RefineRows {
  /// Points in O, relative to a reference point there.
  float* px;
  float* py;
  float* pz;
  /// Residual and its gradient.
  float* r;
  float* gx;
  float* gy;
  float* gz;
  /// 1 for a point that may count; 0 for padding and where normals disagree.
  float* valid;
};

struct RefineSums {
  /// Lower triangle of Σ w J Jᵀ by rows, J = [p × g; g].
  double information[21];
  /// Σ w J r.
  double gradient[6];
};

struct RefineCost {
  /// Sum of the losses of the valid points.
  double sum;
  double num_valid;
};

struct RefineKernel {
  /// Looks all points up. R (row by row) and t bring them to O, relative to the reference point.
  void (*look_up)(const FieldView<float>& field, const RefinePoints& points, std::size_t n,
                  const float* R, const float* t, float min_normal_cosine, const RefineRows& rows);
  /// Weighs the residuals; those beyond max_distance count as the loss there and have weight 0.
  RefineCost (*weigh)(RobustLoss loss, double scale, float max_distance, const float* r,
                      const float* valid, std::size_t n, float* weights);
  void (*sum)(const RefineRows& rows, const float* weights, std::size_t n, RefineSums* sums);
};

#define PREHENSILE_DECLARE_REFINE_KERNEL(level) \
  namespace level {                             \
  extern const RefineKernel kRefine;            \
  }
PREHENSILE_DECLARE_REFINE_KERNEL(baseline)
PREHENSILE_DECLARE_REFINE_KERNEL(avx2)
PREHENSILE_DECLARE_REFINE_KERNEL(avx512)
#undef PREHENSILE_DECLARE_REFINE_KERNEL

}  // namespace prehensile::internal
