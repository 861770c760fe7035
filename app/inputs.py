"""What a person hands over as files or words: setup, key points, offsets. Every fault is an `Issue` that names the place."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from planner.errors import EchoBaseError, fail
from planner.issues import Issue
from planner.keypoint import KeyPoint, KeyPointList
from planner.setup import Setup

# What pydantic calls a value that should have been an object.
NO_OBJECT = ("model_type", "model_attributes_type", "dict_type")
MAX_JSON_BYTES = 16 * 1024 * 1024


def read_json(path: Path) -> Any:
    """Return the JSON content of a file; raise EchoBaseError if it is missing, too large, or not JSON."""
    if not path.is_file():
        raise fail("file-missing", f"there is no file '{path.name}'.", "Check the path.", str(path))
    if path.stat().st_size > MAX_JSON_BYTES:
        raise fail("file-too-large", "the file is over 16 MiB, far more than settings need.", "", path.name)
    try:
        return json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=_once)
    except _TwiceError as error:
        raise fail("key-twice", f"'{error}' stands twice in one object.", "Keep one of them.", path.name) from error
    except UnicodeDecodeError as error:
        raise fail("not-text", "the file is not UTF-8 text.", "Save it as JSON text.", path.name) from error
    except json.JSONDecodeError as error:
        where = f"{path.name}:{error.lineno}:{error.colno}"
        raise fail("not-json", f"this is not valid JSON: {error.msg}.", "Correct it there.", where) from error


class _TwiceError(ValueError):
    """A name that an object of JSON has twice, of which one would count silently."""


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    out = dict(pairs)
    if len(out) < len(pairs):
        names = [name for name, _ in pairs]
        raise _TwiceError(next(n for n in names if names.count(n) > 1))
    return out


def setup_from(data: Any, where: str = "setup.json") -> Setup:
    """Return the validated settings; raise EchoBaseError with one issue per bad field."""
    try:
        return Setup.model_validate(data)
    except ValidationError as error:
        raise validation_failure(error, where) from error


def keypoints_from(data: Any, where: str = "keypoints.json") -> list[KeyPoint]:
    """Return the validated key points; raise EchoBaseError for bad fields or a doubled id."""
    try:
        points = KeyPointList.validate_python(data)
    except ValidationError as error:
        raise validation_failure(error, where) from error
    ids = [p.id for p in points]
    doubled = sorted({i for i in ids if ids.count(i) > 1})
    if doubled:
        raise fail(
            "keypoint-doubled", f"the key point id {', '.join(doubled)} is used twice.", "Give each its own.", where
        )
    return points


def read_setup(path: Path | None) -> Setup:
    """Return the settings of a file, or the defaults when there is none."""
    return Setup() if path is None else setup_from(read_json(path), path.name)


def patched(setup: Setup, patches: Sequence[Path]) -> Setup:
    """Return the settings with patches of `echobase calibrate` or `batch` merged in, one after the other."""
    for path in patches:
        patch = read_json(path)
        if not isinstance(patch, dict):
            raise fail("patch-invalid", "a patch is an object with fields of setup.json.", "Correct it.", path.name)
        setup = setup_from(_merged(setup.model_dump(mode="json"), patch), path.name)
    return setup


def _merged(content: dict[str, Any], patch: dict[str, Any]) -> dict[str, Any]:
    """Return content with the fields of a patch; objects are merged, anything else is replaced."""
    both = {k: (content.get(k), v) for k, v in patch.items()}
    return content | {
        k: _merged(old, new) if isinstance(old, dict) and isinstance(new, dict) else new
        for k, (old, new) in both.items()
    }


def with_box(setup: Setup, six: tuple[float, ...]) -> Setup:
    """Return the settings with the inspection surface cut to a box, X0,Y0,Z0,X1,Y1,Z1 (CAD mm), corners in any order."""
    a, b = six[:3], six[3:]
    low, high = ([f(x, y) for x, y in zip(a, b, strict=True)] for f in (min, max))
    inspection = setup.inspection.model_dump(mode="json") | {"box": {"min_mm": low, "max_mm": high}}
    return setup_from(setup.model_dump(mode="json") | {"inspection": inspection}, "--box")


def read_keypoints(path: Path) -> list[KeyPoint]:
    """Return the key points of a file."""
    return keypoints_from(read_json(path), path.name)


def validation_failure(error: ValidationError, where: str, model: type[BaseModel] = Setup) -> EchoBaseError:
    """Return a pydantic error as EchoBase's own, one issue per field, in words; `model`: whose fields they are."""
    return EchoBaseError(*(_field_issue(dict(e), where, model) for e in error.errors(include_url=False)))


def _field_issue(error: dict[str, Any], where: str, model: type[BaseModel]) -> Issue:
    place = ".".join(str(p) for p in error["loc"]) or "the whole file"
    kind = str(error["type"])
    if kind == "extra_forbidden":
        known = ", ".join(_siblings(error["loc"], model))
        remedy = f"Correct the name or remove it; known here: {known}." if known else "Correct the name or remove it."
        return Issue("error", "field-unknown", f"there is no setting '{place}'.", remedy, where)
    message = "an object with its fields in { } is needed" if kind in NO_OBJECT else str(error["msg"])
    message = message.removeprefix("Value error, ")
    value = error.get("input")
    shown = f" (it is {json.dumps(value)})" if isinstance(value, str | int | float | bool) or value is None else ""
    return Issue("error", "field-invalid", f"{place}{shown}: {message[:1].lower()}{message[1:]}.", "", where)


def _siblings(loc: tuple[Any, ...], model: type[BaseModel]) -> list[str]:
    """Return the legal names beside an unknown one, by walking the schema of the model."""
    schema = model.model_json_schema()
    node: dict[str, Any] = schema
    for step in loc[:-1]:
        child = node.get("properties", {}).get(step)
        if child is None:
            return []
        node = schema["$defs"].get(child.get("$ref", "").rsplit("/", 1)[-1], child)
    return sorted(node.get("properties", {}))


def numbers(text: str, count: int, what: str) -> tuple[float, ...]:
    """Return `count` comma-separated finite numbers; raise ValueError in words (argparse turns it into a usage error)."""
    parts = text.split(",")
    try:
        values = tuple(float(p) for p in parts)
    except ValueError:
        values = ()
    if len(values) != count or not all(abs(v) < 1e9 for v in values):
        raise ValueError(f"{what} needs {count} comma-separated numbers, got '{text}'")
    return values
