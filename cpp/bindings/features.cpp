#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindFeatures(nb::module_& /*m*/) {}

}  // namespace prehensile
