// The kernels of kinematics: every SIMD level gives the same bits.

#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "check.h"
#include "kinematics_kernel.h"
#include "prehensile/kinematic_tree.h"
#include "prehensile/simd.h"

namespace prehensile {
namespace {

using internal::KinematicsKernel;
using internal::kLanes;

constexpr int kJoints = 7;

KinematicTree RandomChain(std::mt19937_64* generator) {
  std::normal_distribution<double> normal;
  const auto pose = [&] {
    Eigen::Matrix4d X = Eigen::Matrix4d::Identity();
    const Eigen::Vector4d q(normal(*generator), normal(*generator), normal(*generator), 1);
    X.topLeftCorner<3, 3>() = Eigen::Quaterniond(q.normalized()).toRotationMatrix();
    X.topRightCorner<3, 1>() = Eigen::Vector3d(normal(*generator), normal(*generator), 1);
    return X;
  };
  std::vector<TreeJoint> joints;
  for (int i = 0; i < kJoints; ++i) {
    joints.push_back({.parent = i - 1,
                      .X_PJ = pose(),
                      .axis = Eigen::Vector3d(1, normal(*generator), 2),
                      .type = i == 3 ? JointType::kPrismatic : JointType::kRevolute});
  }
  return KinematicTree(joints, {{.parent = kJoints - 1, .X_PF = pose()}});
}

/// All that a kernel computes from some configurations.
struct Outcome {
  alignas(64) double R[9][kLanes], p[3][kLanes], columns[kJoints][6][kLanes], gram[21][kLanes],
      root[kLanes], shifted[kLanes], nearest[kLanes];

  bool operator==(const Outcome& other) const {
    return std::memcmp(this, &other, sizeof(Outcome)) == 0;
  }
};

Outcome Run(const KinematicsKernel& kernel, const KinematicTree& tree, const double* q) {
  Outcome out{};
  kernel.walk(tree.chain(0), q, out.R[0], out.p[0], out.columns[0][0]);
  kernel.gram(out.columns[0][0], kJoints, 0, 6, 2.0, out.gram[0]);
  alignas(64) double shift[kLanes] = {};
  kernel.root_of_determinant(out.gram[0], 6, shift, out.root);
  for (int lane = 0; lane < kLanes; ++lane) shift[lane] = 0.01 * lane;
  kernel.root_of_determinant(out.gram[0], 6, shift, out.shifted);
  const double directions[] = {1, 0, 0, 0, 1, 0, 0, 0, 1, -1, 0, 0, 0, -1, 0, 0, 0, -1};
  kernel.nearest(directions, 6, out.R[0], out.nearest);
  return out;
}

void TestLevelsAgree() {
  std::mt19937_64 generator(1);
  std::uniform_real_distribution<double> uniform(-10, 10);
  std::vector<std::pair<std::string, const KinematicsKernel*>> kernels;
  for (const SimdLevel level : AvailableSimdLevels()) {
    const KinematicsKernel* kernel = &internal::baseline::kKinematics;
#ifdef __x86_64__
    if (level == SimdLevel::kAvx2) kernel = &internal::avx2::kKinematics;
    if (level == SimdLevel::kAvx512) kernel = &internal::avx512::kKinematics;
#endif
    kernels.emplace_back(Name(level), kernel);
  }
  for (int trial = 0; trial < 200; ++trial) {
    const KinematicTree tree = RandomChain(&generator);
    alignas(64) double q[kJoints][kLanes];
    for (auto& row : q) {
      for (double& x : row) x = uniform(generator);
    }
    const Outcome expected = Run(*kernels.front().second, tree, q[0]);
    for (const auto& [name, kernel] : kernels) {
      Check(Run(*kernel, tree, q[0]) == expected, name + " gives the bits of the baseline");
    }

    // One lane by Eigen: the Gram matrix's determinant, and that of the matrix less shift · I.
    const int lane = trial % kLanes;
    Eigen::Matrix<double, 6, kJoints> J;
    for (int i = 0; i < kJoints; ++i) {
      for (int k = 0; k < 6; ++k) J(k, i) = expected.columns[i][k][lane] * (k < 3 ? 1 : 2);
    }
    const Eigen::Matrix<double, 6, 6> A = J * J.transpose();
    const double root = std::sqrt(A.determinant());
    Check(std::abs(expected.root[lane] - root) < 1e-9 * root + 1e-6, "determinant");
    const Eigen::Matrix<double, 6, 6> B = A - 0.01 * lane * Eigen::Matrix<double, 6, 6>::Identity();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> solver(B);
    const double margin = solver.eigenvalues()(0);
    if (std::abs(margin) > 1e-9) {
      Check((expected.shifted[lane] > 0) == (margin > 0), "zero unless positive definite");
    }
    if (margin > 1e-3) {
      const double want = std::sqrt(B.determinant());
      Check(std::abs(expected.shifted[lane] - want) < 1e-6 * want, "shifted determinant");
    }
  }
}

}  // namespace
}  // namespace prehensile

int main() {
  prehensile::TestLevelsAgree();
  if (prehensile::failures == 0) std::printf("test_kinematics: all passed\n");
  return prehensile::failures;
}
