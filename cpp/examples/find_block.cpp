// From two depth images to the pose of a known object: fuses the images to a cloud with normals,
// and aligns a model of an L-shaped block to it.

#include <prehensile/depth_fusion.h>
#include <prehensile/icp.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

struct Box {
  Vector3d centre, half;
};

// The block in its own frame O [m].
const std::array<Box, 2> kBlock{
    {{{0, 0, 0}, {0.06, 0.03, 0.02}}, {{0.04, 0, 0.04}, {0.02, 0.03, 0.02}}}};

/// How far along a ray the block begins, in O; infinity if the ray passes by.
double Range(const Vector3d& origin, const Vector3d& direction) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Box& box : kBlock) {
    const Eigen::Array3d a = (box.centre - box.half - origin).array() / direction.array();
    const Eigen::Array3d b = (box.centre + box.half - origin).array() / direction.array();
    const double enter = a.min(b).maxCoeff(), leave = a.max(b).minCoeff();
    if (enter < leave && enter > 0) nearest = std::min(nearest, enter);
  }
  return nearest;
}

/// A camera at `eye` that looks at the origin of W: z forward, x right, y down.
Isometry3d LookAtOrigin(const Vector3d& eye) {
  Isometry3d X_WC = Isometry3d::Identity();
  const Vector3d z = -eye.normalized(), x = z.cross(Vector3d::UnitZ()).normalized();
  X_WC.linear() << x, z.cross(x), z;
  X_WC.translation() = eye;
  return X_WC;
}

/// Points and normals of the block's surface, in O, every 3 mm.
void SampleModel(std::vector<double>* points, std::vector<double>* normals) {
  for (const Box& box : kBlock) {
    for (int face = 0; face < 6; ++face) {
      const int axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
      for (double s = -box.half[u]; s <= box.half[u]; s += 0.003) {
        for (double t = -box.half[v]; t <= box.half[v]; t += 0.003) {
          Vector3d p = box.centre, n = Vector3d::Zero();
          n[axis] = face % 2 ? 1 : -1;
          p[axis] += n[axis] * box.half[axis];
          p[u] += s;
          p[v] += t;
          // Where the boxes touch there is no surface.
          const Vector3d outside = p + 1e-4 * n;
          const bool covered = std::any_of(kBlock.begin(), kBlock.end(), [&](const Box& other) {
            return ((outside - other.centre).cwiseAbs() - other.half).maxCoeff() < 0;
          });
          if (covered) continue;
          points->insert(points->end(), p.data(), p.data() + 3);
          normals->insert(normals->end(), n.data(), n.data() + 3);
        }
      }
    }
  }
}

}  // namespace

int main() {
  const Isometry3d X_WO = Eigen::Translation3d(0.02, -0.03, 0.05) *
                          Eigen::AngleAxisd(0.7, Vector3d(0.2, 0.3, 1).normalized());

  // What two cameras see of it.
  constexpr int kWidth = 320, kHeight = 240;
  constexpr double kFocal = 400;
  std::array<std::vector<float>, 2> depths;
  std::vector<prehensile::DepthImageView> views;
  for (int camera = 0; camera < 2; ++camera) {
    const Isometry3d X_WC =
        LookAtOrigin(camera == 0 ? Vector3d(0.5, 0.1, 0.5) : Vector3d(-0.3, 0.4, 0.5));
    const Isometry3d X_OC = X_WO.inverse() * X_WC;
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const Vector3d ray((u - 159.5) / kFocal, (v - 119.5) / kFocal, 1);
        depths[camera].push_back(
            static_cast<float>(Range(X_OC.translation(), X_OC.linear() * ray)));
      }
    }
    prehensile::DepthImageView view;
    view.width = kWidth;
    view.height = kHeight;
    view.depth = depths[camera].data();
    view.fx = view.fy = kFocal;
    view.cx = 159.5;
    view.cy = 119.5;
    view.X_WC = X_WC.matrix();
    views.push_back(view);
  }
  const prehensile::FusedCloud scene = prehensile::FuseDepthViews(
      views, Eigen::Matrix4d::Identity(), Vector3d(0.6, 0.6, 0.6), 0.003);
  std::printf("%zu points with normals from two images\n", scene.points.size() / 3);

  // The model, laid onto it from a guess that is 17 mm and 17 degrees wrong.
  std::vector<double> points, normals;
  SampleModel(&points, &normals);
  const Isometry3d guess =
      X_WO * Eigen::Translation3d(0.01, -0.01, 0.01) * Eigen::AngleAxisd(0.3, Vector3d::UnitY());
  const prehensile::IcpCloud scene_cloud(scene.points.data(), scene.points.size() / 3,
                                         scene.normals.data(), nullptr, {});
  const prehensile::IcpCloud model_cloud(points.data(), points.size() / 3, normals.data(), nullptr,
                                         {});
  prehensile::IcpOptions options;
  options.max_distance = 0.03;
  options.min_normal_cosine = 0.5;
  const prehensile::IcpResult result =
      prehensile::Icp(scene_cloud, model_cloud, guess.matrix(), options);
  const Isometry3d error = X_WO.inverse() * Isometry3d(result.X_WO);
  const double millimetres = 1e3 * error.translation().norm();
  const double degrees = Eigen::AngleAxisd(error.rotation()).angle() * 180 / EIGEN_PI;
  std::printf("%d iterations, residual %.2f mm; %.2f mm and %.2f degrees from the truth\n",
              result.iterations, 1e3 * result.residual, millimetres, degrees);
  return result.outcome == prehensile::IcpOutcome::kConverged && millimetres < 2 && degrees < 1 ? 0
                                                                                                : 1;
}
