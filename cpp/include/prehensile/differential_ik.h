#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "prehensile/quadratic_program.h"

namespace prehensile {

/// Greatest number of joints, and of rows of all tasks together.
inline constexpr int kMaxIkJoints = 32;
inline constexpr int kMaxIkRows = 96;

/// Limits of n joints (rad or m, and per second).
struct JointLimits {
  /// May be infinite.
  std::vector<double> position_lower;
  std::vector<double> position_upper;
  /// Greatest speeds, >= 0 (0 holds a joint where it is), may be infinite.
  std::vector<double> velocity;
  /// Greatest accelerations, > 0, may be infinite.
  std::vector<double> acceleration;
};

/// Speed towards an end of its range that a joint may have in the next period so that it can still
/// stop there: it moves one period at this speed and slows down by `acceleration * period` in each
/// further one. Odd in `room`, so that beyond the end it is the (negative) speed of coming back
/// that ends at rest on it.
///
/// @param room distance to the end (rad or m); negative beyond it.
/// @param acceleration > 0, may be infinite.
/// @param period > 0 (s).
double BrakeSpeed(double room, double acceleration, double period);

enum class IkFormulation {
  /// Weighted least squares of all tasks together.
  kLeastSquares,
  /// The greatest part alpha <= 1 of the desired velocity, in exactly its direction.
  kDirection,
  /// Least squares, level by level, none of which disturbs those before it.
  kPriorities,
  /// Least squares without limits, cut off joint by joint afterwards, as a robot's own controller
  /// would: the (damped) pseudo-inverse. Constraints are not looked at.
  kSaturated,
};

enum class IkCentering {
  kNone,
  /// ε |P (v − v_c)|², the rows of P an orthonormal basis of the kernel of J.
  kNullspace,
  /// ε |v − v_c|².
  kPosture,
};

struct DifferentialIkOptions {
  /// Time step h in s, > 0.
  double period = 0.005;
  IkFormulation formulation = IkFormulation::kLeastSquares;
  /// λ of the damping λ² |v|² (s·m or s·rad, >= 0).
  double damping = 0.0;
  IkCentering centering = IkCentering::kNone;
  /// ε, > 0.
  double centering_weight = 0.01;
  /// v_c = gain (nominal − q): n gains in 1/s and n positions; empty without centering.
  std::vector<double> centering_gain;
  std::vector<double> nominal_position;
  /// What alpha = 1 is worth beside |P (v − v_c)|² in kDirection, > 0.
  double direction_weight = 100.0;
  /// Rows of a Jacobian count as dependent below this share of the longest row.
  double rank_tolerance = 1e-6;
};

enum class DifferentialIkStatus {
  kOptimal = 0,
  /// Optimal, but a joint started beyond its limits, or too fast to stop within them; it comes back
  /// as fast as its limits of acceleration and velocity permit.
  kRecovering = 1,
  /// The linear constraints contradict the joints' limits (or each other); they are violated as
  /// little as possible.
  kRelaxed = 2,
  /// No solution was found, or none exists in the desired direction: the joints slow down as much
  /// as they may.
  kBraking = 3,
};

/// The next joint velocities, and how they came about.
struct IkStep {
  int n = 0;
  DifferentialIkStatus status = DifferentialIkStatus::kBraking;
  /// Of kDirection: the part of V achieved. 1 otherwise.
  double alpha = 1.0;
  /// Greatest violation of a linear constraint.
  double violation = 0.0;
  int iterations = 0;
  double v[kMaxIkJoints];
  /// The interval that limits and state allow.
  double lower[kMaxIkJoints];
  double upper[kMaxIkJoints];
};

/// Rows J v ≈ V to be achieved: J is num × n, row-major.
struct IkTaskRows {
  int num = 0;
  const double* J = nullptr;
  const double* V = nullptr;
  /// num weights w >= 0 of (w (J v − V))², or nullptr for ones.
  const double* weights = nullptr;
  /// Of kPriorities: number of rows in each level, first to last; nullptr for a single level.
  const int* level_sizes = nullptr;
  int num_levels = 1;
};

/// One step of differential inverse kinematics: from joint state and tasks to the next velocities.
///
/// Whatever the tasks, v keeps the limits of velocity and acceleration exactly (but for rounding),
/// and q + h v those of position, now and in all steps to come: every joint moves only so fast that
/// it can still stop at the end of its range.
///
/// All methods are const and may be called from many threads.
class DifferentialIk {
 public:
  /// @throws std::invalid_argument naming the argument.
  DifferentialIk(JointLimits limits, DifferentialIkOptions options);

  int num_joints() const { return n_; }
  const DifferentialIkOptions& options() const { return options_; }
  const JointLimits& limits() const { return limits_; }

  /// @param q, v n joint positions and velocities.
  /// @param constraints on v, to hold at all levels.
  /// All numbers are finite (not checked), but for infinite sides of constraints.
  void Step(const double* q, const double* v, const IkTaskRows& tasks,
            const LinearRows& constraints, IkStep* step) const;

  /// Step() for each of N states with a J (num × n), a V and constraint sides of its own; arrays
  /// hold them one after another. Non-finite numbers are not looked for.
  ///
  /// @param v_next room for N n numbers. @param status room for N numbers.
  /// @param num_threads at least 1; it does not change the result.
  void StepBatch(std::size_t N, const double* q, const double* v, const IkTaskRows& tasks,
                 const LinearRows& constraints, double* v_next, std::int32_t* status,
                 int num_threads) const;

  /// The interval of the next velocities, and whether the state was beyond what the limits allow.
  bool VelocityInterval(const double* q, const double* v, double* lower, double* upper) const;

 private:
  bool LeastSquares(const IkTaskRows& tasks, const LinearRows& constraints, const double* v_c,
                    bool relaxed, IkStep* step) const;
  bool Direction(const IkTaskRows& tasks, const LinearRows& constraints, const double* v_c,
                 IkStep* step) const;
  void Priorities(const IkTaskRows& tasks, const LinearRows& constraints, const double* v_c,
                  IkStep* step) const;

  int n_;
  JointLimits limits_;
  DifferentialIkOptions options_;
};

}  // namespace prehensile
