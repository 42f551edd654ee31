"""SPEC 4.4: the content of one zstd frame (RFC 8878), with whichever module there is."""

from codecs_of_spec import Refused, require

try:
    from compression import zstd as _module  # Python 3.14

    def _content(frame, length):
        return _module.decompress(frame)

except ImportError:
    try:
        import zstandard

        def _content(frame, length):
            return zstandard.ZstdDecompressor().decompress(frame, max_output_size=max(length, 1))

    except ImportError:
        import pyzstd

        def _content(frame, length):
            return pyzstd.decompress(frame)


def _frame_bytes(data):
    """Length of the frame at the start of `data`, and of its content if the frame says so (RFC 8878, 3.1.1)."""
    require(data[:4] == bytes.fromhex("28b52ffd") and len(data) > 4, "a zstd frame")
    descriptor = data[4]
    single, checksum = descriptor >> 5 & 1, descriptor >> 2 & 1
    require(descriptor & 3 == 0, "a zstd frame without a dictionary")
    at = 5 + (0 if single else 1)
    size = (single, 2, 4, 8)[descriptor >> 6]
    require(at + size <= len(data), "a whole zstd frame")
    content = int.from_bytes(data[at : at + size], "little") + (256 if size == 2 else 0) if size else None
    at += size
    while True:
        require(at + 3 <= len(data), "a whole zstd frame")
        block = int.from_bytes(data[at : at + 3], "little")
        at += 3 + (1 if block >> 1 & 3 == 1 else block >> 3)
        if block & 1:
            return at + 4 * checksum, content


def decompress(data, length):
    """The content of the one frame that `data` is, which must be `length` bytes."""
    end, content = _frame_bytes(data)
    require(end == len(data), "one zstd frame and nothing behind it")
    # Says how much memory the module will take, so it comes first.
    require(content in (None, length), f"a zstd frame of {length} bytes")
    try:
        raw = _content(data, length)
    except Exception as error:  # each module has errors of its own
        raise Refused(f"a zstd frame: {error}") from error
    require(len(raw) == length, f"{length} raw bytes, found {len(raw)}")
    return raw
