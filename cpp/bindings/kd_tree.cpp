#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindKdTree(nb::module_& /*m*/) {}

}  // namespace prehensile
