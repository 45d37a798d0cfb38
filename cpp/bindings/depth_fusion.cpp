#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindDepthFusion(nb::module_& /*m*/) {}

}  // namespace prehensile
