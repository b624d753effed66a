# pinocchio is a compiled module without usable type information.
from typing import Any

def __getattr__(name: str) -> Any: ...
