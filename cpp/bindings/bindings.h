#pragma once

#include <nanobind/nanobind.h>

namespace prehensile {

// Each puts the kernels of one subject into the module; one file of that name each.
void BindVoxelDownsample(nanobind::module_& m);
void BindKinematicTree(nanobind::module_& m);
void BindReachability(nanobind::module_& m);
void BindDifferentialIk(nanobind::module_& m);
void BindAnalyticIk(nanobind::module_& m);

}  // namespace prehensile
