"""The compiled kernels for this processor; all builds give the same bits."""

from importlib import import_module

import meshfix_cli.kernels._any as _any

try:
    _built = import_module("meshfix_cli.kernels._avx2") if _any.has_avx2() else _any
except ImportError:  # the compiler could not build it
    _built = _any

globals().update({name: value for name, value in vars(_built).items() if not name.startswith("__")})
BUILD = "AVX2" if _built is not _any else "any processor"
