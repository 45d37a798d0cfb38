#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindTracking(nb::module_& /*m*/) {}

}  // namespace prehensile
