# For the type checker, what comes from Drake is of any type. Drake's own stubs know neither the
# conversions its functions make (lists for vectors) nor many keyword arguments, so that checking
# against them would report some two hundred faults that are none.
from typing import Any

def __getattr__(name: str) -> Any: ...
