#pragma once

#include "prehensile/kinematic_chain.h"

namespace prehensile::internal {

/// The axis of a joint in W, and a point of it; T is double or a vector of them.
template <typename T>
struct WorldAxis {
  T z[3];
  T p[3];
};

/// Forward kinematics. (`static`, so that each SIMD level has its own.)
///
/// @param sine, cosine, q for each step.
/// @param R, p the frame's rotation (row-major) and position in W.
/// @param axes for each step.
template <typename T>
[[gnu::always_inline]] static inline void WalkChain(const ChainView& chain, const T* sine,
                                                    const T* cosine, const T* q, T* R, T* p,
                                                    WorldAxis<T>* axes) {
  // The columns of R_WL. (T{} is zero, of a vector too.)
  T x[3] = {T{} + 1.0, T{}, T{}}, y[3] = {T{}, T{} + 1.0, T{}}, z[3] = {T{}, T{}, T{} + 1.0};
  for (int k = 0; k < 3; ++k) p[k] = T{};
  for (int i = 0; i < chain.num_steps; ++i) {
    const ChainStep& step = chain.steps[i];
    const double* const S = step.R_PL;
    const double* const t = step.p_PL;
    for (int k = 0; k < 3; ++k) {
      const T xk = x[k], yk = y[k], zk = z[k];
      p[k] += xk * t[0] + yk * t[1] + zk * t[2];
      x[k] = xk * S[0] + yk * S[3] + zk * S[6];
      y[k] = xk * S[1] + yk * S[4] + zk * S[7];
      z[k] = xk * S[2] + yk * S[5] + zk * S[8];
    }
    if (step.prismatic) {
      for (int k = 0; k < 3; ++k) p[k] += z[k] * q[i];
    } else {
      for (int k = 0; k < 3; ++k) {
        const T xk = x[k], yk = y[k];
        x[k] = xk * cosine[i] + yk * sine[i];
        y[k] = yk * cosine[i] - xk * sine[i];
      }
    }
    for (int k = 0; k < 3; ++k) {
      axes[i].z[k] = z[k];
      axes[i].p[k] = p[k];
    }
  }
  const double* const S = chain.R_LF;
  const double* const t = chain.p_LF;
  for (int k = 0; k < 3; ++k) {
    p[k] += x[k] * t[0] + y[k] * t[1] + z[k] * t[2];
    for (int j = 0; j < 3; ++j) R[3 * k + j] = x[k] * S[j] + y[k] * S[3 + j] + z[k] * S[6 + j];
  }
}

/// The column (6) of the Jacobian of a frame at p for one joint.
template <typename T>
[[gnu::always_inline]] static inline void JacobianColumn(const WorldAxis<T>& axis, bool prismatic,
                                                         const T* p, T* column) {
  if (prismatic) {
    for (int k = 0; k < 3; ++k) {
      column[k] = T{};
      column[3 + k] = axis.z[k];
    }
  } else {
    const T r[3] = {p[0] - axis.p[0], p[1] - axis.p[1], p[2] - axis.p[2]};
    for (int k = 0; k < 3; ++k) column[k] = axis.z[k];
    column[3] = axis.z[1] * r[2] - axis.z[2] * r[1];
    column[4] = axis.z[2] * r[0] - axis.z[0] * r[2];
    column[5] = axis.z[0] * r[1] - axis.z[1] * r[0];
  }
}

}  // namespace prehensile::internal
