#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindVolumes(nb::module_& /*m*/) {}

}  // namespace prehensile
