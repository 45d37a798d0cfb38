// The inner loops of refinement, compiled once per SIMD level. No library code here (see
// cpp/CMakeLists.txt).

#include "refine_kernel.h"

#include "losses.h"

namespace prehensile::internal::PREHENSILE_SIMD {
namespace {

using Lanes = float __attribute__((vector_size(4 * kRefineLanes)));

[[gnu::always_inline]] inline void Load(const float* at, Lanes* lanes) {
  __builtin_memcpy(lanes, at, sizeof(*lanes));
}

void LookUpAll(const FieldView<float>& field, const RefinePoints& points, std::size_t n,
               const float* R, const float* t, float min_normal_cosine, const RefineRows& rows) {
  // Copies: nothing that is written below can change them.
  const FieldView<float> grid = field;
  float turn[9];
  for (int k = 0; k < 9; ++k) turn[k] = R[k];
  const float shift[3] = {t[0], t[1], t[2]};
  constexpr std::size_t kBlock = 64;
  for (std::size_t begin = 0; begin < n; begin += kBlock) {
    const std::size_t count = begin + kBlock < n ? kBlock : n - begin;
    std::int32_t node[kBlock];
    float at[3][kBlock], within[3][kBlock], beyond[3][kBlock];
    for (std::size_t k = 0; k < count; ++k) {
      const float x = points.x[begin + k], y = points.y[begin + k], z = points.z[begin + k];
      for (int axis = 0; axis < 3; ++axis) {
        const float* const row = turn + 3 * axis;
        at[axis][k] = row[0] * x + row[1] * y + row[2] * z + shift[axis];
      }
      const FieldCell<float> cell = Locate(grid, at[0][k], at[1][k], at[2][k]);
      node[k] = cell.node;
      for (int axis = 0; axis < 3; ++axis) {
        within[axis][k] = cell.t[axis];
        beyond[axis][k] = cell.beyond[axis];
      }
    }
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t i = begin + k;
      const FieldCell<float> cell{node[k],
                                  {within[0][k], within[1][k], within[2][k]},
                                  {beyond[0][k], beyond[1][k], beyond[2][k]}};
      const FieldValue<float> value = Blend(grid, cell);
      rows.px[i] = at[0][k];
      rows.py[i] = at[1][k];
      rows.pz[i] = at[2][k];
      rows.r[i] = value.distance;
      rows.gx[i] = value.gradient[0];
      rows.gy[i] = value.gradient[1];
      rows.gz[i] = value.gradient[2];
      rows.valid[i] = points.present[i];
    }
  }
  if (!points.nx) return;
  for (std::size_t i = 0; i < n; ++i) {
    const float x = points.nx[i], y = points.ny[i], z = points.nz[i];
    const float cosine = (R[0] * x + R[1] * y + R[2] * z) * rows.gx[i] +
                         (R[3] * x + R[4] * y + R[5] * z) * rows.gy[i] +
                         (R[6] * x + R[7] * y + R[8] * z) * rows.gz[i];
    rows.valid[i] = cosine < min_normal_cosine ? 0.0F : points.present[i];
  }
}

template <RobustLoss kLoss>
RefineCost Weigh(double scale, float max_distance, const float* r, const float* valid,
                 std::size_t n, float* weights) {
  // Single precision for each point, double for the sums.
  const auto c = static_cast<float>(scale);
  const float most = max_distance * max_distance;
  double sums[kRefineLanes] = {};
  double counted[kRefineLanes] = {};
  for (std::size_t i = 0; i < n; i += kRefineLanes) {
    for (int lane = 0; lane < kRefineLanes; ++lane) {
      const float r2 = r[i + lane] * r[i + lane];
      const float kept = r2 < most ? r2 : most;
      const float counts = valid[i + lane];
      counted[lane] += counts;
      sums[lane] += counts * Loss(kLoss, kept, c);
      weights[i + lane] = r2 <= most ? counts * Weight(kLoss, kept, c) : 0.0F;
    }
  }
  RefineCost cost{};
  for (int lane = 0; lane < kRefineLanes; ++lane) {
    cost.sum += sums[lane];
    cost.num_valid += counted[lane];
  }
  return cost;
}

RefineCost WeighAny(RobustLoss loss, double scale, float max_distance, const float* r,
                    const float* valid, std::size_t n, float* weights) {
  const auto weigh = [&] {
    switch (loss) {
      case RobustLoss::kHuber:
        return Weigh<RobustLoss::kHuber>;
      case RobustLoss::kTukey:
        return Weigh<RobustLoss::kTukey>;
      case RobustLoss::kGemanMcClure:
        return Weigh<RobustLoss::kGemanMcClure>;
      case RobustLoss::kTruncated:
        return Weigh<RobustLoss::kTruncated>;
      case RobustLoss::kLeastSquares:
        break;
    }
    return Weigh<RobustLoss::kLeastSquares>;
  }();
  return weigh(scale, max_distance, r, valid, n, weights);
}

void Sum(const RefineRows& rows, const float* weights, std::size_t n, RefineSums* sums) {
  // Single precision within a block, double across blocks.
  constexpr std::size_t kBlock = 512;
  *sums = RefineSums{};
  for (std::size_t begin = 0; begin < n; begin += kBlock) {
    const std::size_t end = begin + kBlock < n ? begin + kBlock : n;
    Lanes information[21] = {};
    Lanes gradient[6] = {};
    for (std::size_t i = begin; i < end; i += kRefineLanes) {
      Lanes px, py, pz, gx, gy, gz, w, r;
      Load(rows.px + i, &px);
      Load(rows.py + i, &py);
      Load(rows.pz + i, &pz);
      Load(rows.gx + i, &gx);
      Load(rows.gy + i, &gy);
      Load(rows.gz + i, &gz);
      Load(weights + i, &w);
      Load(rows.r + i, &r);
      const Lanes J[6] = {py * gz - pz * gy, pz * gx - px * gz, px * gy - py * gx, gx, gy, gz};
      for (int a = 0, at = 0; a < 6; ++a) {
        const Lanes wJ = w * J[a];
        gradient[a] += wJ * r;
        for (int b = 0; b <= a; ++b, ++at) information[at] += wJ * J[b];
      }
    }
    for (int lane = 0; lane < kRefineLanes; ++lane) {
      for (int at = 0; at < 21; ++at) sums->information[at] += information[at][lane];
      for (int a = 0; a < 6; ++a) sums->gradient[a] += gradient[a][lane];
    }
  }
}

}  // namespace

extern const RefineKernel kRefine{LookUpAll, WeighAny, Sum};

}  // namespace prehensile::internal::PREHENSILE_SIMD
