#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "prehensile/differential_ik.h"
#include "prehensile/kinematic_tree.h"

namespace prehensile {

/// A frame that is to go somewhere.
struct FrameTask {
  /// Its number in the tree.
  int frame = 0;
  /// Of the rotational and translational velocities; 0 leaves one free.
  double weights[6] = {1, 1, 1, 1, 1, 1};
  /// Whether the axes of the weights are those of the frame rather than the world's.
  bool in_frame = false;
  /// Priority: 0 first.
  int level = 0;
  /// 1/s, from the difference of two poses to a velocity.
  double gain = 10.0;
  /// Greatest desired speeds (rad/s, m/s), may be infinite.
  double max_angular = 1e300;
  double max_linear = 1e300;
};

/// Differential inverse kinematics of frames of a tree, from joint state and desired poses.
/// All methods are const and may be called from many threads.
class FrameIk {
 public:
  /// @throws std::invalid_argument naming the argument.
  FrameIk(std::shared_ptr<const KinematicTree> tree, DifferentialIk ik,
          std::vector<FrameTask> tasks);

  int num_joints() const { return ik_.num_joints(); }
  int num_tasks() const { return static_cast<int>(tasks_.size()); }
  const DifferentialIk& ik() const { return ik_; }

  /// @param X_WD num_tasks() desired poses, row-major 4×4, or nullptr for none.
  /// @param V_WD num_tasks() desired spatial velocities (6 each), or nullptr for none; added to
  /// what
  ///   the poses ask for.
  void Step(const double* q, const double* v, const double* X_WD, const double* V_WD,
            const LinearRows& constraints, IkStep* step) const;

  /// N times `steps` steps on from (q, v), each towards desired poses of its own.
  ///
  /// @param q, v N n numbers each; become the last states.
  /// @param X_WD N num_tasks() poses.
  /// @param path room for N steps n numbers, the positions after each step; or nullptr.
  /// @param worst room for N numbers: the gravest status met.
  void Rollout(std::size_t N, int steps, double* q, double* v, const double* X_WD, double* path,
               std::int32_t* worst, int num_threads) const;

 private:
  std::shared_ptr<const KinematicTree> tree_;
  DifferentialIk ik_;
  std::vector<FrameTask> tasks_;  // Sorted by level.
  std::vector<int> order_;        // Place of each in the caller's order.
  std::vector<int> level_sizes_;
};

}  // namespace prehensile
