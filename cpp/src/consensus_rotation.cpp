#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "prehensile/consensus.h"
#include "vectors.h"

namespace prehensile {

using internal::Require;

Vote VoteForScalar(const double* values, const double* bounds, std::size_t n, bool most_inliers) {
  Require(n > 0 && n < (std::size_t{1} << 31), "values: there must be some, fewer than 2^31");
  for (std::size_t i = 0; i < n; ++i) {
    Require(std::isfinite(values[i]), "values: must be finite");
    Require(bounds[i] > 0 && std::isfinite(bounds[i]), "bounds: must be positive and finite");
  }
  struct End {
    double at;
    std::int32_t value;
    bool closes;
  };
  std::vector<End> ends;
  ends.reserve(2 * n);
  for (std::size_t i = 0; i < n; ++i) {
    ends.push_back({values[i] - bounds[i], static_cast<std::int32_t>(i), false});
    ends.push_back({values[i] + bounds[i], static_cast<std::int32_t>(i), true});
  }
  // Intervals are closed: at equal places all open before the first closes.
  std::sort(ends.begin(), ends.end(), [](const End& x, const End& y) {
    if (x.at != y.at) return x.at < y.at;
    return x.closes != y.closes ? y.closes : x.value < y.value;
  });
  // Sums over the set of intervals that hold the place; about the first value, for accuracy.
  const double origin = values[0], outlier_cost = most_inliers ? static_cast<double>(n) + 1 : 1;
  double w = 0, wx = 0, wxx = 0;
  std::size_t count = 0, best_end = 0;
  Vote vote;
  double best = internal::kInfinity;
  for (std::size_t e = 0; e < ends.size(); ++e) {
    const std::size_t i = ends[e].value;
    const double weight = 1 / (bounds[i] * bounds[i]), x = values[i] - origin;
    const double sign = ends[e].closes ? -1 : 1;
    count += ends[e].closes ? -1 : 1;
    w += sign * weight;
    wx += sign * weight * x;
    wxx += sign * weight * x * x;
    if (count == 0) continue;
    const double cost =
        std::max(0.0, wxx - wx * wx / w) + outlier_cost * static_cast<double>(n - count);
    if (cost < best) {
      best = cost;
      best_end = e;
    }
  }
  // The sums once more, over the best set alone, without what adding and removing lost.
  vote.inliers.assign(n, 0);
  for (std::size_t e = 0; e <= best_end; ++e) vote.inliers[ends[e].value] = !ends[e].closes;
  w = wx = 0;
  for (std::size_t i = 0; i < n; ++i) {
    if (!vote.inliers[i]) continue;
    const double weight = 1 / (bounds[i] * bounds[i]);
    w += weight;
    wx += weight * (values[i] - origin);
  }
  vote.estimate = origin + wx / w;
  for (std::size_t i = 0; i < n; ++i) {
    const double r = (vote.estimate - values[i]) / bounds[i];
    vote.cost += vote.inliers[i] ? r * r : 1;
  }
  return vote;
}

Eigen::Matrix3d FitRotation(const PointRows& a, const PointRows& b, const double* weights) {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    if (weights[i] != 0) H.noalias() += (weights[i] * b.row(i).transpose()) * a.row(i);
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(H, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  if (U.determinant() * svd.matrixV().determinant() < 0) U.col(2) *= -1;
  return U * svd.matrixV().transpose();
}

RotationConsensus GncRotation(const PointRows& a, const PointRows& b, double bound,
                              int max_iterations) {
  Require(a.rows() == b.rows(), "points: as many of the model as of the scene are needed");
  Require(a.rows() > 0, "points: there must be some");
  Require(a.allFinite() && b.allFinite(), "points: must be finite");
  Require(bound > 0 && std::isfinite(bound), "bound: must be positive and finite");
  Require(max_iterations >= 1, "max_iterations: must be at least 1");
  const auto n = static_cast<std::size_t>(a.rows());
  const double c2 = bound * bound;
  std::vector<double> weights(n, 1), squares(n);
  RotationConsensus result;
  const auto residuals = [&] {
    result.cost = 0;
    for (std::size_t i = 0; i < n; ++i) {
      squares[i] = (b.row(i).transpose() - result.R * a.row(i).transpose()).squaredNorm();
      result.cost += std::min(squares[i] / c2, 1.0);
    }
  };
  double mu = 0;
  while (result.iterations < max_iterations && !result.converged) {
    ++result.iterations;
    result.R = FitRotation(a, b, weights.data());
    residuals();
    if (mu == 0) {
      // Start where the cost is convex for the largest residual (remark 5 there).
      const double largest = *std::max_element(squares.begin(), squares.end());
      if (2 * largest <= c2) {
        result.converged = true;
        break;
      }
      mu = c2 / (2 * largest - c2);
    } else {
      mu *= 1.4;
    }
    const double full = mu / (mu + 1) * c2, none = (mu + 1) / mu * c2;
    result.converged = true;
    bool any = false;
    for (std::size_t i = 0; i < n; ++i) {
      const double old = weights[i];
      if (squares[i] <= full) {
        weights[i] = 1;
      } else if (squares[i] >= none) {
        weights[i] = 0;
      } else {
        weights[i] = std::clamp(bound * std::sqrt(mu * (mu + 1) / squares[i]) - mu, 0.0, 1.0);
      }
      const bool settled = weights[i] == old && (old == 0 || old == 1);
      result.converged = result.converged && settled;
      any = any || weights[i] > 0;
    }
    if (!any) {
      result.converged = false;
      break;
    }
  }
  result.inliers.resize(n);
  for (std::size_t i = 0; i < n; ++i) result.inliers[i] = squares[i] <= c2;
  return result;
}

}  // namespace prehensile
