"""Says what an asset holds, one line a value, or which files are assets; `relight_asset` has the usage.

A line is a name, a type, a shape, and the little-endian bytes in hexadecimal, or `xxh3:` and their hash when there are
more than 256. The Rust test `second_reader` writes the same lines from what the Rust reader found.
"""

import sys

import numpy as np

from codecs_of_spec import Refused
from relight_asset import read
from xxh3 import xxh3_64


def line(name, kind, shape, data):
    content = data.hex() if len(data) <= 256 else f"xxh3:{xxh3_64(data):016x}"
    return f"{name} {kind}[{','.join(map(str, shape))}] {content}"


def lines(name, value):
    if value is None:
        yield f"{name} none"
    elif isinstance(value, dict):
        for key, part in value.items():
            yield from lines(f"{name}.{key}", part)
    elif isinstance(value, (list, tuple)):
        yield f"{name} list[{len(value)}]"
        for i, part in enumerate(value):
            yield from lines(f"{name}.{i}", part)
    elif isinstance(value, (str, bytes)):
        data = value.encode() if isinstance(value, str) else value
        yield line(name, "text", (len(data),), data)
    elif isinstance(value, np.ndarray):
        if value.dtype.kind == "f":
            kind = f"f{8 * value.dtype.itemsize}"
            yield line(name, kind, value.shape, value.astype(value.dtype.newbyteorder("<")).tobytes())
        else:
            yield line(name, "u32", value.shape, value.astype("<u4").tobytes())
    else:
        yield f"{name} {int(value)}"


def main(arguments):
    if arguments[:1] == ["--check"]:
        for path in arguments[1:]:
            with open(path, "rb") as file:
                data = file.read()
            try:
                read(data)
                print("accepted", path)
            except Refused as error:
                print("refused", path, error)
        return 0
    for path in arguments:
        with open(path, "rb") as file:
            asset = read(file.read())
        for name in sorted(asset):
            for text in lines(name, asset[name]):
                print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
