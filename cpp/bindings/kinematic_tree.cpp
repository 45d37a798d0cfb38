#include "bindings.h"

namespace prehensile {

void BindKinematicTree(nanobind::module_&) {}

}  // namespace prehensile
