// Moments of neighbours and the eigenvectors of covariances, compiled once per SIMD level. No
// library code here (see cpp/CMakeLists.txt); every level works in vectors of the same length, so
// that all round alike.

#include "cloud_normals_kernel.h"

namespace prehensile::internal::PREHENSILE_SIMD {
namespace {

// Vectors wider than the level's registers are passed in memory, within this file alone.
#pragma GCC diagnostic ignored "-Wpsabi"

using Floats = float __attribute__((vector_size(4 * kCandidateLanes)));
using Ints = int __attribute__((vector_size(4 * kCandidateLanes)));
using Doubles = double __attribute__((vector_size(8 * kCovarianceLanes)));
using Longs = long long __attribute__((vector_size(8 * kCovarianceLanes)));

Floats Load(const float* p) {
  Floats v;
  __builtin_memcpy(&v, p, sizeof(v));
  return v;
}

/// The sums of eight vectors.
Floats Sums(const Floats& a, const Floats& b, const Floats& c, const Floats& d, const Floats& e,
            const Floats& f, const Floats& g, const Floats& h) {
  // Halves of two vectors are added side by side, then halves of those, and so on.
#define PREHENSILE_PAIR(u, v, ...) __builtin_shufflevector(u, v, __VA_ARGS__)
#define PREHENSILE_FOLD4(u, v)                       \
  (PREHENSILE_PAIR(u, v, 0, 1, 2, 3, 8, 9, 10, 11) + \
   PREHENSILE_PAIR(u, v, 4, 5, 6, 7, 12, 13, 14, 15))
#define PREHENSILE_FOLD2(u, v)                       \
  (PREHENSILE_PAIR(u, v, 0, 1, 8, 9, 4, 5, 12, 13) + \
   PREHENSILE_PAIR(u, v, 2, 3, 10, 11, 6, 7, 14, 15))
#define PREHENSILE_FOLD1(u, v)                        \
  (PREHENSILE_PAIR(u, v, 0, 8, 2, 10, 4, 12, 6, 14) + \
   PREHENSILE_PAIR(u, v, 1, 9, 3, 11, 5, 13, 7, 15))
  const Floats ae = PREHENSILE_FOLD4(a, e), bf = PREHENSILE_FOLD4(b, f),
               cg = PREHENSILE_FOLD4(c, g), dh = PREHENSILE_FOLD4(d, h);
  const Floats aceg = PREHENSILE_FOLD2(ae, cg), bdfh = PREHENSILE_FOLD2(bf, dh);
  return PREHENSILE_FOLD1(aceg, bdfh);
#undef PREHENSILE_PAIR
#undef PREHENSILE_FOLD4
#undef PREHENSILE_FOLD2
#undef PREHENSILE_FOLD1
}

void SumMoments(const Coordinates& candidates, std::size_t count, const Coordinates& queries,
                std::size_t m, Moments* moments) {
  const float *const x = candidates.x, *const y = candidates.y, *const z = candidates.z;
  const Floats zero{};
  for (std::size_t q = 0; q < m; ++q) {
    const Floats qx = zero + queries.x[q], qy = zero + queries.y[q], qz = zero + queries.z[q];
    Floats sx{}, sy{}, sz{}, sxx{}, sxy{}, sxz{}, syy{}, syz{}, szz{};
    Ints number{};
    for (std::size_t i = 0; i < count; i += kCandidateLanes) {
      Floats dx = Load(x + i) - qx, dy = Load(y + i) - qy, dz = Load(z + i) - qz;
      const Ints near = dx * dx + dy * dy + dz * dz <= zero + 1.0f;
      number -= near;
      dx = near ? dx : zero;
      dy = near ? dy : zero;
      dz = near ? dz : zero;
      sx += dx;
      sy += dy;
      sz += dz;
      sxx += dx * dx;
      sxy += dx * dy;
      sxz += dx * dz;
      syy += dy * dy;
      syz += dy * dz;
      szz += dz * dz;
    }
    const Floats counts = __builtin_convertvector(number, Floats);
    const Floats most = Sums(counts, sx, sy, sz, sxx, sxy, sxz, syy);
    __builtin_memcpy(moments[q].sums, &most, sizeof(most));
    const Floats rest = Sums(syz, szz, zero, zero, zero, zero, zero, zero);
    moments[q].sums[8] = rest[0];
    moments[q].sums[9] = rest[1];
  }
}

Doubles LoadDoubles(const double* p) {
  Doubles v;
  __builtin_memcpy(&v, p, sizeof(v));
  return v;
}

void Gather(const double* source, const CellRun* runs, std::size_t num_runs, double center,
            double scale, float* target) {
  const Doubles zero{}, middle = zero + center, factor = zero + scale;
  for (std::size_t r = 0; r < num_runs; ++r) {
    const std::size_t begin = runs[r].begin, end = runs[r].end;
    for (std::size_t i = begin; i < end; i += kCandidateLanes) {
      const Floats values =
          __builtin_convertvector((LoadDoubles(source + i) - middle) * factor, Floats);
      __builtin_memcpy(target + (i - begin), &values, sizeof(values));
    }
    target += end - begin;
  }
}

/// The eigenvector of the least eigenvalue, by Newton's method on the characteristic polynomial:
/// from the left of its least root it converges without overshooting.
void Solve(CovarianceBlock* block) {
  const Doubles zero{}, one = zero + 1;
  Doubles xx = LoadDoubles(block->xx), xy = LoadDoubles(block->xy), xz = LoadDoubles(block->xz),
          yy = LoadDoubles(block->yy), yz = LoadDoubles(block->yz), zz = LoadDoubles(block->zz);
  const Doubles trace = xx + yy + zz;
  const Longs some = trace > zero;
  const Doubles scale = one / (some ? trace : one);
  xx *= scale;
  xy *= scale;
  xz *= scale;
  yy *= scale;
  yz *= scale;
  zz *= scale;
  // λ³ - λ² + c₁ λ - c₀
  const Doubles c1 = (xx * yy - xy * xy) + (xx * zz - xz * xz) + (yy * zz - yz * yz);
  const Doubles c0 = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
  Doubles least = zero;
  Longs moving = some;
  for (int iteration = 0; iteration < 60; ++iteration) {
    const Doubles value = ((least - one) * least + c1) * least - c0;
    const Doubles slope = (3 * least - 2 * one) * least + c1;
    const Doubles step = value / slope;
    // Where rounding has spoiled the slope, the root is as near as it will come.
    moving &= (slope > zero) & (step < zero);
    least -= moving ? step : zero;
    moving &= step < zero - 1e-13;  // A lane that stands stays: it does not feel the others.
    long long any = 0;
    for (std::size_t lane = 0; lane < kCovarianceLanes; ++lane) any |= moving[lane];
    if (!any) break;
  }
  // It is normal to the rows of A - λ: the longest of the products of two of them.
  const Doubles a = xx - least, b = yy - least, c = zz - least;
  const Doubles p[3] = {xy * yz - xz * b, xz * xy - a * yz, a * b - xy * xy};
  const Doubles q[3] = {xy * c - xz * yz, xz * xz - a * c, a * yz - xy * xz};
  const Doubles r[3] = {b * c - yz * yz, yz * xz - xy * c, xy * yz - b * xz};
  const Doubles p2 = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
  const Doubles q2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
  const Doubles r2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
  const Longs use_q = (q2 > p2) & (q2 >= r2), use_r = (r2 > p2) & (r2 > q2);
  const Doubles n2 = use_r ? r2 : use_q ? q2 : p2;
  // On a line the two lesser eigenvalues vanish, and with them c₁, which is 1/3 to 5/3 of the
  // greater one; what is left then is the rounding of the sums. Where the two are alike, the
  // products vanish.
  const Longs known = some & (c1 > zero + 1e-5) & (n2 > zero + 1e-10);
  Doubles norm;
  const Doubles safe = known ? n2 : one;
  for (std::size_t lane = 0; lane < kCovarianceLanes; ++lane) {
    norm[lane] = __builtin_sqrt(safe[lane]);
  }
  Doubles n[3];
  for (int k = 0; k < 3; ++k) {
    n[k] = (use_r ? r[k] : use_q ? q[k] : p[k]) / norm;
    n[k] = known ? n[k] : zero;
  }
  __builtin_memcpy(block->nx, &n[0], sizeof(Doubles));
  __builtin_memcpy(block->ny, &n[1], sizeof(Doubles));
  __builtin_memcpy(block->nz, &n[2], sizeof(Doubles));
  const Doubles most = c1 > zero ? 1.5 * c1 : zero;  // Of the least eigenvalue, whatever c₀.
  least = least < most ? least : most;
  least = some ? least : zero;
  __builtin_memcpy(block->variation, &least, sizeof(Doubles));
}

}  // namespace

extern const NormalsKernel kNormalsKernel{SumMoments, Gather, Solve};

}  // namespace prehensile::internal::PREHENSILE_SIMD
