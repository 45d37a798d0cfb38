#include "bindings.h"

namespace nb = nanobind;

namespace prehensile {

void BindConsensus(nb::module_& /*m*/) {}

}  // namespace prehensile
