"""ETag and If-Match: whoever changes something that somebody else changed meanwhile is told so."""

import re
from typing import Annotated

from fastapi import Header, Response

from app.store.refusal import refuse

_TAGS = re.compile(r'^\s*(?:"(\d{1,12})"\s*,?\s*)+$')

IfMatch = Annotated[
    str | None,
    Header(
        alias="If-Match",
        description="The ETag you read. 412 if it is no longer the present one; without it, the last writer wins.",
        examples=['"3"'],
    ),
]


def etag(version: int) -> str:
    """Return the ETag of a version."""
    return f'"{version}"'


def expected(if_match: str | None, present: int | None = None) -> int | None:
    """Return the version an If-Match header asks for, or None if any will do; raises Refusal 412 for what no version has."""
    if if_match is None or if_match.strip() == "*":
        return None
    if not _TAGS.match(if_match):
        raise refuse(
            412,
            "etag-unknown",
            "the If-Match header is no ETag of this server.",
            "Send the ETag as you got it.",
            "If-Match",
        )
    tags = [int(tag) for tag in re.findall(r"\d+", if_match)]
    return present if present in tags else tags[0]


def tag(response: Response, version: int) -> None:
    """Mark a response with its version."""
    response.headers["ETag"] = etag(version)
    response.headers["Cache-Control"] = "no-cache"
