#include "bindings.h"

namespace prehensile {

void BindDifferentialIk(nanobind::module_&) {}

}  // namespace prehensile
