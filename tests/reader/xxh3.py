"""XXH3-64 with seed 0 and the default secret (SPEC 2), written from the algorithm's published description.

Blocks of long input are summed with numpy, everything else with Python's integers.
"""

import numpy as np

MASK = (1 << 64) - 1
P32_1, P32_2, P32_3 = 0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D
P64_1, P64_2, P64_3 = 0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9
P64_4, P64_5 = 0x85EBCA77C2B2AE63, 0x27D4EB2F165667C5
MX1, MX2 = 0x165667919E3779F9, 0x9FB21C651E98DF25

SECRET = bytes.fromhex(
    "b8fe6c3923a44bbe7c01812cf721ad1cded46de9839097db7240a4a4b7b3671f"
    "cb79e64eccc0e578825ad07dccff7221b8084674f743248ee03590e6813a264c"
    "3c2852bb91c300cb88d0658b1b532ea371644897a20df94e3819ef46a9deacd8"
    "a8fa763fe39c343ff9dcbbc7c70b4f1d8a51e04bcdb45931c89f7ec9d9787364"
    "eac5ac8334d3ebc3c581a0fffa1363eb170ddd51b7f0da49d316552629d4689e"
    "2b16be587d47a1fc8ff8b8d17ad031ce45cb3a8f95160428afd7fbcabb4b407e"
)

STRIPE = 64
STRIPES_PER_BLOCK = (len(SECRET) - STRIPE) // 8
BLOCK = STRIPE * STRIPES_PER_BLOCK


def _u32(data, at):
    return int.from_bytes(data[at : at + 4], "little")


def _u64(data, at):
    return int.from_bytes(data[at : at + 8], "little")


def _secret(at):
    return _u64(SECRET, at)


def _rotate(value, bits):
    return (value << bits | value >> (64 - bits)) & MASK


def _swap(value, count):
    return int.from_bytes(value.to_bytes(count, "little"), "big")


def _fold(a, b):
    product = a * b
    return (product ^ product >> 64) & MASK


def _avalanche(value):
    value ^= value >> 37
    value = value * MX1 & MASK
    return value ^ value >> 32


def _avalanche_64(value):
    value ^= value >> 33
    value = value * P64_2 & MASK
    value ^= value >> 29
    value = value * P64_3 & MASK
    return value ^ value >> 32


def _mix(data, at, secret):
    return _fold(_u64(data, at) ^ _secret(secret), _u64(data, at + 8) ^ _secret(secret + 8))


def _short(data):
    n = len(data)
    if n == 0:
        return _avalanche_64(_secret(56) ^ _secret(64))
    if n <= 3:
        combined = data[0] << 16 | data[n >> 1] << 24 | data[n - 1] | n << 8
        return _avalanche_64(combined ^ _u32(SECRET, 0) ^ _u32(SECRET, 4))
    if n <= 8:
        value = (_u32(data, n - 4) + (_u32(data, 0) << 32)) ^ _secret(8) ^ _secret(16)
        value ^= _rotate(value, 49) ^ _rotate(value, 24)
        value = value * MX2 & MASK
        value ^= (value >> 35) + n
        value = value * MX2 & MASK
        return value ^ value >> 28
    low = _u64(data, 0) ^ _secret(24) ^ _secret(32)
    high = _u64(data, n - 8) ^ _secret(40) ^ _secret(48)
    return _avalanche((n + _swap(low, 8) + high + _fold(low, high)) & MASK)


def _middle(data):
    n = len(data)
    total = n * P64_1
    if n <= 128:
        for i in range((n - 1) // 32, -1, -1):
            total += _mix(data, 16 * i, 32 * i) + _mix(data, n - 16 * (i + 1), 32 * i + 16)
        return _avalanche(total & MASK)
    total += sum(_mix(data, 16 * i, 16 * i) for i in range(8))
    total = _avalanche(total & MASK)
    total += sum(_mix(data, 16 * i, 16 * (i - 8) + 3) for i in range(8, n // 16))
    return _avalanche((total + _mix(data, n - 16, 136 - 17)) & MASK)


def _accumulate(stripes, keys):
    """Sum of what stripes (..., 8) add to the eight accumulators under keys (..., 8)."""
    keyed = stripes ^ keys
    product = (keyed & np.uint64(0xFFFFFFFF)) * (keyed >> np.uint64(32))
    swapped = stripes.reshape(stripes.shape[:-1] + (4, 2))[..., ::-1].reshape(stripes.shape)
    return product + swapped


def _key(at):
    return np.frombuffer(SECRET, dtype="<u8", count=8, offset=at)


def _long(data):
    n = len(data)
    total = np.array([P32_3, P64_1, P64_2, P64_3, P64_4, P32_2, P64_5, P32_1], dtype=np.uint64)
    keys = np.stack([_key(8 * i) for i in range(STRIPES_PER_BLOCK)])
    blocks = (n - 1) // BLOCK
    scramble, prime = _key(len(SECRET) - STRIPE), np.uint64(P32_1)
    # Chunks of 4 MiB keep the memory small.
    for first in range(0, blocks, 4096):
        count = min(4096, blocks - first)
        words = np.frombuffer(data, dtype="<u8", count=count * BLOCK // 8, offset=first * BLOCK)
        sums = _accumulate(words.reshape(count, STRIPES_PER_BLOCK, 8), keys).sum(axis=1, dtype=np.uint64)
        for row in sums:
            total = total + row
            total = (total ^ total >> np.uint64(47) ^ scramble) * prime
    rest = (n - 1 - BLOCK * blocks) // STRIPE
    words = np.frombuffer(data, dtype="<u8", count=rest * 8, offset=BLOCK * blocks).reshape(rest, 8)
    total = total + _accumulate(words, keys[:rest]).sum(axis=0, dtype=np.uint64)
    last = np.frombuffer(data[n - STRIPE : n], dtype="<u8")
    total = total + _accumulate(last, _key(len(SECRET) - STRIPE - 7))
    total = [int(value) for value in total]
    result = n * P64_1
    for i in range(4):
        result += _fold(total[2 * i] ^ _secret(11 + 16 * i), total[2 * i + 1] ^ _secret(19 + 16 * i))
    return _avalanche(result & MASK)


def xxh3_64(data):
    """The hash of bytes, as an integer."""
    if len(data) <= 16:
        return _short(data)
    return _middle(data) if len(data) <= 240 else _long(bytes(data))
