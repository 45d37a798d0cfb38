#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindIcp(nb::module_& /*m*/) {}

}  // namespace prehensile
