#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "prehensile/kinematic_tree.h"

namespace prehensile {

/// Row `first`, `first` + 1, ... of an endless table of configurations, uniform within limits.
///
/// Every number is a function of the seed, its row and its joint alone (SplitMix64 by its index),
/// so any part of the table can be made by itself.
///
/// @param lower, upper n limits each, finite.
/// @param Q room for count × n numbers.
/// @throws std::invalid_argument naming the argument.
void SampleConfigurations(const std::vector<double>& lower, const std::vector<double>& upper,
                          std::uint64_t seed, std::uint64_t first, std::size_t count,
                          int num_threads, double* Q);

/// Rows of a Jacobian that are measured.
enum class ReachPart { kRotational, kTranslational, kBoth };

/// What of a frame is looked at.
struct ReachQuery {
  int frame = 0;
  /// Unit vector in the frame: the axis whose directions are told apart.
  std::array<double, 3> axis{0, 0, 1};
  /// Unit vectors in the world, at most 64: an axis counts for the one it is nearest to.
  std::vector<std::array<double, 3>> directions;
  ReachPart part = ReachPart::kBoth;
  /// Translational rows are divided by this length (m).
  double length = 1;
};

/// A box of voxels, and what has been found in each so far. Voxel (i, j, k) holds the points with
/// i = floor(x · (1 / voxel_size)) and so on; its place in the arrays is that of a row-major array
/// of `shape` at (i, j, k) - first.
struct ReachVoxels {
  double voxel_size;
  std::array<std::int64_t, 3> first;
  std::array<std::int64_t, 3> shape;
  /// Configurations that put the frame's origin there.
  std::uint32_t* counts;
  /// Bit d is set if direction d has been seen there.
  std::uint64_t* directions;
  /// Largest √det(J Jᵀ) there.
  double* manipulability;
  /// Largest value there of the smallest singular value of J.
  double* singular_value;
};

/// Adds N configurations to the voxels. What is kept (counts, unions, largest values) depends
/// neither on their order nor on num_threads.
///
/// @returns how many put the frame outside the box.
/// @throws std::invalid_argument naming the argument.
std::size_t AddToReach(const KinematicTree& tree, const ReachQuery& query, const double* Q,
                       std::size_t N, int num_threads, const ReachVoxels& voxels);

}  // namespace prehensile
