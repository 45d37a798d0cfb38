#include "prehensile/branch_and_bound.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <queue>
#include <vector>

#include "consensus_detail.h"
#include "prehensile/kd_tree.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::kInfinity;
using internal::Pose;
using internal::Require;

constexpr double kPi = 3.14159265358979323846;
/// Translations of one box of turns are searched to this part of the gap, or of what the box may
/// still gain, if that is more: then it is split anyway.
constexpr double kInnerGap = 0.5;

/// Exact nearest neighbours: for each cell of a grid the points that can be nearest to a place
/// within it. Beyond the grid a tree answers.
class NearestGrid {
 public:
  NearestGrid(const PointRows& points, bool planar)
      : points_(points), tree_(points.data(), static_cast<std::size_t>(points.rows())) {
    const Eigen::Vector3d lower = points.colwise().minCoeff(), upper = points.colwise().maxCoeff();
    const double margin = 0.5 * std::max((upper - lower).maxCoeff(), 1e-12);
    origin_ = lower.array() - margin;
    const Eigen::Vector3d extent = upper - lower + Eigen::Vector3d::Constant(2 * margin);
    cell_ = extent.maxCoeff() / (planar ? 128 : 40);
    for (int axis = 0; axis < 3; ++axis) {
      count_[axis] = planar && axis == 2 ? 1 : static_cast<int>(extent[axis] / cell_) + 1;
    }
    if (planar) origin_[2] = -0.5 * cell_;
    const double reach = std::sqrt(3.0) * cell_;  // Twice half the diagonal.
    std::vector<std::int32_t> indices;
    std::vector<double> squares;
    begin_.push_back(0);
    for (int i = 0; i < count_[0]; ++i) {
      for (int j = 0; j < count_[1]; ++j) {
        for (int k = 0; k < count_[2]; ++k) {
          const Eigen::Vector3d center =
              origin_ + cell_ * Eigen::Vector3d(i + 0.5, j + 0.5, k + 0.5);
          std::int32_t nearest;
          double square;
          tree_.Nearest(center.data(), 1, kInfinity, &nearest, &square);
          tree_.WithinRadius(center.data(), (std::sqrt(square) + reach) * (1 + 1e-12), &indices,
                             &squares);
          for (const std::int32_t m : indices) {
            for (int axis = 0; axis < 3; ++axis) candidates_.push_back(points(m, axis));
          }
          begin_.push_back(candidates_.size());
        }
      }
    }
  }

  /// Squared distance to the nearest point.
  double Squared(const Eigen::Vector3d& x) const {
    const Eigen::Vector3d place = (x - origin_) / cell_;
    if ((place.array() >= 0).all() && place[0] < count_[0] && place[1] < count_[1] &&
        place[2] < count_[2]) {
      const std::size_t c =
          (std::size_t(place[0]) * count_[1] + std::size_t(place[1])) * count_[2] +
          std::size_t(place[2]);
      double least = kInfinity;
      for (std::size_t k = begin_[c]; k < begin_[c + 1]; k += 3) {
        const double dx = candidates_[k] - x[0], dy = candidates_[k + 1] - x[1],
                     dz = candidates_[k + 2] - x[2];
        least = std::min(least, dx * dx + dy * dy + dz * dz);
      }
      return least;
    }
    std::int32_t index;
    double square;
    tree_.Nearest(x.data(), 1, kInfinity, &index, &square);
    return square;
  }

  Eigen::Vector3d Nearest(const Eigen::Vector3d& x) const {
    std::int32_t index;
    double square;
    tree_.Nearest(x.data(), 1, kInfinity, &index, &square);
    return points_.row(index).transpose();
  }

 private:
  PointRows points_;
  KdTree tree_;
  Eigen::Vector3d origin_;
  double cell_;
  int count_[3];
  std::vector<std::size_t> begin_;
  std::vector<double> candidates_;
};

/// A cube, a lower bound of the cost within it, and the cost that its centre gets. The heap gives
/// the smallest bound first, of equal ones (often zero) the one of least cost.
struct Cube {
  Eigen::Vector3d center;
  double half;
  double bound;
  double cost;
  bool operator<(const Cube& other) const {
    return bound != other.bound ? bound > other.bound : cost > other.cost;
  }
};

class Search {
 public:
  Search(const PointRows& scene, const PointRows& model, const BranchAndBoundOptions& options)
      : options_(options), grid_(model, options.planar), center_(scene.colwise().mean()) {
    double radius = 0;
    for (Eigen::Index i = 0; i < scene.rows(); ++i) {
      points_.push_back((scene.row(i) - center_.transpose()).transpose());
      radius = std::max(radius, points_.back().norm());
    }
    rotated_.resize(points_.size());
    slack_.resize(points_.size());
    // Where the scene's centre can be: the mean of its points' partners lies among these; with
    // outliers, a point that is none lies near its partner.
    const Eigen::Vector3d lower = model.colwise().minCoeff(), upper = model.colwise().maxCoeff();
    const bool all_count = options.max_distance == kInfinity;
    places_.center = (lower + upper) / 2;
    place_extent_ = (upper - lower) / 2;
    if (!all_count) place_extent_.array() += radius + options.max_distance;
    places_.half = place_extent_.maxCoeff();
    places_.bound = places_.cost = 0;
  }

  BranchAndBoundPose Run() {
    Guess();
    // Finer than sums of such numbers can tell, there would be no end.
    options_.max_gap = std::max(options_.max_gap, 1e-12 * best_cost_);
    std::priority_queue<Cube> queue;
    queue.push({Eigen::Vector3d::Zero(), kPi, 0, best_cost_});
    const int dimensions = options_.planar ? 1 : 3;
    BranchAndBoundPose result;
    double lower_bound = best_cost_;
    while (true) {
      lower_bound = std::min(best_cost_, excluded_);
      if (!queue.empty()) lower_bound = std::min(lower_bound, queue.top().bound);
      result.closed = best_cost_ - lower_bound <= options_.max_gap;
      if (result.closed || queue.empty() || result.nodes >= options_.max_nodes || OutOfTime()) {
        break;
      }
      const Cube parent = queue.top();
      queue.pop();
      for (int child = 0; child < 1 << dimensions; ++child) {
        const Cube cube = Child(parent, child, dimensions);
        const double reach = std::sqrt(dimensions) * cube.half;
        if (cube.center.norm() - reach > kPi) continue;  // The same turns are found elsewhere.
        ++result.nodes;
        Bound(cube, reach, &queue);
      }
    }
    result.R = best_.R;
    result.p = best_.p - best_.R * center_;
    result.cost = best_cost_;
    result.lower_bound = lower_bound;
    return result;
  }

 private:
  bool OutOfTime() const {
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start_;
    return elapsed.count() > options_.time_limit;
  }

  static Cube Child(const Cube& parent, int child, int dimensions) {
    Cube cube{parent.center, parent.half / 2, parent.bound, parent.cost};
    for (int axis = 0; axis < dimensions; ++axis) {
      // In the plane, the only turn is the one about z.
      const int place = dimensions == 1 ? 2 : axis;
      cube.center[place] += child >> axis & 1 ? cube.half : -cube.half;
    }
    return cube;
  }

  /// Local minima from turns all over, centre on centre: one of them is often the global minimum
  /// already, and nothing excludes more boxes than that.
  void Guess() {
    best_.p = places_.center;
    const int steps = 8, layers = options_.planar ? 1 : steps;
    const auto place = [&](int i) { return kPi * ((2 * i + 1.0) / steps - 1); };
    for (int i = 0; i < layers; ++i) {
      for (int j = 0; j < layers; ++j) {
        for (int k = 0; k < steps; ++k) {
          const Eigen::Vector3d turn(layers > 1 ? place(i) : 0, layers > 1 ? place(j) : 0,
                                     place(k));
          if (turn.norm() < kPi) Improve({Rotation(turn), places_.center}, kInfinity);
        }
      }
    }
  }

  static Eigen::Matrix3d Rotation(const Eigen::Vector3d& turn) {
    const double angle = turn.norm();
    if (angle == 0) return Eigen::Matrix3d::Identity();
    return Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
  }

  /// Tries the turn in the middle of a cube, and keeps the cube if its bound does not exclude it.
  void Bound(Cube cube, double reach, std::priority_queue<Cube>* queue) {
    const Eigen::Matrix3d R = Rotation(cube.center);
    for (std::size_t i = 0; i < points_.size(); ++i) rotated_[i] = R * points_[i];

    // A point moves by no more than this between the middle and any other turn of the cube.
    const double chord = 2 * std::sin(std::min(reach, kPi) / 2);
    for (std::size_t i = 0; i < points_.size(); ++i) slack_[i] = chord * points_[i].norm();
    double best = best_cost_;
    cube.bound = std::max(cube.bound, Translations(&best, nullptr));
    if (best_cost_ - cube.bound <= options_.max_gap) {
      excluded_ = std::min(excluded_, cube.bound);
      return;
    }
    std::fill(slack_.begin(), slack_.end(), 0.0);
    Eigen::Vector3d place = places_.center;
    cube.cost = best_cost_;
    Translations(&cube.cost, &place);
    Improve({R, place}, 2 * best_cost_);
    queue->push(cube);
  }

  /// Minimizes the cost over translations, each distance less its point's slack. Returns a lower
  /// bound of that minimum, or of the best cost so far if that is less.
  ///
  /// @param least the best cost so far; becomes the least cost found.
  /// @param place if not null: the translation that has it, if it is less than before.
  double Translations(double* least, Eigen::Vector3d* place) {
    const int dimensions = options_.planar ? 2 : 3;
    heap_.assign(1, places_);
    double& best = *least;
    while (!heap_.empty()) {
      std::pop_heap(heap_.begin(), heap_.end());
      const Cube parent = heap_.back();
      heap_.pop_back();
      if (++visited_ % 64 == 0 && OutOfTime()) return std::min(parent.bound, best);
      if (best - parent.bound <= kInnerGap * std::max(options_.max_gap, best_cost_ - best))
        return std::min(parent.bound, best);
      for (int child = 0; child < 1 << dimensions; ++child) {
        Cube cube = Child(parent, child, dimensions);
        if (!MeetsPlaces(cube)) continue;
        const double reach = std::sqrt(dimensions) * cube.half;
        double cost = 0, bound = 0;
        for (std::size_t i = 0; i < rotated_.size() && bound < best; ++i) {
          const double distance = std::sqrt(grid_.Squared(rotated_[i] + cube.center)) - slack_[i];
          const double most = std::clamp(distance, 0.0, options_.max_distance);
          const double under = std::clamp(distance - reach, 0.0, options_.max_distance);
          cost += most * most;
          bound += under * under;
        }
        if (bound >= best) continue;  // The sums may be unfinished.
        cube.bound = std::max(bound, parent.bound);
        cube.cost = cost;
        if (cost < best) {
          best = cost;
          if (place) *place = cube.center;
        }
        heap_.push_back(cube);
        std::push_heap(heap_.begin(), heap_.end());
      }
    }
    return best;
  }

  bool MeetsPlaces(const Cube& cube) const {
    return ((cube.center - places_.center).cwiseAbs().array() - cube.half <= place_extent_.array())
        .all();
  }

  /// Iterative closest points from a pose of a cost below `most`, to a local minimum; keeps it if
  /// it is the best.
  void Improve(Pose pose, double most) {
    double cost = Cost(pose);
    if (!(cost < most)) return;
    for (int turn = 0; turn < 100; ++turn) {
      if (cost < best_cost_) {
        best_cost_ = cost;
        best_ = pose;
      }
      const Pose next = Fit(pose);
      const double next_cost = Cost(next);
      if (!(next_cost < cost * (1 - 1e-12))) return;
      pose = next;
      cost = next_cost;
    }
  }

  double Cost(const Pose& pose) const {
    const double cut = options_.max_distance * options_.max_distance;
    double cost = 0;
    for (const Eigen::Vector3d& x : points_) {
      cost += std::min(grid_.Squared(pose.R * x + pose.p), cut);
    }
    return cost;
  }

  /// Least squares with the partners that a pose gives.
  Pose Fit(const Pose& pose) const {
    const double cut = options_.max_distance * options_.max_distance;
    internal::OwnedRows from(points_.size(), 3), to(points_.size(), 3);
    std::vector<int> rows;
    for (const Eigen::Vector3d& x : points_) {
      const Eigen::Vector3d moved = pose.R * x + pose.p, partner = grid_.Nearest(moved);
      if ((moved - partner).squaredNorm() > cut) continue;
      const int row = static_cast<int>(rows.size());
      from.row(row) = x;
      to.row(row) = partner;
      rows.push_back(row);
    }
    const int count = static_cast<int>(rows.size());
    if (count == 0) return pose;
    if (!options_.planar) {
      return internal::FitPose(internal::View(from), internal::View(to), rows.data(), count);
    }
    const Eigen::RowVector3d mean_from = from.topRows(count).colwise().mean();
    const Eigen::RowVector3d mean_to = to.topRows(count).colwise().mean();
    double along = 0, across = 0;
    for (int i = 0; i < count; ++i) {
      const Eigen::RowVector3d u = from.row(i) - mean_from, v = to.row(i) - mean_to;
      along += u[0] * v[0] + u[1] * v[1];
      across += u[0] * v[1] - u[1] * v[0];
    }
    Pose fitted;
    fitted.R = Eigen::AngleAxisd(std::atan2(across, along), Eigen::Vector3d::UnitZ());
    fitted.p = mean_to.transpose() - fitted.R * mean_from.transpose();
    return fitted;
  }

  BranchAndBoundOptions options_;
  NearestGrid grid_;
  Eigen::Vector3d center_;               // Of the scene, in W.
  std::vector<Eigen::Vector3d> points_;  // The scene about its centre.
  std::vector<Eigen::Vector3d> rotated_;
  std::vector<double> slack_;
  Cube places_;
  Eigen::Vector3d place_extent_;
  std::vector<Cube> heap_;
  Pose best_;
  double best_cost_ = kInfinity;
  double excluded_ = kInfinity;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::size_t visited_ = 0;  // Boxes of translations.
};

}  // namespace

BranchAndBoundPose BranchAndBound(const PointRows& scene, const PointRows& model,
                                  const BranchAndBoundOptions& options) {
  Require(scene.rows() > 0 && scene.allFinite(), "scene_points: some are needed, all finite");
  Require(model.rows() > 0 && model.allFinite(), "model_points: some are needed, all finite");
  Require(scene.cwiseAbs().maxCoeff() < 1e100, "scene_points: farther than 1e100 from the origin");
  Require(model.cwiseAbs().maxCoeff() < 1e100, "model_points: farther than 1e100 from the origin");
  // The grid of nearest neighbours takes memory by their number, some 100 kB each.
  Require(model.rows() <= 10'000, "model_points: more than 10000; down-sample them");
  Require(options.max_distance > 0, "max_distance: must be positive");
  Require(options.max_gap >= 0, "max_gap: must not be negative");
  Require(options.max_nodes >= 0, "max_nodes: must not be negative");
  Require(options.time_limit >= 0, "time_limit: must not be negative");
  return Search(scene, model, options).Run();
}

}  // namespace prehensile
