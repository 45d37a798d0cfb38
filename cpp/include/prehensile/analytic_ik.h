#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace prehensile {

/// A chain of revolute joints as the lines they turn about (product of exponentials): with
/// T_i(q) the turn by q about line i,
///   X_WG(q) = T_1(q₁) T_2(q₂) ⋯ T_n(q_n) X_WG(0).
struct ArmLines {
  /// Directions of the lines at q = 0, unit vectors in W.
  std::vector<Eigen::Vector3d> axes;
  /// One point on each line at q = 0, in W.
  std::vector<Eigen::Vector3d> points;
  /// Pose of the tool frame G at q = 0.
  Eigen::Matrix4d X_WG0;
  /// Joint limits; infinite where there are none.
  std::vector<double> lower, upper;
};

enum class IkStatus : std::uint8_t {
  kSolved,
  /// The target lies beyond the stretched arm.
  kTooFar,
  /// The target lies too near to the base axis or to the folded arm.
  kTooNear,
  /// There are solutions, but none within the joint limits.
  kLimits,
};

/// All solutions for one pose, in the order of their branches.
struct IkSolutions {
  static constexpr int kMax = 8;
  static constexpr int kMaxJoints = 7;
  IkStatus status = IkStatus::kSolved;
  int num_joints = 0;
  int count = 0;
  /// Branch of each: bit 2 the shoulder, bit 1 the elbow, bit 0 the wrist; a bit is set where the
  /// sign is negative.
  std::array<std::uint8_t, kMax> branch;
  /// Row per solution.
  std::array<double, kMax * kMaxJoints> q;
};

/// What to do with limits and with joints that a pose leaves free.
struct IkOptions {
  /// n values: each joint's angle is the equivalent (by whole turns) nearest to this that is within
  /// the limits, and where a singular pose leaves a joint free it gets this value. Null for zeros.
  /// Not checked; far from zero it costs digits, as many as it has before the point.
  const double* q_near = nullptr;
  /// Whether solutions outside the joint limits are left out.
  bool limits = true;
};

/// Closed intervals of an angle, each within [-π, 3π], lower ends ascending in [-π, π).
struct AngleIntervals {
  int count = 0;
  std::array<std::array<double, 2>, 32> bounds;
};

namespace internal {

/// A unit vector of the plane, as an angle.
struct Turn {
  double c = 1, s = 0;
};

/// Two links that turn about parallel axes.
struct PlanarElbow {
  PlanarElbow() = default;
  PlanarElbow(double upper_length, double fore_length)
      : upper(upper_length),
        fore(fore_length),
        half_inverse_upper(0.5 / upper),
        half_inverse_fore(0.5 / fore),
        scale(half_inverse_upper * half_inverse_fore) {}
  double upper, fore;  // Lengths.
  double half_inverse_upper, half_inverse_fore, scale;
  /// Cosine and sine >= 0 of the angle between the links when they span a distance.
  IkStatus Bend(double distance, Turn* bend) const;
  /// Angles, not normalized, of upper arm and forearm with the line from end to end, whose length's
  /// square is given.
  Turn UpperAngle(double square, const Turn& bend) const;
  Turn ForeAngle(double square, const Turn& bend) const;
};

/// Joint 1 perpendicular to the parallel joints 2 and 3: the first three of most 6-joint arms.
struct ParallelShoulder {
  Eigen::Matrix3d B;      // [axis 1 × axis 2, axis 1, axis 2], the frame of all that follows.
  Eigen::Vector3d point;  // On axis 1, in W.
  double side;            // Coordinate along axis 2 of the point P that is to be reached.
  double x2, y2;          // Where axis 2 is.
  PlanarElbow elbow;
  double upper_angle, bend_angle;  // Of the upper arm, and between the links, at q = 0.

  /// The two solutions for joint 1, as turns, and the coordinates of P after turning back by them.
  IkStatus Base(const Eigen::Vector3d& P, double q1_free, Turn turns[2], Eigen::Vector3d P_1[2],
                int* count) const;
  /// The direction, not normalized, of the upper arm that, bent so, points to (x, y) from axis 2.
  Turn Upper(double x, double y, const Turn& bend, double free_angle) const;
};

/// Joints 1 and 2 that meet in a point, and any joint 3.
struct MeetingShoulder {
  Eigen::Vector3d point;  // Where axes 1 and 2 meet.
  Eigen::Vector3d h1, h2, h3;
  double constant, cosine, sine;          // |P - point|² as a function of joint 3.
  Eigen::Vector3d along, across, height;  // P - point = height + along cos q₃ + across sin q₃.
};

}  // namespace internal

/// A solution that was chosen among all arm angles and branches.
struct ArmAngleChoice {
  IkStatus status = IkStatus::kSolved;
  double psi = 0;
  int branch = 0;
  std::array<double, 7> q;
};

/// What arms of all types have in common. All methods are const and may be called from many
/// threads.
class AnalyticArm {
 public:
  int num_joints() const { return n_; }
  const std::array<double, 8>& lower() const { return lower_; }
  const std::array<double, 8>& upper() const { return upper_; }

  /// Forward kinematics: X_WG(q), row major.
  void Pose(const double* q, double* X_WG) const;

 protected:
  struct Pattern;  // Cosines and sines of the joint angles of all branches.

  AnalyticArm(const ArmLines& lines, int num_joints);
  ~AnalyticArm() = default;

  void Finish(const Pattern& pattern, const IkOptions& options, IkSolutions* out) const;
  /// The equivalent of an angle, by whole turns, that is within a joint's limits and nearest to
  /// `near`; false if none is.
  bool WithinLimits(int joint, double near, double* q) const;
  /// The pattern angle of a joint that a singular pose leaves free.
  double FreeAngle(int joint, const IkOptions& options) const;
  /// Turns of the first `count` joints: a point and a direction of the chain, moved.
  Eigen::Vector3d MovePoint(const double* q, int count, Eigen::Vector3d point) const;
  Eigen::Vector3d MoveDirection(const double* q, int count, Eigen::Vector3d direction) const;
  Eigen::Vector3d InTool(const Eigen::Vector3d& point) const;
  Eigen::Matrix3d InTool(const Eigen::Matrix3d& frame) const;

  int n_;
  ArmLines lines_;
  // The solvers compute pattern angles θ = sign q + offset.
  std::array<double, 8> sign_{}, offset_{}, lower_{}, upper_{};
};

/// Poses for SolveBatch.
struct IkBatch {
  std::size_t num_poses;
  /// (num_poses, 4, 4).
  const double* X_WG;
  /// n values for all poses, or n for each if near_each, or null.
  const double* q_near;
  bool near_each;
  bool limits;
  int num_threads;
  /// Result: (num_poses, 8, n), row per branch, NaN where a branch has no solution.
  double* q;
  /// Result: (num_poses).
  std::uint8_t* status;
};

/// Arms of seven joints whose first three axes meet in one point S, the last three in one point W,
/// with axis 1 ⊥ axis 2 ⊥ axis 3 and axis 5 ⊥ axis 6 ⊥ axis 7, and whose elbow axis 4 is
/// perpendicular to a plane through S and W. The elbow E is where axis 4 meets this plane.
///
/// The arm angle ψ is the angle about d = (W - S) / |W - S|, counted by the right-hand rule, from
/// the half plane at line SW that contains the direction of axis 1 to the half plane that contains
/// E. Where d is parallel to axis 1, (axis 2 × axis 1) at q = 0 takes the place of axis 1. At the
/// stretched elbow, where E lies on SW, the limit of small bends counts.
///
/// Branches: bit 2 is set where the sine of the angle from axis 1 to axis 3 about axis 2 is
/// negative; bit 1 the same of the angle from E - S to W - E about axis 4; bit 0 the same of the
/// angle from axis 5 to axis 7 about axis 6.
///
/// M. Shimizu et al., "Analytical Inverse Kinematic Computation for 7-DOF Redundant Manipulators
/// With Joint Limits and Its Application to Redundancy Resolution", IEEE T-RO 24(5), 2008;
/// C. Faria et al., "Position-based kinematics for 7-DoF serial manipulators with global
/// configuration control, joint limit and singularity avoidance", Mech. Mach. Theory 121, 2018.
class SrsArm final : public AnalyticArm {
 public:
  /// Throws std::invalid_argument, saying what does not hold, if the arm is not of this type to
  /// within tolerance (m and rad).
  SrsArm(const ArmLines& lines, double tolerance);

  /// All solutions with one arm angle. X_WG is row major.
  void Solve(const double* X_WG, double psi, const IkOptions& options, IkSolutions* out) const;
  void SolveBatch(const IkBatch& batch, const double* psi) const;

  /// The arm angles at which a branch reaches the target within all joint limits. Intervals of no
  /// width are left out.
  AngleIntervals Intervals(const double* X_WG, int branch, IkStatus* status) const;

  /// Of all arm angles and branches within the limits, the configuration with the smallest
  /// Euclidean distance to q. Each interval is sampled every 0.1 rad or finer, the best sample
  /// refined by golden section.
  ArmAngleChoice Closest(const double* X_WG, const double* q) const;

  /// The same, with the largest smallest distance to a joint limit, each as a fraction of half its
  /// joint's range.
  ArmAngleChoice FarthestFromLimits(const double* X_WG) const;

  /// The centre of the widest of all intervals of arm angles.
  ArmAngleChoice WidestInterval(const double* X_WG) const;

  /// Arm angle in (-π, π], and branch, of a configuration.
  double ArmAngle(const double* q, int* branch) const;

 private:
  struct Target;
  struct Forms;
  IkStatus Prepare(const double* X_WG, Target* target) const;
  void Reference(const Eigen::Vector3d& d, Eigen::Matrix3d* D0) const;
  void Fill(const Target& target, double psi, const IkOptions& options, Pattern* pattern) const;
  Forms MakeForms(const Target& target, int branch) const;
  AngleIntervals IntervalsOf(const Forms& forms) const;
  template <typename Cost>
  ArmAngleChoice Minimize(const double* X_WG, const double* q_near, const Cost& cost) const;
  ArmAngleChoice Choice(const Target& target, double psi, int branch, const double* q_near) const;

  Eigen::Vector3d S_, p_GW_;
  internal::PlanarElbow elbow_;
  Eigen::Matrix3d F1_;     // [axis 2 × axis 1, axis 2, axis 1]; of the others likewise.
  Eigen::Matrix3d R_GF7_;  // [axis 6 × axis 7, axis 6, axis 7].
  Eigen::Matrix3d U0tF3_;  // Joint 3's frame in that of the upper arm.
  Eigen::Matrix3d F5tL0_;  // The forearm's frame in that of joint 5.
};

/// Arms of six joints whose axes 2, 3 and 4 are parallel, with axis 1 ⊥ axis 2, axis 4 ⊥ axis 5 ⊥
/// axis 6, and axes 5 and 6 meeting in one point P (Universal Robots).
///
/// Branches: bit 2 (shoulder) is set where (axis 1 × axis 2)·(P - axis 1) is negative; bit 1
/// (elbow) where the sine of the angle from upper arm to forearm about axis 2 is negative; bit 0
/// (wrist) where that of the angle from axis 2 to axis 6 about axis 5 is negative.
///
/// K. P. Hawkins, "Analytic Inverse Kinematics for the Universal Robots UR-5/UR-10 Arms", Georgia
/// Tech, 2013; here for lines, without Denavit-Hartenberg frames.
class UrArm final : public AnalyticArm {
 public:
  /// As SrsArm's.
  UrArm(const ArmLines& lines, double tolerance);

  void Solve(const double* X_WG, const IkOptions& options, IkSolutions* out) const;
  void SolveBatch(const IkBatch& batch) const;
  int Branch(const double* q) const;

 private:
  internal::ParallelShoulder shoulder_;
  Eigen::Vector3d P0_, p_GP_;
  Eigen::Matrix3d R_GF6_;                    // [axis 5 × axis 6, axis 5, axis 6].
  double wrist_length_, wrist_x_, wrist_y_;  // From axis 4 to P, in joint 5's frame.
};

/// Arms of six joints whose last three axes meet in one point P, with axis 4 ⊥ axis 5 ⊥ axis 6, and
/// of whose first three either 2 and 3 are parallel and 1 is perpendicular to them (PUMA, KUKA KR,
/// ABB IRB; with any offsets) or 1 and 2 meet in a point.
///
/// Branches: bit 0 (wrist) is set where the sine of the angle from axis 4 to axis 6 about axis 5 is
/// negative. Bits 2 and 1 (shoulder, elbow) are UrArm's if axes 2 and 3 are parallel; else bit 2 is
/// set where (axis 1 × axis 2)·(P - S) is negative, S where they meet, and bit 1 where the sine of
/// joint 3's angle, counted from the longest reach, is negative.
///
/// D. L. Pieper, "The Kinematics of Manipulators under Computer Control", Stanford, 1968.
class PieperArm final : public AnalyticArm {
 public:
  /// As SrsArm's.
  PieperArm(const ArmLines& lines, double tolerance);

  void Solve(const double* X_WG, const IkOptions& options, IkSolutions* out) const;
  void SolveBatch(const IkBatch& batch) const;
  int Branch(const double* q) const;

 private:
  // P and joint 6's frame as they are to be.
  void SolveParallel(const Eigen::Vector3d& P, const Eigen::Matrix3d& R_6, const IkOptions& options,
                     Pattern* pattern) const;
  void SolveMeeting(const Eigen::Vector3d& P, const Eigen::Matrix3d& R_6, const IkOptions& options,
                    Pattern* pattern) const;
  void SetWrist(const Eigen::Matrix3d& Z, const IkOptions& options,
                const internal::Turn (&theta)[3], int lane, Pattern* pattern) const;

  bool parallel_;
  internal::ParallelShoulder shoulder_;
  internal::MeetingShoulder meeting_;
  Eigen::Vector3d P0_, p_GP_;
  Eigen::Matrix3d R_GF6_;  // [axis 5 × axis 6, axis 5, axis 6].
  Eigen::Matrix3d F4t_;    // [axis 5 × axis 4, axis 5, axis 4]ᵀ, times the turn of the forearm.
};

}  // namespace prehensile
