"""Uploads, streamed to disk: raw bodies and multipart forms alike, never a whole file in memory."""

import asyncio
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field

from fastapi import Request
from python_multipart.exceptions import MultipartParseError
from python_multipart.multipart import MultipartParser, parse_options_header

from app.store.blobs import CHUNK, Blob, BlobWriter
from app.store.names import shown_file_name
from app.store.refusal import refuse
from app.store.store import Store

MAX_FIELD_BYTES = 4096
MAX_FORM_PARTS = 16


@dataclass
class Received:
    """What came: files by shown name, in order, and the other fields of the form."""

    files: list[tuple[str, Blob]] = field(default_factory=list)
    fields: dict[str, str] = field(default_factory=dict)


async def receive(
    request: Request, store: Store, largest: int, max_files: int, what: str, raw_name: str | None
) -> Received:
    """Store the files of a request and return them; call it inside `store.busy()`.

    A multipart body carries files and fields; any other body is one file, called `raw_name`. Raises Refusal 413, 422, 507.
    """
    media, options = parse_options_header(request.headers.get("content-type"))
    _check_length(request, largest * max_files, what)
    with ExitStack() as open_files:
        if media == b"multipart/form-data":
            sink: _Form | _Raw = _Form(store, open_files, options.get(b"boundary", b""), largest, max_files, what)
        else:
            sink = _Raw(store, open_files, largest, what, raw_name)
        buffer = bytearray()
        async for chunk in request.stream():
            buffer += chunk
            if len(buffer) >= CHUNK:
                await asyncio.to_thread(sink.feed, bytes(buffer))
                buffer.clear()
        received = await asyncio.to_thread(sink.end, bytes(buffer))
    if not received.files:
        raise refuse(422, "file-missing", "no file came with the request.", f"Send the {what} as 'file'.", "file")
    return received


def _check_length(request: Request, largest: int, what: str) -> None:
    length = request.headers.get("content-length", "")
    # Room for the form's own lines; what a file may have is counted where it is written.
    if length.isdigit() and int(length) > largest + MAX_FORM_PARTS * MAX_FIELD_BYTES:
        raise refuse(
            413, "file-too-large", f"the {what} is larger than {largest / CHUNK:.0f} MiB.", "Send a smaller one."
        )


class _Raw:
    def __init__(self, store: Store, stack: ExitStack, largest: int, what: str, name: str | None) -> None:
        self._writer: BlobWriter = stack.enter_context(store.writer(largest, what))
        self._name = shown_file_name(name or "file")

    def feed(self, data: bytes) -> None:
        self._writer.write(data)

    def end(self, data: bytes) -> Received:
        self._writer.write(data)
        if not self._writer.size:
            return Received()
        return Received([(self._name, self._writer.finish())])


class _Form:
    """Writes the files of a multipart form as they come. Names are data; a name never chooses a place."""

    def __init__(
        self, store: Store, stack: ExitStack, boundary: bytes, largest: int, max_files: int, what: str
    ) -> None:
        if not boundary:
            raise _malformed("the form has no boundary")
        self._store, self._stack, self._largest, self._max_files, self._what = store, stack, largest, max_files, what
        self._received = Received()
        self._writer: BlobWriter | None = None
        self._text = bytearray()
        self._key = b""
        self._value = b""
        self._headers: dict[bytes, bytes] = {}
        self._name = ""
        self._file_name: str | None = None
        self._parts = 0
        self._ended = False
        calls: dict[str, Callable[..., None]] = {
            "on_part_begin": self._part_begin,
            "on_header_field": self._header_field,
            "on_header_value": self._header_value,
            "on_header_end": self._header_end,
            "on_headers_finished": self._headers_finished,
            "on_part_data": self._part_data,
            "on_part_end": self._part_end,
            "on_end": self._end,
        }
        self._parser = MultipartParser(boundary, calls)  # type: ignore[arg-type]

    def feed(self, data: bytes) -> None:
        try:
            self._parser.write(data)
        except MultipartParseError as error:
            raise _malformed(f"the form is malformed near byte {error.offset}") from error

    def end(self, data: bytes) -> Received:
        self.feed(data)
        if not self._ended:
            raise _malformed("the form ends in the middle")
        return self._received

    def _part_begin(self) -> None:
        self._parts += 1
        if self._parts > MAX_FORM_PARTS:
            raise _malformed("the form has too many parts")
        self._headers, self._key, self._value = {}, b"", b""

    def _header_field(self, data: bytes, start: int, end: int) -> None:
        self._key += data[start:end]

    def _header_value(self, data: bytes, start: int, end: int) -> None:
        self._value += data[start:end]

    def _header_end(self) -> None:
        key = self._key.lower()
        if key in self._headers:
            raise _malformed("a part of the form has a header twice")
        self._headers[key] = self._value
        self._key, self._value = b"", b""

    def _headers_finished(self) -> None:
        disposition, options = parse_options_header(self._headers.get(b"content-disposition"))
        if disposition != b"form-data" or b"name" not in options:
            raise _malformed("a part of the form has no name")
        self._name = options[b"name"].decode("utf-8", "replace")
        file_name = options.get(b"filename")
        self._file_name = None if file_name is None else file_name.decode("utf-8", "replace")
        if self._file_name is None:
            self._text.clear()
            return
        if len(self._received.files) >= self._max_files:
            raise refuse(
                422, "files-too-many", f"more than {self._max_files} file(s) came.", "Send fewer at a time.", "file"
            )
        self._writer = self._stack.enter_context(self._store.writer(self._largest, self._what))

    def _part_data(self, data: bytes, start: int, end: int) -> None:
        if self._writer is not None:
            self._writer.write(data[start:end])
        elif len(self._text) + end - start > MAX_FIELD_BYTES:
            raise _malformed(f"the field '{self._name[:40]}' is too long")
        else:
            self._text += data[start:end]

    def _part_end(self) -> None:
        if self._writer is None:
            if self._name in self._received.fields:
                raise _malformed(f"the field '{self._name[:40]}' comes twice")
            self._received.fields[self._name] = self._text.decode("utf-8", "replace")
            return
        writer, self._writer = self._writer, None
        # A form field for which nobody chose a file is an empty part without a name.
        if writer.size or self._file_name:
            self._received.files.append((shown_file_name(self._file_name or "file"), writer.finish()))

    def _end(self) -> None:
        self._ended = True


def _malformed(message: str) -> Exception:
    return refuse(
        422, "form-malformed", f"{message}.", "Send multipart/form-data with a 'file', or the bare file as the body."
    )
