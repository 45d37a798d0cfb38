#pragma once

namespace prehensile::internal {

/// One joint on the way from W to a frame, in a frame L of its own whose z is the joint's axis.
struct ChainStep {
  double R_PL[9];  // Row-major, from the preceding step's L (W for the first) at q = 0.
  double p_PL[3];
  int joint;
  bool prismatic;
};

/// All steps on the way to a frame F, and F's pose in the last one's L (or in W).
struct ChainView {
  const ChainStep* steps;
  int num_steps;
  double R_LF[9];
  double p_LF[3];
};

}  // namespace prehensile::internal
