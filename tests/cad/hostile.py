"""Readers that misbehave, for the sandbox; each stands for something a library did with a damaged file."""

import ctypes
import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from planner.errors import fail


def echo(source: Path, options: dict[str, Any]):
    print("said on the console")
    return {"a": np.arange(6.0).reshape(2, 3), "b": np.array([1, 2], dtype=np.int32)}, {
        "options": options,
        "cwd": os.getcwd(),
    }


def complain(source: Path, options: dict[str, Any]):
    raise fail("bad-thing", "It is bad.", "Make it good.", "here")


def throw(source: Path, options: dict[str, Any]):
    raise ZeroDivisionError("of all things")


def crash(source: Path, options: dict[str, Any]):
    ctypes.string_at(0)


def leave(source: Path, options: dict[str, Any]):
    os._exit(3)


def eat(source: Path, options: dict[str, Any]):
    return {"a": np.ones(10**9)}, {}


def spin(source: Path, options: dict[str, Any]):
    while True:
        pass


def sleep(source: Path, options: dict[str, Any]):
    time.sleep(60)


def smuggle(source: Path, options: dict[str, Any]):
    return {"a": np.array([{"an": "object"}], dtype=object)}, {}
