#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "prehensile/distance_field.h"
#include "prehensile/robust_loss.h"

// What a depth image says about rigid bodies whose distance fields are known: the terms of dense
// articulated tracking (Schmidt, Newcombe and Fox, "DART", RSS 2014). A free object is one body; an
// arm is one body per link, whose terms its Jacobians bring together.
//
// A body B is moved by [w; v] in the world W: R_WB ← exp(w) R_WB, p_WB ← p_WB + v.

namespace prehensile {

/// A depth image and where it was taken. C is the camera's frame: x right, y down, z forward.
struct DepthView {
  /// Height rows of width values along z [m]; anything but a number above 0 is no measurement.
  const float* depth = nullptr;
  int width = 0;
  int height = 0;
  /// Focal lengths and principal point [pixels] of a pinhole.
  double fx = 0;
  double fy = 0;
  double cx = 0;
  double cy = 0;
  Eigen::Matrix3d R_WC = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_WC = Eigen::Vector3d::Zero();
  /// Of the same size, not zero where a pixel shows none of the bodies; nullptr for none.
  const std::uint8_t* ignored = nullptr;
};

struct TrackedBody {
  /// Not owned.
  const DistanceField* field = nullptr;
  Eigen::Matrix3d R_WB = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_WB = Eigen::Vector3d::Zero();
  /// A box around its surface, along B's axes; that of the field's grid if it is empty.
  Eigen::AlignedBox3d box;
};

/// Points measured near the bodies.
///
/// The pixels are those of a grid as fine as max_pixels allows over the part of each image where
/// the bodies can be.
///
/// @param others bodies that are in the way, such as a hand: a point within other_margin of one of
///   them, and nearer to it than to any body, is left out.
/// @param max_distance of a point from the nearest body's surface [m].
/// @param max_normal_angle between the surface that the image shows at a point and the body's
///   nearest to it; one that is turned further, as a table's beside a box, is another's [rad].
///   Points whose surface cannot be told from their neighbours stay.
/// @param max_pixels looked at in each image, at least 1.
/// @return rows of x, y, z in W.
/// @throws std::invalid_argument naming the argument.
std::vector<double> PointsNearBodies(const std::vector<DepthView>& views,
                                     const std::vector<TrackedBody>& bodies,
                                     const std::vector<TrackedBody>& others, double max_distance,
                                     double other_margin, double max_normal_angle, int max_pixels);

/// The Gauss-Newton terms of one body: the cost near its pose is
/// cost + 2 gradient · d + d · information d for a motion d = [w; v].
struct BodyTerm {
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
  double cost = 0;
  /// Sum of the weights, and of weight times squared residual.
  double weight = 0;
  double weighted_squares = 0;
};

/// The robust squared distances of points to the nearest surface of any body.
///
/// @param points n rows of x, y, z in W.
/// @return one term per body.
/// @throws std::invalid_argument naming the argument.
std::vector<BodyTerm> SurfaceTerms(const double* points, std::size_t n,
                                   const std::vector<TrackedBody>& bodies, RobustLoss loss,
                                   double loss_scale);

/// Samples of a body's surface.
struct SurfaceSamples {
  const double* points = nullptr;   ///< n rows, in B.
  const double* normals = nullptr;  ///< n rows of unit length, outward, in B.
  std::size_t n = 0;
};

struct FreeSpaceOptions {
  /// How far in front of the measured depth a surface may be [m].
  double margin = 0.01;
  /// Deeper violations count as this deep [m].
  double max_violation = 0.05;
  /// How far to look for the edge of the free space beside a sample, >= 0 [pixels].
  int search_radius = 12;
};

/// What the images say of a body's samples that face a camera.
struct SampleCounts {
  std::int64_t facing = 0;    ///< In the image, on the near side.
  std::int64_t seen = 0;      ///< Measured where they should be, or aside, up to the margin.
  std::int64_t in_free = 0;   ///< Where the camera saw through.
  std::int64_t occluded = 0;  ///< Behind something.
  std::int64_t unknown = 0;   ///< No measurement there, or ignored pixels.
};

/// Squared violations of the free space by the bodies' samples: along the rays the camera saw
/// through, nothing can be. A sample there is drawn out on the shorter way: away from the camera,
/// or sideways to where something was measured at its depth or nearer.
///
/// @param terms one per body, added to.
/// @return one per body, over all images.
/// @throws std::invalid_argument naming the argument.
std::vector<SampleCounts> AddFreeSpaceTerms(const std::vector<DepthView>& views,
                                            const std::vector<TrackedBody>& bodies,
                                            const std::vector<SurfaceSamples>& samples,
                                            const FreeSpaceOptions& options, double weight,
                                            std::vector<BodyTerm>* terms);

/// How far points lie in space that a camera saw through: measured depth - margin - own depth where
/// that is positive, else 0 [m].
///
/// @param points n rows of x, y, z in W.
/// @param violations room for n.
void FreeSpaceViolation(const DepthView& view, const double* points, std::size_t n, double margin,
                        double* violations);

}  // namespace prehensile
