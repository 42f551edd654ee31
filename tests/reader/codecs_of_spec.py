"""The codecs of SPEC.md section 7, over numpy arrays."""

import numpy as np


class Refused(Exception):
    """The bytes break a rule; the message says where."""


def require(holds, message):
    if not holds:
        raise Refused(message)


class Cursor:
    """Reads raw bytes in order; never beyond their end."""

    def __init__(self, data):
        self.data = bytes(data)
        self.at = 0

    def left(self):
        return len(self.data) - self.at

    def take(self, count):
        require(count <= self.left(), f"byte {self.at}: {count} more bytes, only {self.left()} left")
        self.at += count
        return self.data[self.at - count : self.at]

    def justify(self, count, least):
        require(count * least <= self.left(), f"byte {self.at}: {count} elements in {self.left()} bytes")

    def number(self, width):
        return int.from_bytes(self.take(width), "little")

    def u8(self):
        return self.number(1)

    def u16(self):
        return self.number(2)

    def u32(self):
        return self.number(4)

    def u64(self):
        return self.number(8)

    def zeros(self, count):
        require(not any(self.take(count)), f"byte {self.at}: reserved bytes of 0")

    def array(self, dtype, count):
        """`count` little-endian numbers of a numpy type such as "<f4"."""
        dtype = np.dtype(dtype)
        self.justify(count, dtype.itemsize)
        return np.frombuffer(self.take(count * dtype.itemsize), dtype=dtype)

    def f32(self):
        return self.array("<f4", 1)[0]

    def end(self):
        require(self.left() == 0, f"byte {self.at}: the end of the section, {self.left()} bytes left over")


def varints(cursor, count):
    """7.1: `count` numbers below 2^32, as int64."""
    cursor.justify(count, 1)
    if count == 0:
        return np.zeros(0, np.int64)
    # No number has more than five bytes.
    data = np.frombuffer(cursor.data, np.uint8, min(5 * count, cursor.left()), cursor.at)
    ends = np.flatnonzero(data < 0x80)[:count]
    require(len(ends) == count, f"byte {cursor.at}: {count} varints of at most 5 bytes")
    starts = np.concatenate([[0], ends[:-1] + 1])
    require(int((ends - starts).max()) < 5, f"byte {cursor.at}: varints of at most 5 bytes")
    used = int(ends[-1]) + 1
    place = np.arange(used) - np.repeat(starts, ends - starts + 1)
    values = np.add.reduceat((data[:used].astype(np.int64) & 0x7F) << (7 * place), starts)
    require(int(values.max()) < 1 << 32, f"byte {cursor.at}: a varint below 2^32")
    cursor.at += used
    return values


def varint(cursor):
    return int(varints(cursor, 1)[0])


def unzigzag(codes):
    """7.2: differences modulo 2^32, as int64."""
    codes = np.asarray(codes, np.int64)
    return np.where(codes % 2 == 0, codes // 2, (1 << 32) - (codes + 1) // 2)


def running(codes):
    """Values whose zigzag differences from the one before are `codes`, the first from 0."""
    return np.cumsum(unzigzag(codes), dtype=np.uint64).astype(np.int64) & 0xFFFFFFFF


def planes(cursor, width, count):
    """7.3: values below 2^32, as int64."""
    cursor.justify(count, width)
    data = np.frombuffer(cursor.take(width * count), np.uint8).reshape(width, count).astype(np.int64)
    return sum((data[k] << (8 * k) for k in range(width)), np.zeros(count, np.int64))


def bits_to_f32(values):
    return np.asarray(values, np.uint32).view(np.float32)


def octahedral(u, v, bits):
    """7.5: unit vectors (n, 3) of codes −M to M."""
    most = float((1 << (bits - 1)) - 1)
    p = np.clip(np.asarray(u, np.float64) / most, -1, 1)
    q = np.clip(np.asarray(v, np.float64) / most, -1, 1)
    z = 1 - np.abs(p) - np.abs(q)
    sign = lambda t: np.where(t < 0, -1.0, 1.0)
    x = np.where(z < 0, (1 - np.abs(q)) * sign(p), p)
    y = np.where(z < 0, (1 - np.abs(p)) * sign(q), q)
    length = np.sqrt(x * x + y * y + z * z)
    return np.stack([x / length, y / length, z / length], axis=-1).astype(np.float32)


def shared_exponents(cursor, count, bits):
    """7.6: vectors (n, 3)."""
    cursor.justify(count, 5 if bits == 8 else 6)
    plane = lambda: np.frombuffer(cursor.take(count), np.uint8).astype(np.int64)
    exponent, signs = plane(), plane()
    highs = np.zeros(count, np.int64) if bits == 8 else plane()
    low = [plane() for _ in range(3)]
    require(not (exponent == 255).any(), "exponents of 0 to 254")
    require(not (signs > 7).any() and not (highs > 63).any(), "unused bits of 0")
    step = np.ldexp(1.0, exponent - 126 - bits)
    vectors = np.zeros((count, 3), np.float32)
    for axis in range(3):
        mantissa = (highs >> (2 * axis) & 3) * 256 + low[axis]
        sign = np.where(signs >> axis & 1, -1.0, 1.0)
        vectors[:, axis] = (sign * mantissa * step).astype(np.float32)
    vectors[exponent == 0] = 0
    return vectors


def rows(cursor, count, links, columns_end):
    """7.7: offsets (rows + 1) and columns (links)."""
    lengths = varints(cursor, count)
    offsets = np.concatenate([[0], np.cumsum(lengths)])
    require(int(offsets[-1]) == links, f"rows of {links} links in all, found {offsets[-1]}")
    starts = offsets[:-1][lengths > 0]
    first = running(varints(cursor, len(starts)))
    is_first = np.zeros(links, bool)
    is_first[starts] = True
    steps = np.zeros(links, np.int64)
    steps[~is_first] = varints(cursor, links - len(starts)) + 1
    total = np.cumsum(steps)
    # What the gaps of a row sum to before each link, and the row's first column.
    row = np.repeat(np.arange(len(starts)), lengths[lengths > 0])
    columns = total - total[starts][row] + first[row]
    require(links == 0 or int(columns.max()) < columns_end, f"columns below {columns_end}")
    return offsets, columns


def assignment(cursor, count, end):
    """7.8: `count` values below `end`."""
    cursor.justify(count, 1)
    codes = cursor.take(count)
    fresh = iter(running(varints(cursor, codes.count(255))).tolist())
    recent, values = [], []
    for code in codes:
        if code == 255:
            value = next(fresh)
            require(value < end, f"a value below {end}, found {value}")
            del recent[254:]
        else:
            require(code < len(recent), f"one of {len(recent)} values seen before, found {code}")
            value = recent.pop(code)
        recent.insert(0, value)
        values.append(value)
    return np.array(values, np.int64)


def elements(cursor, count_rows, count, height, sigma):
    """7.10: offsets (rows + 1), heights and means (elements)."""
    cursor.justify(count, 1)
    symbols = np.frombuffer(cursor.take(count), np.uint8).astype(np.int64)
    require(not (symbols >= 252).any(), "symbols below 252")
    descent, kind = symbols % 21, symbols // 21
    heights, offsets, start = [], [0], 0
    for i, down in enumerate(descent.tolist()):
        most = height if start == 0 else (start & -start).bit_length() - 1
        require(down <= most, f"element {i}: a descent of at most {most}")
        heights.append(most - down)
        start += 1 << heights[-1]
        if start == 1 << height:
            start = 0
            offsets.append(i + 1)
    require(start == 0 and len(offsets) == count_rows + 1, f"{count_rows} whole rows")
    heights = np.array(heights, np.int64)
    steps = np.ceil(2.0 * np.sqrt(np.ldexp(1.0, heights)) / np.float64(sigma)) if count else np.zeros(0)
    steps = np.minimum(np.maximum(steps, 1.0), 65536.0)
    codes = np.where(kind <= 1, kind * steps, kind - 1.0)
    other = varints(cursor, int((kind == 11).sum()))
    require(len(other) == 0 or int(other.max()) <= 8388607, "codes of at most 8388607")
    codes[kind == 11] = other
    return np.array(offsets), heights, (codes / steps).astype(np.float32)


def positions(cursor, count):
    """6.6.1: (n, 3)."""
    mode = cursor.u8()
    require(mode <= 2, f"a position mode of 0 to 2, found {mode}")
    result = np.zeros((count, 3), np.float32)
    if mode == 0:
        for axis in range(3):
            result[:, axis] = bits_to_f32(planes(cursor, 4, count))
        return result
    origin = cursor.array("<f4", 3).astype(np.float64)
    step = np.float64(cursor.f32())
    require(np.isfinite(origin).all() and np.isfinite(step), "a finite grid")
    for axis in range(3):
        width = cursor.u8()
        require(1 <= width <= 4, f"a width of 1 to 4, found {width}")
        codes = planes(cursor, width, count)
        q = codes if mode == 1 else running(codes)
        result[:, axis] = (origin[axis] + q * step).astype(np.float32)
    return result


def normals_12(cursor, count):
    """6.6.2: (n, 3)."""
    cursor.justify(count, 3)
    high_u, high_v, low = [np.frombuffer(cursor.take(count), np.uint8).astype(np.int64) for _ in range(3)]
    return octahedral(high_u * 16 + low % 16 - 2047, high_v * 16 + low // 16 - 2047, 12)


def albedo(cursor, count, channels):
    """6.6.3: (n, 3); one channel is all three."""
    result = np.zeros((count, 3), np.float32)
    cursor.justify(count, 1)
    for channel in range(channels):
        high = np.frombuffer(cursor.take(count), np.uint8).astype(np.int64)
        low = np.frombuffer(cursor.take((count + 1) // 2), np.uint8).astype(np.int64)
        nibbles = np.stack([low % 16, low // 16], axis=-1).reshape(-1)[:count]
        t = (high * 16 + nibbles) / 4095.0
        result[:, channel:] = (t * t * (3.0 - 2.0 * t)).astype(np.float32)[:, None]
    return result
