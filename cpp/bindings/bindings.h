#pragma once

#include <nanobind/nanobind.h>

namespace prehensile {

// Each puts the kernels of one subject into the module; one file of that name each.
void BindVoxelDownsample(nanobind::module_& m);
void BindKinematicTree(nanobind::module_& m);
void BindReachability(nanobind::module_& m);
void BindDifferentialIk(nanobind::module_& m);
void BindAnalyticIk(nanobind::module_& m);
void BindCrop(nanobind::module_& m);
void BindDepthFusion(nanobind::module_& m);
void BindKdTree(nanobind::module_& m);
void BindSurface(nanobind::module_& m);
void BindCloudNormals(nanobind::module_& m);
void BindSampling(nanobind::module_& m);
void BindRegions(nanobind::module_& m);
void BindVolumes(nanobind::module_& m);
void BindDistanceField(nanobind::module_& m);
void BindIcp(nanobind::module_& m);
void BindPointDrift(nanobind::module_& m);
void BindConsensus(nanobind::module_& m);
void BindBranchAndBound(nanobind::module_& m);
void BindFeatures(nanobind::module_& m);
void BindTracking(nanobind::module_& m);

}  // namespace prehensile
