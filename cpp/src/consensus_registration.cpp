#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "consensus_detail.h"
#include "vectors.h"

namespace prehensile {
namespace {

using internal::Pose;

struct Candidate {
  Pose pose;
  std::vector<std::uint8_t> inliers;
  int count = 0;
  int iterations = 0;
  Clique clique;
};

/// The pose of a clique's correspondences: rotation of the differences between them, then
/// translation, then both on all that agree.
Candidate PoseOfClique(const PointRows& a, const PointRows& b, Clique clique, double bound) {
  const int k = static_cast<int>(clique.vertices.size());
  // Differences of each with those that follow it at some strides, all of them if these are few.
  const int strides = std::min(k / 2, std::max(1, 2000 / k));
  internal::OwnedRows da(k * strides, 3), db(k * strides, 3);
  for (int s = 0, row = 0; s < strides; ++s) {
    const int stride = 1 + (k / 2) * s / strides;
    for (int i = 0; i < k; ++i, ++row) {
      const int from = clique.vertices[i], to = clique.vertices[(i + stride) % k];
      da.row(row) = a.row(to) - a.row(from);
      db.row(row) = b.row(to) - b.row(from);
    }
  }
  const RotationConsensus rotation = GncRotation(internal::View(da), internal::View(db), 2 * bound);
  Candidate candidate;
  candidate.iterations = rotation.iterations;
  candidate.pose.R = rotation.R;
  std::vector<double> values(k);
  const std::vector<double> bounds(k, bound);
  for (int axis = 0; axis < 3; ++axis) {
    for (int i = 0; i < k; ++i) {
      const int v = clique.vertices[i];
      values[i] = b(v, axis) - rotation.R.row(axis).dot(a.row(v));
    }
    candidate.pose.p[axis] = VoteForScalar(values.data(), bounds.data(), k, false).estimate;
  }
  candidate.count = internal::RefineOnInliers(a, b, bound, &candidate.pose, &candidate.inliers,
                                              &candidate.iterations);
  candidate.clique = std::move(clique);
  return candidate;
}

/// Whether the points that agree with the first pose lie elsewhere by the second, by more than
/// noise would have it.
bool FarApart(const PointRows& a, const Candidate& first, const Pose& second, double bound) {
  double sum = 0;
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    if (!first.inliers[i]) continue;
    const Eigen::Vector3d x = a.row(i).transpose();
    sum += (first.pose.R * x + first.pose.p - second.R * x - second.p).squaredNorm();
  }
  return sum > 4 * bound * bound * first.count;
}

/// Number of triangles; in large graphs estimated from those of every so many-th vertex.
double CountTriangles(const ConsistencyGraph& graph) {
  const double work = 2.0 * static_cast<double>(graph.num_edges()) * graph.words_per_row();
  const int step = 1 + static_cast<int>(std::min(work / 1e6, graph.size() / 64.0));
  double corners = 0, vertices = 0;
  for (int i = 0; i < graph.size(); i += step, ++vertices) {
    for (int w = 0; w < graph.words_per_row(); ++w) {
      for (std::uint64_t word = graph.row(i)[w]; word; word &= word - 1) {
        const std::uint64_t* const other = graph.row(64 * w + std::countr_zero(word));
        int common = 0;
        for (int k = 0; k < graph.words_per_row(); ++k) {
          common += std::popcount(graph.row(i)[k] & other[k]);
        }
        corners += common / 2.0;
      }
    }
  }
  return corners / 3 * graph.size() / vertices;
}

void Remove(const std::vector<std::uint8_t>& removed, ConsistencyGraph* graph) {
  std::vector<std::uint64_t> kept(graph->words_per_row(), ~std::uint64_t{0});
  for (int i = 0; i < graph->size(); ++i) {
    if (removed[i]) kept[i / 64] &= ~(std::uint64_t{1} << i % 64);
  }
  for (int i = 0; i < graph->size(); ++i) {
    std::uint64_t* const row = graph->mutable_row(i);
    for (int w = 0; w < graph->words_per_row(); ++w) row[w] &= removed[i] ? 0 : kept[w];
  }
}

}  // namespace

RobustPose RobustRegistration(const PointRows& a, const PointRows& b, double noise_bound,
                              const RobustOptions& options) {
  internal::RequireCorrespondences(a, b, noise_bound);
  internal::Require(options.ambiguity_ratio > 0, "ambiguity_ratio: must be positive");
  internal::Require(options.min_inliers >= 3, "min_inliers: must be at least 3");
  const int n = static_cast<int>(a.rows());
  RobustPose result;
  result.inliers.assign(n, 0);
  if (n < options.min_inliers) return result;

  ConsistencyGraph graph = MakeConsistencyGraph(a, b, 2 * noise_bound);
  const double num_triangles = CountTriangles(graph);
  std::optional<Candidate> best;
  // One search for a pose and one for a rival, and some more where a clique was no pose: distances
  // do not tell a shape from its mirror image.
  constexpr int kMaxSearches = 6;
  for (int search = 0; search < kMaxSearches; ++search) {
    CliqueOptions clique_options;
    clique_options.max_nodes = options.max_nodes;
    const double rival = best ? options.ambiguity_ratio * best->count : 0;
    clique_options.min_size = std::max(options.min_inliers, static_cast<int>(std::ceil(rival)));
    Clique clique = MaximumClique(graph, clique_options);
    if (clique.vertices.empty()) break;
    std::vector<std::uint8_t> removed(n);
    for (const int v : clique.vertices) removed[v] = 1;
    const int clique_size = static_cast<int>(clique.vertices.size());
    Candidate candidate = PoseOfClique(a, b, std::move(clique), noise_bound);
    const bool valid = candidate.count >= options.min_inliers;
    if (valid) {
      for (int i = 0; i < n; ++i) removed[i] |= candidate.inliers[i];
      if (!best) {
        best = std::move(candidate);
      } else {
        if (candidate.count > best->count) std::swap(*best, candidate);
        if (FarApart(a, *best, candidate.pose, noise_bound)) {
          result.num_inliers_second = std::max(result.num_inliers_second, candidate.count);
        }
      }
    }
    if (search > 0 && best && 2 * best->count >= clique_size) break;
    Remove(removed, &graph);
  }
  if (!best) return result;

  result.R = best->pose.R;
  result.p = best->pose.p;
  result.inliers = std::move(best->inliers);
  result.num_inliers = best->count;
  result.clique_size = static_cast<int>(best->clique.vertices.size());
  result.clique_proven = best->clique.proven;
  result.iterations = best->iterations;
  const double tests = std::min(num_triangles, internal::ExpectedTriples(a, b, 2 * noise_bound));
  result.log_false_alarms =
      LogFalseAlarms(tests, n, best->count,
                     internal::ChanceOfAgreement(a, b, best->pose, noise_bound, result.inliers));
  if (result.log_false_alarms > std::log10(options.max_false_alarms)) return result;
  const bool ambiguous = result.num_inliers_second >= options.ambiguity_ratio * best->count;
  result.status = ambiguous ? ConsensusStatus::kAmbiguous : ConsensusStatus::kFound;
  return result;
}

}  // namespace prehensile
