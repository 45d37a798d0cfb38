#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindPointDrift(nb::module_& /*m*/) {}

}  // namespace prehensile
