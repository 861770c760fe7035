"""How OpenAPI describes the body of an upload: a form with one file or more and fields, or the bare file."""

from typing import Any

BINARY: dict[str, Any] = {"type": "string", "format": "binary"}


def one_file(description: str = "") -> dict[str, Any]:
    """Return the schema of a form's one file."""
    return BINARY | ({"description": description} if description else {})


def files(description: str) -> dict[str, Any]:
    """Return the schema of one file or more of the same name."""
    return {"type": "array", "items": BINARY, "description": description}


def choice(*values: str, example: str) -> dict[str, Any]:
    """Return the schema of a field with these values."""
    return {"type": "string", "enum": list(values), "example": example}


def upload_body(
    file: dict[str, Any], fields: dict[str, Any] | None = None, bare: str = "application/octet-stream"
) -> dict[str, Any]:
    """Return `openapi_extra` of a route that takes `file` and fields as a form, or the bare bytes of media type `bare`."""
    form = {"type": "object", "required": ["file"], "properties": {"file": file, **(fields or {})}}
    content = {"multipart/form-data": {"schema": form}, bare: {"schema": BINARY}}
    return {"requestBody": {"required": True, "content": content}}
