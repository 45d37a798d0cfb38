#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace prehensile {

/// Numbers in a fast point feature histogram: eleven bins for each of three angles.
inline constexpr int kFpfhSize = 33;

/// Fast point feature histograms (Rusu, Blodow, Beetz, "Fast point feature histograms (FPFH) for
/// 3D registration", ICRA 2009).
///
/// Two points with normals span a Darboux frame at the one whose normal makes the smaller angle
/// with the line between them; the other's normal in that frame gives three angles. Each point
/// counts those of the pairs with all its neighbours in three histograms, that sum to 100 each. Its
/// feature is that plus the mean of its neighbours' histograms, weighed by 1 / squared distance and
/// scaled to the sum 100 again (with the squared distance, as implementations in use do).
///
/// @param points n rows of x, y, z, finite, n < 2³¹.
/// @param normals n unit vectors. A zero normal leaves its point out.
/// @param radius of the neighbourhoods [m], > 0.
/// @param features room for n rows of kFpfhSize. Zero for a point without normal or neighbour.
/// @throws std::invalid_argument naming the argument.
void Fpfh(const double* points, const double* normals, std::size_t n, double radius,
          int num_threads, float* features);

/// For each of n features, which of m others is nearest by Euclidean distance.
///
/// @param a, b n and m rows of kFpfhSize, finite; n, m < 2³¹.
/// @param nearest room for n: the row of b, the smaller of equals; -1 if b has none.
/// @param squared_distances room for n; infinity where there is none.
/// @param second_squared_distances room for n: of the second nearest.
void NearestFeatures(const float* a, std::size_t n, const float* b, std::size_t m, int num_threads,
                     std::int32_t* nearest, float* squared_distances,
                     float* second_squared_distances);

/// A pose of a model in a scene, and how many pairs of points spoke for it.
struct PoseVote {
  /// X_WO, row-major (4, 4).
  double X_WO[16];
  double votes;
};

/// Pairs of oriented points of a model, by what a rigid motion leaves as it is.
///
/// The feature of a pair (p1, n1), (p2, n2) with d = p2 − p1 is (|d|, ∠(n1, d), ∠(n2, d),
/// ∠(n1, n2)); pairs of alike features lie in one bucket. A pair of the scene and a pair of the
/// model with the same feature fix the pose: the first points and normals leave
/// a rotation about the normal, which the second points fix (Drost, Ulrich, Navab, Ilic, "Model
/// globally, match locally", CVPR 2010). A pair of the scene that lies near the edge of a bucket
/// votes in the next one, too (Hinterstoisser et al., "Going further with point pair features",
/// ECCV 2016).
class PointPairTable {
 public:
  /// @param points n rows of x, y, z in O, 2 ≤ n < 2¹³.
  /// @param normals n unit vectors, out of the surface. A zero normal leaves its point out.
  /// @param distance_step width of a bucket along the distance, > 0 [m].
  /// @throws std::invalid_argument if a size is wrong, a number is not finite, or the model spans
  ///   more than 64 steps.
  PointPairTable(const double* points, const double* normals, std::size_t n, double distance_step);

  /// Of the points with a normal.
  std::size_t num_points() const { return points_.size() / 3; }
  std::size_t num_pairs() const { return entries_.size(); }
  /// The longest distance of two points of the model [m].
  double diameter() const { return diameter_; }

  /// Poses that pairs of the scene agree on, best first.
  ///
  /// Reference points are spread over the scene; each votes with all the others for the point of
  /// the model that it may be and the rotation about its normal. The best cells of each become
  /// poses, and poses near each other one.
  ///
  /// @param points m rows of x, y, z in W.
  /// @param normals m unit vectors toward the sensor, or zero where unknown.
  /// @param num_references how many points vote, at least 1 (all, if the scene has fewer).
  /// @param peaks_per_reference cells taken from each reference, at least 1.
  /// @param max_poses at most so many are returned, at least 1.
  /// @param num_threads at least 1.
  std::vector<PoseVote> Vote(const double* points, const double* normals, std::size_t m,
                             int num_references, int peaks_per_reference, int max_poses,
                             int num_threads) const;

 private:
  struct Entry {
    std::uint16_t point;
    /// Angle about the first normal, 2¹⁶ to a turn.
    std::uint16_t angle;
  };

  double distance_step_;
  double diameter_ = 0;
  int num_distances_ = 0;
  std::vector<double> points_;
  std::vector<double> normals_;
  /// Where each bucket begins in entries_, and their end.
  std::vector<std::uint32_t> begin_;
  std::vector<Entry> entries_;
};

}  // namespace prehensile
