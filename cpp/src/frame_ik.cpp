#include "prehensile/frame_ik.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "parallel.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::Dot;
using internal::kInfinity;
using internal::Norm;
using internal::Require;

// Rotation vector of R_WD R_WF^T, in W: the turn that takes F to D.
void RotationVector(const double* X_WF, const double* X_WD, double* w) {
  double R[9];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) R[3 * i + j] = Dot(X_WD + 4 * i, X_WF + 4 * j, 3);
  }
  w[0] = R[7] - R[5];
  w[1] = R[2] - R[6];
  w[2] = R[3] - R[1];
  const double sine = 0.5 * Norm(w, 3);
  const double cosine = 0.5 * (R[0] + R[4] + R[8] - 1.0);
  const double angle = std::atan2(sine, cosine);
  double factor = 0.5;
  if (sine > 1e-6) {
    factor = 0.5 * angle / sine;
  } else if (cosine < 0.0) {
    // At half a turn R = 2 a a^T − I: the axis is the largest column of (R + I) / 2, normalized.
    int c = 0;
    for (int i = 1; i < 3; ++i) {
      if (R[4 * i] > R[4 * c]) c = i;
    }
    for (int i = 0; i < 3; ++i) w[i] = 0.5 * (R[3 * i + c] + (i == c ? 1.0 : 0.0));
    factor = angle / Norm(w, 3);
  }
  for (int i = 0; i < 3; ++i) w[i] *= factor;
}

void Shorten(double* a, double longest) {
  const double norm = std::hypot(a[0], a[1], a[2]);
  if (norm <= longest) return;
  for (int i = 0; i < 3; ++i) a[i] *= longest / norm;
}

}  // namespace

FrameIk::FrameIk(std::shared_ptr<const KinematicTree> tree, DifferentialIk ik,
                 std::vector<FrameTask> tasks)
    : tree_(std::move(tree)), ik_(std::move(ik)), tasks_(std::move(tasks)) {
  Require(tree_->num_joints() == ik_.num_joints(), "limits: not as many as joints of the tree");
  Require(!tasks_.empty() && tasks_.size() * 6 <= kMaxIkRows, "tasks: expected 1 to 16");
  for (const FrameTask& task : tasks_) {
    Require(0 <= task.frame && task.frame < tree_->num_frames(), "tasks: no such frame");
    Require(std::all_of(task.weights, task.weights + 6,
                        [](double w) { return 0.0 <= w && w < kInfinity; }),
            "tasks: a weight is negative or not finite");
    Require(task.gain >= 0.0 && task.gain < kInfinity, "tasks: gain: expected >= 0 and finite");
    Require(task.max_angular > 0.0 && task.max_linear > 0.0, "tasks: a speed is not positive");
  }
  order_.resize(tasks_.size());
  std::iota(order_.begin(), order_.end(), 0);
  std::stable_sort(order_.begin(), order_.end(),
                   [&](int a, int b) { return tasks_[a].level < tasks_[b].level; });
  std::vector<FrameTask> sorted;
  for (const int i : order_) {
    int rows = 0;
    for (const double w : tasks_[i].weights) rows += w > 0.0;
    const bool first = sorted.empty() || sorted.back().level != tasks_[i].level;
    if (first) level_sizes_.push_back(0);
    level_sizes_.back() += rows;
    sorted.push_back(tasks_[i]);
  }
  tasks_ = std::move(sorted);
}

void FrameIk::Step(const double* q, const double* v, const double* X_WD, const double* V_WD,
                   const LinearRows& constraints, IkStep* step) const {
  const int n = num_joints();
  double J[kMaxIkRows * kMaxIkJoints], V[kMaxIkRows], w[kMaxIkRows];
  int rows = 0;
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    const FrameTask& task = tasks_[t];
    double X_WF[16], J_F[6 * kMaxIkJoints], V_F[6] = {};
    tree_->PoseAndJacobian(q, task.frame, X_WF, J_F);
    if (X_WD != nullptr) {
      const double* const X = X_WD + 16 * order_[t];
      RotationVector(X_WF, X, V_F);
      for (int i = 0; i < 3; ++i) V_F[3 + i] = X[4 * i + 3] - X_WF[4 * i + 3];
      for (double& x : V_F) x *= task.gain;
    }
    if (V_WD != nullptr) {
      for (int i = 0; i < 6; ++i) V_F[i] += V_WD[6 * order_[t] + i];
    }
    Shorten(V_F, task.max_angular);
    Shorten(V_F + 3, task.max_linear);
    for (int i = 0; i < 6; ++i) {
      if (task.weights[i] == 0.0) continue;
      double* const row = J + rows * n;
      if (task.in_frame) {
        const int block = i < 3 ? 0 : 3;
        const double axis[3] = {X_WF[i - block], X_WF[4 + i - block], X_WF[8 + i - block]};
        V[rows] = Dot(axis, V_F + block, 3);
        for (int j = 0; j < n; ++j) {
          row[j] = axis[0] * J_F[block * n + j] + axis[1] * J_F[(block + 1) * n + j] +
                   axis[2] * J_F[(block + 2) * n + j];
        }
      } else {
        V[rows] = V_F[i];
        std::copy(J_F + i * n, J_F + (i + 1) * n, row);
      }
      w[rows++] = task.weights[i];
    }
  }
  const IkTaskRows tasks{rows, J, V, w, level_sizes_.data(), static_cast<int>(level_sizes_.size())};
  ik_.Step(q, v, tasks, constraints, step);
}

void FrameIk::Rollout(std::size_t N, int steps, double* q, double* v, const double* X_WD,
                      double* path, std::int32_t* worst, int num_threads) const {
  Require(steps >= 0, "steps: expected >= 0");
  const std::size_t n = num_joints(), poses = 16 * tasks_.size();
  const double h = ik_.options().period;
  internal::RunShares(N, 1, num_threads, [&](std::size_t begin, std::size_t end) {
    IkStep step;
    for (std::size_t i = begin; i < end; ++i) {
      double* const q_i = q + i * n;
      double* const v_i = v + i * n;
      worst[i] = 0;
      for (int k = 0; k < steps; ++k) {
        Step(q_i, v_i, X_WD + i * poses, nullptr, {}, &step);
        worst[i] = std::max(worst[i], static_cast<std::int32_t>(step.status));
        for (std::size_t j = 0; j < n; ++j) {
          v_i[j] = step.v[j];
          q_i[j] += h * step.v[j];
        }
        if (path != nullptr) std::copy(q_i, q_i + n, path + (i * steps + k) * n);
      }
    }
  });
}

}  // namespace prehensile
