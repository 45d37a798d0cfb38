#pragma once

#include "kinematics_kernel.h"

namespace prehensile::internal {

/// Room for the kinematics of up to kLanes configurations at once.
struct alignas(64) LaneRoom {
  double q[kMostSteps][kLanes];
  double R[9][kLanes];
  double p[3][kLanes];
  double columns[kMostSteps][6][kLanes];

  /// @param chain of at most kMostSteps.
  /// @param Q count ≤ kLanes rows of n; lanes beyond repeat the last.
  void Walk(const ChainView& chain, const double* Q, int n, int count, bool with_columns);

  /// Row-major X_WF of one lane.
  void Pose(int lane, double* X_WF) const;
};

}  // namespace prehensile::internal
