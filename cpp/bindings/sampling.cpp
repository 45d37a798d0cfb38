#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindSampling(nb::module_& /*m*/) {}

}  // namespace prehensile
