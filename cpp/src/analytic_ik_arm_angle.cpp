// Arms of seven joints with a spherical shoulder and a spherical wrist: the choice among all arm
// angles; see SrsArm.

#include <numbers>

#include "analytic_ik_srs.h"

namespace prehensile {

using Eigen::Matrix3d;
using internal::kElbow;
using internal::kShoulder;
using internal::kWrist;
using internal::Turn;

namespace {

constexpr double kPi = std::numbers::pi;

/// constant + cosine cos ψ + sine sin ψ.
struct Wave {
  double constant = 0, cosine = 0, sine = 0;
  double operator()(const Turn& psi) const { return constant + cosine * psi.c + sine * psi.s; }
};

Wave operator*(double k, const Wave& a) { return {k * a.constant, k * a.cosine, k * a.sine}; }
Wave operator-(const Wave& a, const Wave& b) {
  return {a.constant - b.constant, a.cosine - b.cosine, a.sine - b.sine};
}

/// Entry (i, j) of G Rx(±ψ) H.
Wave Entry(const Matrix3d& G, const Matrix3d& H, double sign, int i, int j) {
  return {G(i, 0) * H(0, j), G(i, 1) * H(1, j) + G(i, 2) * H(2, j),
          sign * (G(i, 2) * H(1, j) - G(i, 1) * H(2, j))};
}

/// Adds the zeros of a wave, in [-π, π).
void AddZeros(const Wave& wave, int* count, double* zeros) {
  const double amplitude = std::hypot(wave.cosine, wave.sine);
  // The second: a wave that only just touches zero is taken to do so.
  if (amplitude < 1e-14 || std::abs(wave.constant) > amplitude * (1 + 1e-12)) return;
  const double middle = std::atan2(wave.sine, wave.cosine);
  const double half = std::acos(std::clamp(-wave.constant / amplitude, -1.0, 1.0));
  for (double zero : {middle - half, middle + half}) {
    if (zero < -kPi) zero += 2 * kPi;
    if (zero >= kPi) zero -= 2 * kPi;
    zeros[(*count)++] = zero;
  }
}

}  // namespace

/// The joint angles of one branch as functions of ψ: joint 4 is constant, joints 2 and 6 have a
/// wave for a cosine, the others waves for sine and cosine.
struct SrsArm::Forms {
  const SrsArm* arm;
  Wave sine[7], cosine[7];
  double middle_sign[7];

  Turn Angle(int joint, const Turn& psi) const {
    const double c = cosine[joint](psi);
    if (joint != 1 && joint != 5) return {c, sine[joint](psi)};
    return {c, middle_sign[joint] * std::sqrt(std::max(0.0, 1 - c * c))};
  }

  /// The configurations at eight arm angles, to the equivalents nearest to q_near; q is [7][8].
  void Evaluate(const double* psi, const double* q_near, double* q) const {
    Pattern pattern;
    for (int k = 0; k < internal::kLanes; ++k) {
      const Turn turn = internal::TurnBy(psi[k]);
      for (int j = 0; j < 7; ++j) pattern.Set(j, k, Angle(j, turn));
    }
    internal::BestJointAngles()(&pattern.s[0][0], &pattern.c[0][0], arm->sign_.data(),
                                arm->offset_.data(), q_near, 7, q);
  }

  bool WithinLimits(double psi) const {
    const Turn turn = internal::TurnBy(psi);
    for (int j = 0; j < 7; ++j) {
      const Turn angle = Angle(j, turn);
      double q = std::atan2(angle.s, angle.c) - arm->offset_[j];
      if (!arm->WithinLimits(j, 0, &q)) return false;
    }
    return true;
  }
};

SrsArm::Forms SrsArm::MakeForms(const Target& target, int branch) const {
  Forms forms{.arm = this};
  const double elbow = branch & kElbow ? -1 : 1;
  // Z = Rz(first) Ry(middle) Rz(last), as in Fill.
  const auto fill = [&](const Matrix3d& G, const Matrix3d& H, double psi_sign, int first,
                        double sign) {
    const auto entry = [&](int i, int j) { return Entry(G, H, psi_sign, i, j); };
    forms.sine[first] = sign * entry(1, 2);
    forms.cosine[first] = sign * entry(0, 2);
    forms.cosine[first + 1] = entry(2, 2);
    forms.middle_sign[first + 1] = sign;
    forms.sine[first + 2] = sign * entry(2, 1);
    forms.cosine[first + 2] = -sign * entry(2, 0);
  };
  fill(F1_.transpose() * target.D0, target.UpperArm(elbow) * U0tF3_, 1, 0,
       branch & kShoulder ? -1 : 1);
  fill(F5tL0_ * target.Forearm(elbow).transpose(), target.D0.transpose() * target.R_7, -1, 4,
       branch & kWrist ? -1 : 1);
  forms.cosine[3].constant = target.bend.c;
  forms.sine[3].constant = elbow * target.bend.s;
  return forms;
}

AngleIntervals SrsArm::IntervalsOf(const Forms& forms) const {
  // A joint can enter or leave its limits only where its angle is at one of them. Between two
  // neighbouring such arm angles all joints stay within or one without.
  double ends[32];
  int count = 0;
  for (const int j : {0, 1, 2, 4, 5, 6}) {
    if (upper_[j] - lower_[j] >= 2 * kPi) continue;
    for (const double limit : {lower_[j], upper_[j]}) {
      const Turn turn = internal::TurnBy(limit + offset_[j]);
      if (j == 1 || j == 5) {
        AddZeros(forms.cosine[j] - Wave{turn.c, 0, 0}, &count, ends);
      } else {
        AddZeros(turn.c * forms.sine[j] - turn.s * forms.cosine[j], &count, ends);
      }
    }
  }
  std::sort(ends, ends + count);
  count = static_cast<int>(
      std::unique(ends, ends + count, [](double a, double b) { return b - a < 1e-12; }) - ends);
  AngleIntervals intervals;
  const auto whole = [&] {
    intervals.count = 1;
    intervals.bounds[0] = {-kPi, kPi};
  };
  if (count == 0) {
    if (forms.WithinLimits(0)) whole();
    return intervals;
  }
  bool within[32];
  const auto end_of = [&](int i) { return i + 1 < count ? ends[i + 1] : ends[0] + 2 * kPi; };
  for (int i = 0; i < count; ++i) within[i] = forms.WithinLimits(0.5 * (ends[i] + end_of(i)));
  if (std::all_of(within, within + count, [](bool value) { return value; })) {
    whole();
    return intervals;
  }
  for (int i = 0; i < count; ++i) {
    if (!within[i] || within[(i + count - 1) % count]) continue;  // Not the first of a run.
    int last = i;
    while (within[(last + 1) % count]) ++last;
    const double upper = last < count ? end_of(last) : end_of(last - count) + 2 * kPi;
    intervals.bounds[intervals.count++] = {ends[i], upper};
  }
  return intervals;
}

AngleIntervals SrsArm::Intervals(const double* X_WG, int branch, IkStatus* status) const {
  if (branch < 0 || branch >= internal::kLanes) {
    throw std::invalid_argument("branch: must be 0 to 7");
  }
  Target target;
  *status = Prepare(X_WG, &target);
  if (*status != IkStatus::kSolved) return {};
  const AngleIntervals intervals = IntervalsOf(MakeForms(target, branch));
  if (intervals.count == 0) *status = IkStatus::kLimits;
  return intervals;
}

ArmAngleChoice SrsArm::Choice(const Target& target, double psi, int branch,
                              const double* q_near) const {
  ArmAngleChoice choice{.psi = std::remainder(psi, 2 * kPi), .branch = branch};
  const IkOptions options{.q_near = q_near};
  Pattern pattern;
  IkSolutions solutions;
  Fill(target, psi, options, &pattern);
  Finish(pattern, options, &solutions);
  for (int k = 0; k < solutions.count; ++k) {
    // At a singular pose the branches that differ there are one.
    if (solutions.branch[k] != branch && k + 1 < solutions.count) continue;
    choice.branch = solutions.branch[k];
    std::copy_n(solutions.q.data() + 7 * k, 7, choice.q.data());
    return choice;
  }
  choice.status = IkStatus::kLimits;
  return choice;
}

template <typename Cost>
ArmAngleChoice SrsArm::Minimize(const double* X_WG, const double* q_near, const Cost& cost) const {
  constexpr int kLanes = internal::kLanes;
  Target target;
  const IkStatus status = Prepare(X_WG, &target);
  if (status != IkStatus::kSolved) return {.status = status};
  double best = std::numeric_limits<double>::infinity(), best_psi = 0;
  int best_branch = -1;
  for (int branch = 0; branch < kLanes; ++branch) {
    const Forms forms = MakeForms(target, branch);
    const AngleIntervals intervals = IntervalsOf(forms);
    for (int i = 0; i < intervals.count; ++i) {
      const auto [begin, end] = intervals.bounds[i];
      // Evaluates cost at eight points; q at the ends may be outside limits by rounding only.
      double found = std::numeric_limits<double>::infinity(), found_psi = begin;
      const auto scan = [&](double lower, double upper, int first, int parts) {
        double psi[kLanes], q[7 * kLanes];
        for (int k = 0; k < kLanes; ++k) {
          psi[k] = lower + (upper - lower) * std::min(first + k, parts) / parts;
        }
        forms.Evaluate(psi, q_near, q);
        for (int k = 0; k < kLanes; ++k) {
          double row[7];
          for (int j = 0; j < 7; ++j) {
            row[j] = q[j * kLanes + k];
            if (!WithinLimits(j, q_near[j], row + j)) {
              row[j] = std::clamp(row[j], lower_[j], upper_[j]);
            }
          }
          const double value = cost(row);
          if (value < found) {
            found = value;
            found_psi = psi[k];
          }
        }
      };
      const int parts = std::max(7, static_cast<int>(std::ceil((end - begin) / 0.1)));
      for (int first = 0; first <= parts; first += kLanes) scan(begin, end, first, parts);
      // Then ever narrower about the best.
      for (double step = (end - begin) / parts; step > 1e-10; step *= 2.0 / 9) {
        const double lower = std::max(begin, found_psi - step);
        const double upper = std::min(end, found_psi + step);
        scan(lower, upper, 1, 9);
      }
      if (found < best) {
        best = found;
        best_psi = found_psi;
        best_branch = branch;
      }
    }
  }
  ArmAngleChoice choice{.status = IkStatus::kLimits};
  if (best_branch >= 0) choice = Choice(target, best_psi, best_branch, q_near);
  best = choice.status == IkStatus::kSolved ? cost(choice.q.data())
                                            : std::numeric_limits<double>::infinity();
  // Where joint 2 or 6 is straight, joints beside it are free, which those at neighbouring arm
  // angles are not; and at a stretched elbow over the base all arm angles are so.
  const auto try_singular = [&](double psi, int elbow) {
    for (const int branch : {0, kShoulder, kWrist, kShoulder | kWrist}) {
      const ArmAngleChoice other = Choice(target, psi, branch | elbow, q_near);
      if (other.status != IkStatus::kSolved || !(cost(other.q.data()) < best)) continue;
      choice = other;
      best = cost(other.q.data());
    }
  };
  for (const int elbow : {0, kElbow}) {
    const Forms forms = MakeForms(target, elbow);
    for (const int joint : {1, 5}) {
      const Wave& wave = forms.cosine[joint];
      const double amplitude = std::hypot(wave.cosine, wave.sine);
      const double highest = std::atan2(wave.sine, wave.cosine);
      if (amplitude + wave.constant > 1 - 1e-12) try_singular(highest, elbow);
      if (amplitude - wave.constant > 1 - 1e-12) try_singular(highest + kPi, elbow);
      int branch;
      if (amplitude < 1e-9) try_singular(ArmAngle(q_near, &branch), elbow);
    }
  }
  return choice;
}

ArmAngleChoice SrsArm::Closest(const double* X_WG, const double* q) const {
  return Minimize(X_WG, q, [q](const double* row) {
    double sum = 0;
    for (int j = 0; j < 7; ++j) sum += (row[j] - q[j]) * (row[j] - q[j]);
    return sum;
  });
}

ArmAngleChoice SrsArm::FarthestFromLimits(const double* X_WG) const {
  double middle[7];
  for (int j = 0; j < 7; ++j) {
    const double sum = lower_[j] + upper_[j];
    middle[j] = std::isfinite(sum) ? 0.5 * sum : 0;
  }
  return Minimize(X_WG, middle, [&](const double* row) {
    double worst = 0;
    for (int j = 0; j < 7; ++j) {
      const double half = 0.5 * (upper_[j] - lower_[j]);
      if (half > 0 && std::isfinite(half)) {
        worst = std::max(worst, std::abs(row[j] - middle[j]) / half);
      }
    }
    return worst;
  });
}

ArmAngleChoice SrsArm::WidestInterval(const double* X_WG) const {
  Target target;
  const IkStatus status = Prepare(X_WG, &target);
  if (status != IkStatus::kSolved) return {.status = status};
  double widest = 0, psi = 0;
  int best_branch = -1;
  for (int branch = 0; branch < internal::kLanes; ++branch) {
    const AngleIntervals intervals = IntervalsOf(MakeForms(target, branch));
    for (int i = 0; i < intervals.count; ++i) {
      const auto [begin, end] = intervals.bounds[i];
      if (end - begin <= widest) continue;
      widest = end - begin;
      psi = 0.5 * (begin + end);
      best_branch = branch;
    }
  }
  if (best_branch < 0) return {.status = IkStatus::kLimits};
  return Choice(target, psi, best_branch, nullptr);
}

}  // namespace prehensile
