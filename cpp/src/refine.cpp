#include "prehensile/refine.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include "field_view.h"
#include "losses.h"
#include "parallel.h"
#include "prehensile/simd.h"
#include "refine_kernel.h"
#include "vectors.h"

namespace prehensile {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using internal::kRefineLanes;
using internal::RefineKernel;
using internal::Require;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// A point on the wrong side of its normal counts as one so many scales away.
constexpr double kMismatch = 3;
/// Least damping, relative to the mean eigenvalue: what keeps a free motion where it is.
constexpr double kLeastDamping = 1e-6;
constexpr double kMostDamping = 1e4;
/// The first iterations end when a step is below this part of the loss's scale.
constexpr double kCoarseTolerance = 0.05;

const RefineKernel& BestKernel() {
  using namespace internal;
#ifdef __x86_64__
  if (BestSimdLevel() == SimdLevel::kAvx512) return avx512::kRefine;
  if (BestSimdLevel() == SimdLevel::kAvx2) return avx2::kRefine;
#endif
  return baseline::kRefine;
}

std::size_t Padded(std::size_t n) { return (n + kRefineLanes - 1) / kRefineLanes * kRefineLanes; }

Matrix3d Skew(const Vector3d& v) {
  Matrix3d S;
  S << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return S;
}

Matrix3d Rotation(const Vector3d& w) {
  const double angle = w.norm();
  if (angle == 0) return Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, w / angle).toRotationMatrix();
}

/// The scene by coordinate, relative to its mean, strewn so that its first points are spread over
/// all of it.
class Scene {
 public:
  Scene(const double* points, const double* normals, std::size_t n)
      : n_(n), stride_(Padded(n)), data_((normals ? 7 : 4) * stride_), has_normals_(normals) {
    mean_.setZero();
    for (std::size_t i = 0; i < n; ++i) mean_ += Eigen::Map<const Vector3d>(points + 3 * i);
    mean_ /= static_cast<double>(n);
    // Every row once, by steps of the golden section of n: neighbours in a cloud or an image come
    // far apart, and any first few are about evenly spread.
    auto step = static_cast<std::size_t>(0.6180339887498949 * static_cast<double>(n));
    step = std::max<std::size_t>(step, 1);
    while (std::gcd(step, n) != 1) ++step;
    order_.reserve(n);
    double sum_squares = 0;
    for (std::size_t i = 0, from = 0; i < n; ++i) {
      const Vector3d p = Eigen::Map<const Vector3d>(points + 3 * from) - mean_;
      sum_squares += p.squaredNorm();
      order_.push_back(static_cast<std::uint32_t>(from));
      for (std::size_t k = 0; k < 3; ++k) {
        data_[k * stride_ + i] = static_cast<float>(p[static_cast<Eigen::Index>(k)]);
        if (normals) data_[(4 + k) * stride_ + i] = static_cast<float>(normals[3 * from + k]);
      }
      data_[3 * stride_ + i] = 1;
      from += step;
      if (from >= n) from -= n;
    }
    radius_ = std::sqrt(sum_squares / static_cast<double>(n));
  }

  std::size_t size() const { return n_; }
  /// Row in the input of each point.
  const std::vector<std::uint32_t>& order() const { return order_; }
  const Vector3d& mean() const { return mean_; }
  /// Root mean square distance from the mean.
  double radius() const { return radius_; }
  internal::RefinePoints points() const {
    const float* const at = data_.data();
    const float* const normals = has_normals_ ? at + 4 * stride_ : nullptr;
    const auto normal = [&](std::size_t k) { return normals ? normals + k * stride_ : nullptr; };
    return {at, at + stride_, at + 2 * stride_, normal(0), normal(1), normal(2), at + 3 * stride_};
  }

 private:
  std::size_t n_, stride_;
  std::vector<float> data_;
  std::vector<std::uint32_t> order_;
  bool has_normals_;
  Vector3d mean_;
  double radius_ = 0;
};

/// Where the scene is: q = R s + t of a point s of the scene relative to its mean, in O relative to
/// the centre of the field.
struct Placement {
  Matrix3d R;
  Vector3d t;
};

/// The middle of a field's grid in O.
Vector3d Centre(const FieldGrid& grid) {
  Vector3d centre;
  for (int k = 0; k < 3; ++k) {
    centre[k] = grid.origin[k] + 0.5 * grid.spacing * (grid.sizes[k] - 1);
  }
  return centre;
}

Placement Place(const Eigen::Isometry3d& X_WO, const Scene& scene, const Vector3d& centre) {
  const Eigen::Isometry3d X_OW = X_WO.inverse();
  return {X_OW.linear(), X_OW * scene.mean() - centre};
}

Eigen::Isometry3d Pose(const Placement& at, const Scene& scene, const Vector3d& centre) {
  // p_O = R (p_W - mean) + t + centre.
  Eigen::Isometry3d X_WO = Eigen::Isometry3d::Identity();
  X_WO.linear() = at.R.transpose();
  X_WO.translation() = scene.mean() - at.R.transpose() * (at.t + centre);
  return X_WO;
}

/// Refines one start after the other, in memory of its own.
class Refiner {
 public:
  /// @param num_points the first of the scene that count.
  Refiner(const Scene& scene, std::size_t num_points, const DistanceField& field,
          const RefineOptions& options)
      : scene_(scene),
        options_(options),
        kernel_(BestKernel()),
        num_points_(std::min(num_points, scene.size())),
        // Where the lanes do not divide it, those after them count, too.
        padded_(Padded(num_points_)),
        memory_(std::make_unique_for_overwrite<float[]>(17 * padded_)),
        weights_(memory_.get() + 16 * padded_),
        field_(internal::ViewField<float>(field, Centre(field.grid()).data())),
        length_(std::max(scene.radius(), field.grid().spacing)) {
    for (std::size_t i = 0; i < 2; ++i) rows_[i] = Rows(memory_.get() + i * 8 * padded_);
  }

  /// Steps until one is short or there have been enough.
  ///
  /// @return number of steps tried, and whether the last was short.
  std::pair<int, bool> Descend(double first_scale, int max_iterations, double tolerance,
                               Placement* at) {
    double scale = std::max(first_scale, options_.scale);
    double damping = kLeastDamping;
    double most = 0, cost = -1;  // Negative while it is not known.
    LookUp(*at, rows_[0]);
    for (int iteration = 1; iteration <= max_iterations; ++iteration) {
      const bool final_scale = scale <= options_.scale;
      if (cost < 0) {
        most = MaxDistance(rows_[0], scale);
        cost = Cost(rows_[0], scale, most);
      }
      internal::RefineSums sums;
      kernel_.sum(rows_[0], weights_, padded_, &sums);
      bool better = false;
      while (!better) {
        const Vector6d step = Solve(sums, damping);
        const Vector3d w = step.head<3>();
        const Matrix3d turn = Rotation(w);
        const double moved = step.tail<3>().norm() + length_ * w.norm();
        if (!std::isfinite(moved)) return {iteration, false};
        const Placement next{turn * at->R, turn * at->t + step.tail<3>()};
        if (final_scale && moved < tolerance) {
          // Too short to look again.
          *at = next;
          return {iteration, true};
        }
        LookUp(next, rows_[1]);
        const double next_cost = Cost(rows_[1], scale, most);
        better = next_cost <= cost;
        if (better) {
          *at = next;
          std::swap(rows_[0], rows_[1]);
          damping = std::max(0.1 * damping, kLeastDamping);
          // With the same scale and points the weights are those of the next iteration.
          cost = final_scale && options_.kept_fraction >= 1 ? next_cost : -1;
        } else {
          if (moved < tolerance || damping > kMostDamping) break;
          damping = std::max(10 * damping, 1e-3);
        }
      }
      if (final_scale && !better) return {iteration, true};
      if (!better) cost = -1;
      scale = std::max(scale * options_.cooling, options_.scale);
    }
    return {max_iterations, false};
  }

  /// Mean loss at the final scale where Descend() looked last.
  double FinalCost() {
    return Cost(rows_[0], options_.scale, MaxDistance(rows_[0], options_.scale));
  }

  /// What all points know about the pose, at which FinalCost() was asked for last.
  void Information(const Placement& at, RefinedPose* pose) {
    internal::RefineSums sums;
    kernel_.sum(rows_[0], weights_, padded_, &sums);
    // From motions about the centre in O to motions about the scene's mean in W: J of rotation
    // becomes (q - t) × g, and all turn.
    Matrix6d A = Matrix6d::Identity();
    A.topRightCorner<3, 3>() = -Skew(at.t);
    Matrix6d turn = Matrix6d::Zero();
    turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = at.R.transpose();
    const Matrix6d B = turn * A;
    pose->information = B * Full(sums) * B.transpose();
    pose->centre = scene_.mean();
    pose->length = scene_.radius();
    pose->sum_squares = pose->sum_weights = 0;
    pose->is_inlier.resize(scene_.size());
    double inlier_squares = 0;
    for (std::size_t i = 0; i < scene_.size(); ++i) {
      const double w = weights_[i], r = rows_[0].r[i];
      pose->sum_squares += w * r * r;
      pose->sum_weights += w;
      const bool inlier = rows_[0].valid[i] > 0 && std::abs(r) <= options_.inlier_distance;
      pose->is_inlier[scene_.order()[i]] = inlier;
      pose->num_inliers += inlier;
      inlier_squares += inlier ? r * r : 0.0;
    }
    pose->inlier_rms = std::sqrt(inlier_squares / static_cast<double>(pose->num_inliers));
  }

 private:
  internal::RefineRows Rows(float* at) const {
    const auto row = [&](std::size_t k) { return at + k * padded_; };
    return {row(0), row(1), row(2), row(3), row(4), row(5), row(6), row(7)};
  }

  void LookUp(const Placement& at, const internal::RefineRows& rows) const {
    float R[9], t[3];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) R[3 * i + j] = static_cast<float>(at.R(i, j));
      t[i] = static_cast<float>(at.t[i]);
    }
    kernel_.look_up(field_, scene_.points(), padded_, R, t,
                    static_cast<float>(options_.min_normal_cosine), rows);
  }

  /// Beyond which points do not count: by the options and by the part that is kept.
  double MaxDistance(const internal::RefineRows& rows, double scale) {
    const double given = options_.max_distance * (scale / options_.scale);
    if (options_.kept_fraction >= 1) return given;
    sorted_.clear();
    for (std::size_t i = 0; i < padded_; ++i) {
      if (rows.valid[i] > 0) sorted_.push_back(std::abs(rows.r[i]));
    }
    if (sorted_.empty()) return given;
    const auto kept = static_cast<std::ptrdiff_t>(options_.kept_fraction *
                                                  static_cast<double>(sorted_.size() - 1));
    std::nth_element(sorted_.begin(), sorted_.begin() + kept, sorted_.end());
    return std::min<double>(given, sorted_[static_cast<std::size_t>(kept)]);
  }

  /// Mean loss; sets the weights.
  double Cost(const internal::RefineRows& rows, double scale, double max_distance) {
    const auto most = static_cast<float>(std::min(max_distance, 1e15));
    const internal::RefineCost cost =
        kernel_.weigh(options_.loss, scale, most, rows.r, rows.valid, padded_, weights_);
    const double miss = std::min<double>(kMismatch * scale, most);
    const auto total = static_cast<double>(std::min(padded_, scene_.size()));
    return (cost.sum +
            (total - cost.num_valid) * internal::Loss(options_.loss, miss * miss, scale)) /
           total;
  }

  static Matrix6d Full(const internal::RefineSums& sums) {
    Matrix6d H;
    for (int a = 0, at = 0; a < 6; ++a) {
      for (int b = 0; b <= a; ++b, ++at) H(a, b) = H(b, a) = sums.information[at];
    }
    return H;
  }

  /// The step [rotation; translation] about the centre of the field.
  Vector6d Solve(const internal::RefineSums& sums, double damping) const {
    Vector6d unit;
    unit << Vector3d::Constant(1 / length_), Vector3d::Ones();
    Matrix6d H = unit.asDiagonal() * Full(sums) * unit.asDiagonal();
    // Where no point counts, the step is zero.
    const double size = H.trace() / 6 > 0 ? H.trace() / 6 : 1.0;
    H.diagonal().array() += damping * size;
    const Vector6d b = unit.cwiseProduct(Eigen::Map<const Vector6d>(sums.gradient));
    return -unit.cwiseProduct(H.ldlt().solve(b));
  }

  const Scene& scene_;
  const RefineOptions& options_;
  const RefineKernel& kernel_;
  std::size_t num_points_, padded_;
  std::unique_ptr<float[]> memory_;
  float* weights_;
  std::vector<float> sorted_;
  internal::FieldView<float> field_;
  double length_;
  internal::RefineRows rows_[2];
};

void Validate(const RefineOptions& options) {
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  // So that their squares are numbers in single precision.
  const auto is_scale = [](double x) { return x >= 1e-9 && x <= 1e9; };
  Require(is_scale(options.scale), "scale: must be positive, from 1e-9 to 1e9");
  Require(is_scale(options.initial_scale), "initial_scale: must be positive, from 1e-9 to 1e9");
  Require(options.cooling > 0 && options.cooling < 1, "cooling: must be in (0, 1)");
  Require(options.max_distance > 0, "max_distance: must be positive");
  Require(options.kept_fraction > 0 && options.kept_fraction <= 1,
          "kept_fraction: must be in (0, 1]");
  Require(options.min_normal_cosine >= -1 && options.min_normal_cosine < 1,
          "min_normal_cosine: must be in [-1, 1)");
  Require(options.num_coarse_points >= 1, "num_coarse_points: must be at least 1");
  Require(options.num_finalists >= 1, "num_finalists: must be at least 1");
  Require(options.max_coarse_iterations >= 0, "max_coarse_iterations: must be at least 0");
  Require(options.max_iterations >= 1, "max_iterations: must be at least 1");
  Require(positive(options.tolerance), "tolerance: must be positive and finite");
  Require(options.inlier_distance >= 0, "inlier_distance: must be at least 0");
}

}  // namespace

std::vector<RefinedPose> RefinePoses(const double* points, const double* normals, std::size_t n,
                                     const DistanceField& field,
                                     const std::vector<Eigen::Isometry3d>& X_WO,
                                     const RefineOptions& options, int num_threads) {
  Validate(options);
  Require(n >= 1, "points: none");
  Require(n <= std::numeric_limits<std::int32_t>::max(), "points: more than 2^31 - 1");
  const Scene scene(points, normals, n);
  const Vector3d centre = Centre(field.grid());
  std::vector<RefinedPose> poses(X_WO.size());
  std::vector<Placement> places(X_WO.size());
  internal::RunShares(X_WO.size(), 1, num_threads, [&](std::size_t begin, std::size_t end) {
    Refiner refiner(scene, options.num_coarse_points, field, options);
    for (std::size_t i = begin; i < end; ++i) {
      places[i] = Place(X_WO[i], scene, centre);
      poses[i].information.setZero();
      poses[i].coarse_iterations =
          refiner
              .Descend(options.initial_scale, options.max_coarse_iterations,
                       kCoarseTolerance * options.scale, &places[i])
              .first;
      poses[i].cost = refiner.FinalCost();
    }
  });

  std::vector<std::size_t> order(X_WO.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return poses[a].cost < poses[b].cost; });
  order.resize(std::min<std::size_t>(order.size(), options.num_finalists));
  internal::RunShares(order.size(), 1, num_threads, [&](std::size_t begin, std::size_t end) {
    Refiner refiner(scene, n, field, options);
    for (std::size_t rank = begin; rank < end; ++rank) {
      const std::size_t i = order[rank];
      const auto [iterations, converged] =
          refiner.Descend(options.scale, options.max_iterations, options.tolerance, &places[i]);
      poses[i].iterations = iterations;
      poses[i].converged = converged;
      poses[i].is_finalist = true;
      poses[i].cost = refiner.FinalCost();
      refiner.Information(places[i], &poses[i]);
    }
  });
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i].X_WO = Pose(places[i], scene, centre);
  return poses;
}

}  // namespace prehensile
