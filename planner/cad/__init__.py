"""CAD files in, `Part` out. Every file is parsed in a disposable child process (`planner.sandbox`)."""

from planner.cad.read import read_part
from planner.cad.save import load_part, save_part

__all__ = ["load_part", "read_part", "save_part"]
