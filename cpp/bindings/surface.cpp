#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindSurface(nb::module_& /*m*/) {}

}  // namespace prehensile
