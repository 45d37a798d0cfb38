#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindRegions(nb::module_& /*m*/) {}

}  // namespace prehensile
