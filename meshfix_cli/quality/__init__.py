"""How good a mesh is, and what keeps it from being better."""

import sys
from importlib import import_module
from types import ModuleType
from typing import Any


class _Room(ModuleType):
    """The room bears the name of a public function: whichever of the two a name reaches, it can be called."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call `meshfix_cli.objects.api.quality`, of which nothing in this room knows."""
        return import_module("meshfix_cli.objects.api").quality(*args, **kwargs)


sys.modules[__name__].__class__ = _Room
