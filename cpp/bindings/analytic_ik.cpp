#include "bindings.h"

namespace prehensile {

void BindAnalyticIk(nanobind::module_&) {}

}  // namespace prehensile
