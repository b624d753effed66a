"""hopopt: how high can a leg possibly lift its foot in a hop with the motors it has.

import hopopt as ho
s = ho.solve("paper", objective="clearance")
s.plot()
"""

import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # an editor sees the names alone, and not that they are imported late
    from hopopt.api import *  # noqa: F403
    from hopopt.api import __all__ as __all__

    __version__: str
    from hopopt.api import codesign as codesign  # pyright: ignore[reportDeprecated]
    from hopopt.api import front as front  # pyright: ignore[reportDeprecated]
else:
    _LIGHT = {"load": "problem.load", "objective": "ocp.custom", "constraint": "ocp.custom"}  # these need not all of it
    _OLD = ("codesign", "front")

    def __dir__() -> list[str]:
        """What there is, imported or not: for tab completion."""
        return sorted(__getattr__("__all__"))

    def __getattr__(name: str) -> Any:
        """Import on first use, so that ``hopopt --help`` answers at once; hopopt.api has the one list of names."""
        from importlib import import_module
        from importlib.metadata import version
        from importlib.util import find_spec

        if name == "__version__":
            return version("hopopt")
        asked_of_all = name.startswith("__") and name != "__all__"  # by tools, of every module
        if asked_of_all or find_spec(f"hopopt.{name}"):  # a module is imported as one, without the list of names
            raise AttributeError(f"module 'hopopt' has no attribute {name!r}")
        module = import_module(f"hopopt.{_LIGHT.get(name, 'api')}")
        if name not in (*_LIGHT, *_OLD, "__all__", *getattr(module, "__all__", ())):
            raise AttributeError(f"module 'hopopt' has no attribute {name!r}")
        value = globals()[name] = getattr(module, name)
        return value

    class _WithVerify(ModuleType):
        """So that hopopt.verify is the verb, though a package within is called so too."""

        @property
        def verify(self) -> Any:
            """The verb."""
            return __getattr__("__all__") and sys.modules["hopopt.api"].verify

        @verify.setter
        def verify(self, package: ModuleType) -> None:
            """What an import of the package would set."""

    sys.modules[__name__].__class__ = _WithVerify
