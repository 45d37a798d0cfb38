#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindDistanceField(nb::module_& /*m*/) {}

}  // namespace prehensile
