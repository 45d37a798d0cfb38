#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "prehensile/simd.h"

namespace prehensile {

/// N rows of x, y, z.
using PointRows = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>;

/// An undirected graph without loops, its adjacency matrix one bit per pair.
class ConsistencyGraph {
 public:
  /// Largest number of vertices: a matrix of 128 MiB.
  static constexpr int kMaxVertices = 1 << 15;

  /// A graph without edges.
  ///
  /// @throws std::invalid_argument if there are more than kMaxVertices.
  explicit ConsistencyGraph(std::size_t num_vertices);

  int size() const { return size_; }
  int words_per_row() const { return words_; }
  /// Bit j % 64 of word j / 64 says whether {i, j} is an edge.
  const std::uint64_t* row(int i) const { return &bits_[std::size_t(i) * words_]; }
  std::uint64_t* mutable_row(int i) { return &bits_[std::size_t(i) * words_]; }
  bool adjacent(int i, int j) const { return row(i)[j / 64] >> (j % 64) & 1; }
  void Connect(int i, int j);
  int degree(int i) const;
  std::size_t num_edges() const;

 private:
  int size_;
  int words_;
  std::vector<std::uint64_t> bits_;
};

/// Connects the correspondences i and j where a rigid motion can agree with both, by the distances
/// of their points: | |b_i - b_j| - scale |a_i - a_j| | <= tolerance, exactly as double precision
/// evaluates it, whatever the SIMD level.
///
/// @param a, b N corresponding points; both finite.
/// @param min_length correspondences nearer to each other than this, in a or in b, are not
/// connected.
ConsistencyGraph MakeConsistencyGraph(const PointRows& a, const PointRows& b, double tolerance,
                                      double scale = 1, double min_length = 0,
                                      std::optional<SimdLevel> simd = {});

struct CliqueOptions {
  /// Whether to search until the clique is proven to be a maximum one.
  bool exact = true;
  /// Cliques of fewer vertices are not looked for.
  int min_size = 1;
  /// Most nodes of the search tree.
  std::int64_t max_nodes = 1'000'000;
  /// Most seconds for the search; with a limit, the answer depends on the machine's speed.
  double time_limit = std::numeric_limits<double>::infinity();
};

struct Clique {
  /// Ascending; empty if none of min_size was found.
  std::vector<int> vertices;
  /// Whether no larger clique (of at least min_size) exists.
  bool proven = false;
  std::int64_t nodes = 0;
};

/// A largest clique, of equal ones always the same. Vertices are numbered by the order in which
/// peeling off a vertex of smallest degree leaves the cores of the graph; a greedy clique gives the
/// first lower bound, cores and a colouring the upper bounds (San Segundo, Rodríguez-Losada and
/// Jiménez, "An exact bit-parallel algorithm for the maximum clique problem", Computers &
/// Operations Research 38, 2011; Rossi, Gleich and Gebremedhin, "Parallel maximum clique algorithms
/// with applications to network analysis", SIAM J. Sci. Comput. 37, 2015).
Clique MaximumClique(const ConsistencyGraph& graph, const CliqueOptions& options = {});

struct Vote {
  double estimate = 0;
  std::vector<std::uint8_t> inliers;
  /// Sum over inliers of ((estimate - value) / bound)², plus the number of outliers.
  double cost = 0;
};

/// The number that most of the values agree with, exactly, in O(n log n): minimizes
/// sum of min(((x - v_i) / bound_i)², 1) (truncated least squares), or, if most_inliers, finds the
/// largest set of values whose intervals v_i ± bound_i share a point and takes its weighted mean.
///
/// H. Yang, J. Shi and L. Carlone, "TEASER: Fast and Certifiable Point Cloud Registration", IEEE
/// T-RO 37(2), 2021, section V (adaptive voting).
///
/// @param bounds positive.
Vote VoteForScalar(const double* values, const double* bounds, std::size_t n, bool most_inliers);

/// Σ w_i |b_i - R a_i|² minimized over rotations R, which are proper (determinant 1).
Eigen::Matrix3d FitRotation(const PointRows& a, const PointRows& b, const double* weights);

struct RotationConsensus {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  std::vector<std::uint8_t> inliers;
  /// Σ min(|b_i - R a_i|² / bound², 1).
  double cost = 0;
  int iterations = 0;
  bool converged = false;
};

/// Σ min(|b_i - R a_i|², bound²) over rotations by graduated non-convexity: a local method that
/// needs no guess (Yang, Antonante, Tzoumas and Carlone, "Graduated Non-Convexity for Robust
/// Spatial Perception", IEEE RA-L 5(2), 2020).
RotationConsensus GncRotation(const PointRows& a, const PointRows& b, double bound,
                              int max_iterations = 100);

/// log10 of the expected number of poses, of so many that were tested, each fixed by three
/// correspondences, with which k or more of n wrong correspondences would agree by chance: the
/// number of tests times the binomial tail of the other n - 3 (the number of false alarms; Moisan
/// and Stival, "A Probabilistic Criterion to Detect Rigid Point Matches Between Two Images and
/// Estimate the Fundamental Matrix", IJCV 57(3), 2004).
///
/// @param chance probability that a wrong correspondence agrees with a pose, in (0, 1].
double LogFalseAlarms(double num_tests, int n, int k, double chance);

enum class ConsensusStatus : std::uint8_t { kFound, kNoConsensus, kAmbiguous };

struct RobustOptions {
  /// Most nodes of each search for a clique.
  std::int64_t max_nodes = 20'000;
  /// A second pose with at least this part of the first one's inliers makes the answer ambiguous.
  double ambiguity_ratio = 0.8;
  /// Expected number of equally good poses by chance above which a consensus is none.
  double max_false_alarms = 1e-3;
  int min_inliers = 4;
};

struct RobustPose {
  ConsensusStatus status = ConsensusStatus::kNoConsensus;
  /// b ≈ scale R a + p; meaningless without a consensus.
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  double scale = 1;
  std::vector<std::uint8_t> inliers;
  /// Of the clique that led to the pose, and whether it is known to be the largest.
  int clique_size = 0;
  bool clique_proven = false;
  int num_inliers = 0, num_inliers_second = 0;
  /// Iterations of graduated non-convexity and of the refinement.
  int iterations = 0;
  /// See LogFalseAlarms.
  double log_false_alarms = 0;
};

/// A rigid motion b = R a + p from correspondences most of which are wrong, without a guess:
/// consistency graph, maximum clique, rotation by graduated non-convexity on the differences
/// of the clique's points, translation by voting, least squares on all that then agree. Repeated
/// without those, for a second pose.
///
/// @param noise_bound greatest distance |b_i - R a_i - p| of a right correspondence, > 0.
RobustPose RobustRegistration(const PointRows& a, const PointRows& b, double noise_bound,
                              const RobustOptions& options = {});

/// The scale of b = s R a + p: a vote of the ratios of corresponding distances.
Vote VoteForScale(const PointRows& a, const PointRows& b, double noise_bound);

struct RansacOptions {
  std::uint64_t seed = 0;
  int max_samples = 100'000;
  /// Probability to have drawn a sample of right correspondences before the search may stop.
  double confidence = 0.999;
};

struct RansacPose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  std::vector<std::uint8_t> inliers;
  int num_inliers = 0;
  /// Samples drawn; fewer of them had matching edges and became poses.
  int samples = 0, poses = 0;
  /// Whether the confidence was reached.
  bool confident = false;
  /// See LogFalseAlarms.
  double log_false_alarms = 0;
};

/// A rigid motion b = R a + p from three correspondences at a time, kept with the most
/// correspondences within max_distance, then refined on those by least squares. (Fischler and
/// Bolles, "Random Sample Consensus", Comm. ACM 24(6), 1981.)
RansacPose RansacRegistration(const PointRows& a, const PointRows& b, double max_distance,
                              const RansacOptions& options = {});

}  // namespace prehensile
