// The inner loops of depth images, compiled once per SIMD level. No library code here (see
// cpp/CMakeLists.txt); the operations are written out so that every level rounds alike.

#include "depth_fusion_kernel.h"

namespace prehensile::internal::PREHENSILE_SIMD {
namespace {

#if defined(__AVX512F__)
constexpr int kLanes = 16;
#elif defined(__AVX2__)
constexpr int kLanes = 8;
#else
constexpr int kLanes = 4;
#endif

using Float = float __attribute__((vector_size(4 * kLanes)));
using Int = std::int32_t __attribute__((vector_size(4 * kLanes)));

constexpr float kInfinity = __builtin_inff();
constexpr float kNaN = __builtin_nanf("");
/// The part of a window's pixels that must be measured.
constexpr float kLeastMeasured = 0.6f;

inline Float Load(const float* from) {
  Float v;
  __builtin_memcpy(&v, from, sizeof(v));
  return v;
}

inline Float Fill(float x) { return Float{} + x; }

template <typename Vector, typename Scalar>
inline void Store(const Vector& v, Scalar* to) {
  __builtin_memcpy(to, &v, sizeof(v));
}

inline Float Root(const Float& x) {
  Float root;
  for (int lane = 0; lane < kLanes; ++lane) root[lane] = __builtin_sqrtf(x[lane]);
  return root;
}

inline bool Any(const Int& mask) {
  std::int32_t bits = 0;
  for (int lane = 0; lane < kLanes; ++lane) bits |= mask[lane];
  return bits != 0;
}

inline int RoundDown(int column) { return column & ~15; }

void Invert(const float* z, float low, float high, int begin, int end, float* w) {
  for (int u = RoundDown(begin); u < end; u += kLanes) {
    const Float depth = Load(z + u);
    const Int measured = (depth >= low) & (depth <= high);
    Store(measured ? 1.0f / depth : Fill(kNaN), w + u);
  }
}

bool Place(float* w, const RayRow& rays, const Placement& at, int begin, int end,
           const PointRow& points) {
  Int found{};
  for (int u = RoundDown(begin); u < end; u += kLanes) {
    const Float z = 1.0f / Load(w + u);
    const Float x = Load(rays.x + u) * z, y = Load(rays.y + u) * z;
    Int inside = z == z;
    for (int k = 0; k < 3; ++k) {
      const float* const R = at.R_BC + 3 * k;
      const Float p = ((R[0] * x + R[1] * y) + R[2] * z) + at.p_BC[k];
      inside &= (p <= at.half_size[k]) & (p >= -at.half_size[k]);
    }
    for (int k = 0; k < 3; ++k) {
      const float* const R = at.R_LC + 3 * k;
      const Float p = ((R[0] * x + R[1] * y) + R[2] * z) + at.p_LC[k];
      Store(p, points.p[k] + u);
      // Truncation is floor here, as the grid begins below the box.
      const Float cell = inside ? p * at.inverse_voxel : Fill(-1.0f);
      Store(__builtin_convertvector(cell, Int), points.voxel[k] + u);
    }
    Store(inside ? Load(w + u) : Fill(kNaN), w + u);
    found |= inside;
  }
  return Any(found);
}

/// The planes of windows that lack pixels, and the variance of what is left; that is NaN where too
/// many lack.
struct PartFit {
  Float mean, a, b, variance;
};

PartFit FitPart(const float* const* w, int r, int u, const Float& centre) {
  Float count{}, of_u{}, of_v{}, of_uu{}, of_uv{}, of_vv{};
  Float sum{}, square{}, by_u{}, by_v{};
  for (int dv = -r; dv <= r; ++dv) {
    const float* const row = w[dv + r] + u;
    const float v = static_cast<float>(dv);
    Float row_count{}, row_of_u{}, row_sum{};
    for (int du = -r; du <= r; ++du) {
      const float step = static_cast<float>(du);
      const Float off = Load(row + du) - centre;
      const Int measured = off == off;
      const Float d = measured ? off : Fill(0.0f);
      const Float one = measured ? Fill(1.0f) : Fill(0.0f);
      row_count += one;
      row_of_u += step * one;
      of_uu += (step * step) * one;
      row_sum += d;
      square += d * d;
      by_u += step * d;
    }
    count += row_count;
    of_u += row_of_u;
    of_v += v * row_count;
    of_uv += v * row_of_u;
    of_vv += (v * v) * row_count;
    sum += row_sum;
    by_v += v * row_sum;
  }
  // About the mean of the measured pixels.
  const Float per_count = 1.0f / count;
  const Float u_mean = of_u * per_count, v_mean = of_v * per_count, offset = sum * per_count;
  const Float uu = of_uu - of_u * u_mean, uv = of_uv - of_u * v_mean, vv = of_vv - of_v * v_mean;
  const Float to_u = by_u - sum * u_mean, to_v = by_v - sum * v_mean;
  const Float per_determinant = 1.0f / (uu * vv - uv * uv);
  const Float a = (vv * to_u - uv * to_v) * per_determinant;
  const Float b = (uu * to_v - uv * to_u) * per_determinant;
  const Float variance = (square * per_count - offset * offset) - (a * to_u + b * to_v) * per_count;
  const float side = static_cast<float>(2 * r + 1);
  const Int enough = count >= kLeastMeasured * (side * side);
  return {((centre + offset) - a * u_mean) - b * v_mean, a, b, enough ? variance : Fill(kNaN)};
}

template <int kRadius>
void FitOf(const float* const* w, int any_radius, int begin, int end, const FitRow& fits) {
  const int r = kRadius ? kRadius : any_radius;
  const float side = static_cast<float>(2 * r + 1);
  const float count = side * side;
  const float moment = count * static_cast<float>(r * (r + 1)) / 3.0f;  // Σ du² over the window.
  const float per_count = 1.0f / count, per_moment = 1.0f / moment;
  for (int u = RoundDown(begin); u < end; u += kLanes) {
    // Differences to the centre, so that single precision loses nothing.
    const Float centre = Load(w[r] + u);
    Float sum{}, square{}, by_u{}, by_v{};
    for (int dv = -r; dv <= r; ++dv) {
      const float* const row = w[dv + r] + u;
      Float row_sum{};
      for (int du = -r; du <= r; ++du) {
        const Float d = Load(row + du) - centre;
        row_sum += d;
        square += d * d;
        by_u += static_cast<float>(du) * d;
      }
      sum += row_sum;
      by_v += static_cast<float>(dv) * row_sum;
    }
    Float a = by_u * per_moment, b = by_v * per_moment;
    const Float offset = sum * per_count;
    Float mean = centre + offset;
    Float variance = (square * per_count - offset * offset) - (a * by_u + b * by_v) * per_count;
    const Int part = (sum != sum) & (centre == centre);
    if (Any(part)) {
      const PartFit fit = FitPart(w, r, u, centre);
      mean = part ? fit.mean : mean;
      a = part ? fit.a : a;
      b = part ? fit.b : b;
      variance = part ? fit.variance : variance;
    }
    variance = variance < 0.0f ? Fill(0.0f) : variance;
    // An error dw of the inverse depth is an error dw / w² of the depth.
    const Float squared = mean * mean;
    const Float residual = variance / (squared * squared);
    Store(mean, fits.mean + u);
    Store(a, fits.a + u);
    Store(b, fits.b + u);
    Store(residual == residual ? residual : Fill(kInfinity), fits.residual + u);
  }
}

void Fit(const float* const* w, int radius, int begin, int end, const FitRow& fits) {
  if (radius == 2) {
    FitOf<2>(w, radius, begin, end, fits);
  } else {
    FitOf<0>(w, radius, begin, end, fits);
  }
}

void Surface(const float* w, const FitRow* fits, int radius, const RayRow& rays,
             const FitLimits& limits, const float* R, int begin, int end, float* const* normals,
             float* smooth_w) {
  const float r = static_cast<float>(radius);
  for (int u = RoundDown(begin); u < end; u += kLanes) {
    const Float own = Load(w + u);
    const Float z = 1.0f / own;
    const Float deviation = limits.noise_constant + limits.noise_quadratic * (z * z);
    const Float noise = deviation * deviation;
    const Float best_possible = 1.3f * noise + limits.settled_variance;
    Float fitted = Load(fits[1].mean + u), a = Load(fits[1].a + u), b = Load(fits[1].b + u);
    Float residual = Load(fits[1].residual + u);
    // A window beside the pixel's own must be ten times better.
    Float best = residual <= best_possible ? Fill(0.0f) : 0.1f * residual;
    if (Any(best > 0.0f)) {
      for (int row = 0; row < 3; ++row) {
        for (int column = -radius; column <= radius; column += radius) {
          if (row == 1 && column == 0) continue;
          const int at = u + column;
          const Float trial = Load(fits[row].residual + at);
          const Int better = trial < best;
          if (!Any(better)) continue;
          const Float trial_a = Load(fits[row].a + at), trial_b = Load(fits[row].b + at);
          const Float trial_fitted =
              (Load(fits[row].mean + at) - trial_a * static_cast<float>(column)) -
              trial_b * (static_cast<float>(row - 1) * r);
          best = better ? trial : best;
          residual = better ? trial : residual;
          a = better ? trial_a : a;
          b = better ? trial_b : b;
          fitted = better ? trial_fitted : fitted;
        }
      }
    }
    // n · p = d is (n / d) · [x, y, 1] = w; so m = n / d has these components in C.
    const Float m_x = Load(rays.x_by_u + u) * a + Load(rays.x_by_v + u) * b;
    const Float m_y = Load(rays.y_by_u + u) * a + Load(rays.y_by_v + u) * b;
    const Float x = Load(rays.x + u), y = Load(rays.y + u);
    const Float m_z = (fitted - m_x * x) - m_y * y;
    const Float length = Root((m_x * m_x + m_y * m_y) + m_z * m_z);
    const Float ray = Root((x * x + y * y) + 1.0f);
    const Float off = own - fitted;
    const Float squared = fitted * fitted;
    const Int fits_here =
        (residual <= limits.max_variance + 1.3f * noise) &
        (off * off <= (limits.max_variance + 9.0f * noise) * (squared * squared)) &
        (fitted >= limits.min_cosine * (length * ray));
    const Float scale = fits_here ? -1.0f / length : Fill(kNaN);
    const Float n_x = m_x * scale, n_y = m_y * scale, n_z = m_z * scale;
    for (int k = 0; k < 3; ++k) {
      Store((R[3 * k] * n_x + R[3 * k + 1] * n_y) + R[3 * k + 2] * n_z, normals[k] + u);
    }
    if (smooth_w) Store(fits_here ? fitted : Fill(kNaN), smooth_w + u);
  }
}

}  // namespace

extern const DepthKernel kDepth{Invert, Place, Fit, Surface};

}  // namespace prehensile::internal::PREHENSILE_SIMD
