"""LZF, the compression inside PCD files: literal runs and back references, no headers."""

from planner.errors import fail


def lzf_decompress(packed: bytes, size: int, name: str) -> bytes:
    """Return the `size` bytes that an LZF block holds; fail if it is damaged."""
    out = bytearray()
    at, end = 0, len(packed)
    try:
        while at < end:
            control = packed[at]
            at += 1
            if control < 32:
                run = control + 1
                out += packed[at : at + run]
                at += run
                continue
            length = control >> 5
            if length == 7:
                length += packed[at]
                at += 1
            back = len(out) - (((control & 31) << 8) | packed[at]) - 1
            at += 1
            length += 2
            if back < 0 or len(out) + length > size:
                raise IndexError
            if back + length <= len(out):
                out += out[back : back + length]
            else:
                pattern = bytes(out[back:])
                out += (pattern * (length // len(pattern) + 1))[:length]
    except IndexError:
        raise fail("pcd-damaged", "the compressed points are damaged.", "Copy the file again.", name) from None
    if len(out) != size:
        raise fail("pcd-damaged", "the compressed points are damaged.", "Copy the file again.", name)
    return bytes(out)
