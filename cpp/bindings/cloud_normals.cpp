#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindCloudNormals(nb::module_& /*m*/) {}

}  // namespace prehensile
