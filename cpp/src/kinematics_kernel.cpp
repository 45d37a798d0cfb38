// Kinematics of several configurations at once, compiled once per SIMD level. No library code here
// (see cpp/CMakeLists.txt).

#include "kinematics_kernel.h"

#include "chain_walk.h"
#include "sincos.h"

namespace prehensile::internal::PREHENSILE_SIMD {
namespace {

using Lanes = double __attribute__((vector_size(8 * kLanes)));

void Walk(const ChainView& chain, const double* q, double* R, double* p, double* columns) {
  const auto* const angles = reinterpret_cast<const Lanes*>(q);
  Lanes sine[kMostSteps], cosine[kMostSteps];
  WorldAxis<Lanes> axes[kMostSteps];
  for (int i = 0; i < chain.num_steps; ++i) SinCosReduced(angles[i], &sine[i], &cosine[i]);
  auto* const position = reinterpret_cast<Lanes*>(p);
  WalkChain(chain, sine, cosine, angles, reinterpret_cast<Lanes*>(R), position, axes);
  if (!columns) return;
  for (int i = 0; i < chain.num_steps; ++i) {
    JacobianColumn(axes[i], chain.steps[i].prismatic, position,
                   reinterpret_cast<Lanes*>(columns) + 6 * i);
  }
}

template <int kRows>
void GramOf(const Lanes* columns, int num_steps, int first_row, double scale, Lanes* gram) {
  Lanes sum[kRows * (kRows + 1) / 2] = {};
  for (int step = 0; step < num_steps; ++step) {
    Lanes v[kRows];
    for (int i = 0; i < kRows; ++i) {
      v[i] = columns[6 * step + first_row + i];
      if (first_row + i >= 3) v[i] *= scale;
    }
    for (int i = 0, at = 0; i < kRows; ++i) {
      for (int j = 0; j <= i; ++j, ++at) sum[at] += v[i] * v[j];
    }
  }
  for (int at = 0; at < kRows * (kRows + 1) / 2; ++at) gram[at] = sum[at];
}

void Gram(const double* columns, int num_steps, int first_row, int rows, double scale,
          double* gram) {
  const auto* const from = reinterpret_cast<const Lanes*>(columns);
  auto* const to = reinterpret_cast<Lanes*>(gram);
  if (rows == 6) {
    GramOf<6>(from, num_steps, first_row, scale, to);
  } else {
    GramOf<3>(from, num_steps, first_row, scale, to);
  }
}

/// By the factorization L D Lᵀ; the determinant is the product of D.
template <int kRows>
void Root(const Lanes* gram, const Lanes& shift, double* root) {
  Lanes l[kRows][kRows];  // L below the diagonal, times D in column j.
  Lanes product = Lanes{} + 1.0, smallest = Lanes{} + 1e300;
  for (int i = 0, at = 0; i < kRows; ++i) {
    for (int j = 0; j <= i; ++j, ++at) l[i][j] = gram[at];
    l[i][i] -= shift;
  }
  for (int j = 0; j < kRows; ++j) {
    const Lanes d = l[j][j];
    smallest = d < smallest ? d : smallest;
    product *= d;
    const Lanes inverse = 1.0 / (d > 0.0 ? d : Lanes{} + 1.0);
    for (int i = j + 1; i < kRows; ++i) {
      const Lanes share = l[i][j] * inverse;
      for (int k = j + 1; k <= i; ++k) l[i][k] -= share * l[k][j];
    }
  }
  const Lanes positive = smallest > 0.0 ? product : Lanes{};
  for (int lane = 0; lane < kLanes; ++lane) root[lane] = __builtin_sqrt(positive[lane]);
}

void RootOfDeterminant(const double* gram, int rows, const double* shift, double* root) {
  const auto* const from = reinterpret_cast<const Lanes*>(gram);
  const Lanes& by = *reinterpret_cast<const Lanes*>(shift);
  if (rows == 6) {
    Root<6>(from, by, root);
  } else {
    Root<3>(from, by, root);
  }
}

void Nearest(const double* directions, int count, const double* a, double* nearest) {
  const auto* const v = reinterpret_cast<const Lanes*>(a);
  Lanes largest = Lanes{} - 2.0, which = Lanes{};
  for (int d = 0; d < count; ++d) {
    const double* const u = directions + 3 * d;
    const Lanes cosine = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    const auto better = cosine > largest;
    largest = better ? cosine : largest;
    which = better ? Lanes{} + static_cast<double>(d) : which;
  }
  *reinterpret_cast<Lanes*>(nearest) = which;
}

}  // namespace

extern const KinematicsKernel kKinematics{Walk, Gram, RootOfDeterminant, Nearest};

}  // namespace prehensile::internal::PREHENSILE_SIMD
