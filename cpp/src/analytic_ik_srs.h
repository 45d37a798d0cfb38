#pragma once

// What analytic_ik_srs.cpp and analytic_ik_arm_angle.cpp share.

#include "analytic_ik_detail.h"

namespace prehensile {

/// What a pose says before arm angle and branch are chosen.
struct SrsArm::Target {
  Eigen::Matrix3d D0;                    // [d, reference direction, d × reference direction].
  Eigen::Matrix3d R_7;                   // Joint 7's frame.
  internal::Turn bend;                   // At the elbow, sine >= 0.
  internal::Turn at_shoulder, at_wrist;  // Angles of upper arm and forearm with d.

  /// The upper arm's frame (along the arm, axis 4 × that, axis 4) in [d, e, d × e], where e points
  /// to the elbow's side and sign says which way the elbow bends.
  Eigen::Matrix3d UpperArm(double sign) const {
    const auto& [c, s] = at_shoulder;
    return Eigen::Matrix3d{{c, sign * s, 0}, {s, -sign * c, 0}, {0, 0, -sign}};
  }
  Eigen::Matrix3d Forearm(double sign) const {
    const auto& [c, s] = at_wrist;
    return Eigen::Matrix3d{{c, -sign * s, 0}, {-s, -sign * c, 0}, {0, 0, -sign}};
  }
};

}  // namespace prehensile
