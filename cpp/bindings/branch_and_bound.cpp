#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindBranchAndBound(nb::module_& /*m*/) {}

}  // namespace prehensile
