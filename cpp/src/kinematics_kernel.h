#pragma once

#include "prehensile/kinematic_chain.h"

namespace prehensile::internal {

/// Configurations that a kernel takes at once: one in each lane of its vectors. All arrays have the
/// lane as their last index and are aligned to 64 bytes.
inline constexpr int kLanes = 8;
/// Most steps of a chain that the kernel takes.
inline constexpr int kMostSteps = 64;

struct KinematicsKernel {
  /// Forward kinematics.
  ///
  /// @param q (num_steps, kLanes) by step, |q| ≤ kSinCosRange where revolute.
  /// @param R (9, kLanes), p (3, kLanes) the pose of F in W.
  /// @param columns (num_steps, 6, kLanes) of the Jacobian, by step; nullptr for none.
  void (*walk)(const ChainView& chain, const double* q, double* R, double* p, double* columns);

  /// J Jᵀ of some rows of the Jacobian: the lower triangle, (rows (rows + 1) / 2, kLanes).
  ///
  /// @param columns as walk() gives them.
  /// @param first_row, rows 0, 3 or 6 of them.
  /// @param scale of the translational rows.
  void (*gram)(const double* columns, int num_steps, int first_row, int rows, double scale,
               double* gram);

  /// √det(gram - shift · I), 0 where that is not positive definite.
  ///
  /// @param shift, root (kLanes).
  void (*root_of_determinant)(const double* gram, int rows, const double* shift, double* root);

  /// Number of the direction with the largest inner product with a, as a double.
  ///
  /// @param directions (count, 3), without lanes.
  /// @param a (3, kLanes).
  /// @param nearest (kLanes).
  void (*nearest)(const double* directions, int count, const double* a, double* nearest);
};

#define PREHENSILE_DECLARE_KINEMATICS_KERNEL(level) \
  namespace level {                                 \
  extern const KinematicsKernel kKinematics;        \
  }
PREHENSILE_DECLARE_KINEMATICS_KERNEL(baseline)
PREHENSILE_DECLARE_KINEMATICS_KERNEL(avx2)
PREHENSILE_DECLARE_KINEMATICS_KERNEL(avx512)
#undef PREHENSILE_DECLARE_KINEMATICS_KERNEL

/// The kernel for this processor.
const KinematicsKernel& BestKinematicsKernel();

}  // namespace prehensile::internal
