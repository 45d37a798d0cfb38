// The Python module prehensile.native._core: arrays in, arrays out. prehensile/native puts the
// names, defaults and documentation on it that users see.

#include "bindings.h"
#include "numpy_arrays.h"

NB_MODULE(_core, m) {
  // Drake keeps Systems written in Python, and what they hold, until the process ends.
  nanobind::set_leak_warnings(false);
  prehensile::NumpyApi::Load();
  prehensile::BindVoxelDownsample(m);
  prehensile::BindKinematicTree(m);
  prehensile::BindReachability(m);
  prehensile::BindDifferentialIk(m);
  prehensile::BindAnalyticIk(m);
  prehensile::BindCrop(m);
  prehensile::BindDepthFusion(m);
  prehensile::BindKdTree(m);
  prehensile::BindSurface(m);
  prehensile::BindCloudNormals(m);
  prehensile::BindSampling(m);
  prehensile::BindRegions(m);
  prehensile::BindVolumes(m);
  prehensile::BindDistanceField(m);
  prehensile::BindIcp(m);
  prehensile::BindPointDrift(m);
  prehensile::BindConsensus(m);
  prehensile::BindBranchAndBound(m);
  prehensile::BindFeatures(m);
  prehensile::BindTracking(m);
}
