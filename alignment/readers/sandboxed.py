"""What runs inside the sandbox: one parser, its payload taken apart into arrays and JSON."""

import importlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def parse(source: Path, options: dict[str, Any]) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Call `options["parser"]` ("module:function" of this package) on a file called `options["name"]`."""
    module, _, function = options["parser"].partition(":")
    found = getattr(importlib.import_module(f"alignment.readers.{module}"), function)(source, options["name"])
    arrays = {key: value for key, value in found.items() if isinstance(value, np.ndarray)}
    return arrays, {key: value for key, value in found.items() if key not in arrays}
