"""A second reader of the relight asset file, written from SPEC.md alone, with which the first one must agree.

It needs the standard library, numpy and one of the modules compression.zstd (Python 3.14), zstandard and pyzstd.

    python3 dump.py ASSET.relight           what is in it, value by value
    python3 dump.py --check FILE ...        a line for each: accepted, or refused and why
"""

import struct

import numpy as np

from codecs_of_spec import (
    Cursor,
    Refused,
    albedo,
    assignment,
    bits_to_f32,
    elements,
    normals_12,
    octahedral,
    planes,
    positions,
    require,
    rows,
    running,
    shared_exponents,
    unzigzag,
    varints,
)
from xxh3 import xxh3_64
from zstd_frame import decompress

VERSION = 7
MAGIC = bytes.fromhex("8b524c540d0a1a0a")
KINDS = {
    1: "provenance",
    2: "geometry",
    3: "materials",
    4: "textures",
    5: "stage",
    6: "points",
    7: "links_transfer",
    8: "links_bounce",
    9: "links_solution",
    10: "estimates",
    11: "senders",
    12: "light_tree",
    13: "cuts",
    14: "parted",
}
MOST_RECORD_BYTES = 16777216


def container(data):
    """Sections 3 and 4: {name: (version of the layout, raw bytes)} of all sections that this reader knows."""
    require(data[:8] == MAGIC, "the magic of an asset")
    require(len(data) >= 56, "a header of 56 bytes")
    mark, version, length, table, count, reserved, of_table, of_header = struct.unpack("<IIQQIIQQ", data[8:56])
    require(mark == 0x01020304, "the byte order mark")
    require(xxh3_64(data[:48]) == of_header, "the header's checksum")
    require(1 <= version <= VERSION, f"format version {version} is unsupported")
    require(reserved == 0, "a reserved field of 0")
    require(length == len(data), "the length of the file")
    require(1 <= count <= 256, "1 to 256 sections")
    require(table >= 56 and table + 48 * count == length, "a table that ends with the file")
    require(xxh3_64(data[table:]) == of_table, "the table's checksum")
    sections, kinds, end = {}, [], 56
    for i in range(count):
        entry = data[table + 48 * i : table + 48 * (i + 1)]
        kind, layout, flags, codec, needs, offset, stored, raw, checksum = struct.unpack("<IHHIIQQQQ", entry)
        name = KINDS.get(kind, f"unknown_{kind}")
        require(flags <= 1, f"{name}: flags of 0 or 1")
        require(kind not in kinds, f"{name}: each kind once")
        require(offset == end and offset + stored <= table, f"{name}: contiguous sections")
        kinds.append(kind)
        end += stored
        require(codec != 0 or raw == stored, f"{name}: as many raw bytes as stored")
        require(raw <= 1024 * stored, f"{name}: at most 1024 raw bytes for each stored")
        require(xxh3_64(data[offset:end]) == checksum, f"{name}: its checksum")
        if (name, layout) not in DECODE or codec > 1:
            require(flags == 0, f"{name}: unsupported, needs a reader of format version {needs}")
            continue
        body = data[offset:end]
        sections[name] = (layout, body if codec == 0 else decompress(body, raw))
    require(end == table, "sections that end at the table")
    require(kinds[0] == 1, "provenance as the first section")
    return sections


class Records:
    """7.9."""

    def __init__(self, cursor):
        require(cursor.left() <= MOST_RECORD_BYTES, "records of at most 16777216 bytes")
        self.cursor = cursor

    def string(self):
        length = self.cursor.u64()
        try:
            return self.cursor.take(length).decode("utf-8")
        except UnicodeDecodeError as error:
            raise Refused(f"a string of UTF-8: {error}") from error

    def list_of(self, item):
        count = self.cursor.u64()
        self.cursor.justify(count, 1)
        return [item() for _ in range(count)]

    def pair(self, first, second):
        return lambda: (first(), second())

    def bool(self):
        value = self.cursor.u8()
        require(value <= 1, f"a bool of 0 or 1, found {value}")
        return bool(value)

    def option(self, item):
        return item() if self.bool() else None

    def floats(self, count):
        return self.cursor.array("<f4", count)


def provenance(cursor):
    r = Records(cursor)
    left_out = lambda: {"what": r.string(), "why": r.string(), "saved_bytes": cursor.u64()}
    return {
        "tool_version": r.string(),
        "settings": r.list_of(r.pair(r.string, r.string)),
        "source_hash": cursor.u64(),
        "seed": cursor.u64(),
        "lambert": r.bool(),
        "left_out": r.list_of(left_out),
        "counts": r.list_of(r.pair(r.string, cursor.u64)),
        "notes": r.list_of(r.string),
    }


def floats(cursor, width, count):
    """6.2.1: (n, width)."""
    mode = cursor.u8()
    if mode == 0:
        return cursor.array("<f4", count * width).reshape(count, width)
    require(mode == 1, f"a float mode of 0 or 1, found {mode}")
    columns = [bits_to_f32(running(planes(cursor, 4, count))) for _ in range(width)]
    return np.stack(columns, axis=-1)


def normal_codes(cursor, count):
    """6.2.2: the two codes of each."""
    return planes(cursor, 2, count), planes(cursor, 2, count)


def normals_16(cursor, count):
    """6.2.2: (n, 3)."""
    u, v = normal_codes(cursor, count)
    return octahedral(u - 32767, v - 32767, 16)


def indices(cursor, count, vertices):
    """6.2.3: (n, 3)."""
    cursor.justify(count, 3)
    result, following = [], 0
    for back in unzigzag(varints(cursor, 3 * count)).tolist():
        index = (following - back) % (1 << 32)
        require(index < vertices, f"a vertex index below {vertices}, found {index}")
        following = max(following, index + 1)
        result.append(index)
    return np.array(result, np.int64).reshape(count, 3)


def mesh(cursor):
    vertices, triangles, material = cursor.u32(), cursor.u32(), cursor.u32()
    flags, uv_sets = cursor.u8(), cursor.u8()
    require(flags <= 7 and uv_sets <= 8, "mesh flags of 0 to 7 and at most 8 sets of coordinates")
    cursor.zeros(2)
    result = {"material": material, "positions": floats(cursor, 3, vertices)}
    codes = normal_codes(cursor, vertices) if flags & 1 else None
    result["normals"] = None if codes is None else octahedral(codes[0] - 32767, codes[1] - 32767, 16)
    result["uvs"] = [floats(cursor, 2, vertices) for _ in range(uv_sets)]
    result["colors"] = floats(cursor, 4, vertices) if flags & 2 else None
    result["tangents"] = None
    if flags & 4:
        directions = normals_16(cursor, vertices)
        cursor.justify(vertices, 1)
        hands = np.frombuffer(cursor.take(vertices), np.uint8)
        require(not (hands > 1).any(), "a handedness of 0 or 1")
        signs = np.where(hands == 0, 1, -1).astype(np.float32)
        result["tangents"] = np.concatenate([directions, signs[:, None]], axis=1)
    result["triangles"] = indices(cursor, triangles, vertices)
    return result


def geometry(cursor):
    count = cursor.u32()
    cursor.justify(count, 16)
    meshes = [mesh(cursor) for _ in range(count)]
    count = cursor.u32()
    cursor.justify(count, 52)
    instances = [{"mesh": cursor.u32(), "world_from_mesh": cursor.array("<f4", 12)} for _ in range(count)]
    return {"meshes": meshes, "instances": instances}


def materials(cursor, version=1):
    r = Records(cursor)

    def alpha_mode():
        variant = cursor.u32()
        most = 3 if version >= 2 else 2
        require(variant <= most, f"an alpha mode of 0 to {most}, found {variant}")
        return (variant, r.floats(1) if variant in (1, 3) else None)

    def texture_ref():
        return {"texture": cursor.u32(), "uv_set": cursor.u8(), "transform": r.floats(6)}

    def material():
        return {
            "name": r.string(),
            "base_color": r.floats(4),
            "metallic": r.floats(1),
            "roughness": r.floats(1),
            "emissive": r.floats(3),
            "alpha_mode": alpha_mode(),
            "double_sided": r.bool(),
            "unlit": r.bool(),
            "normal_scale": r.floats(1),
            "base_color_texture": r.option(texture_ref),
            "metallic_roughness_texture": r.option(texture_ref),
            "normal_texture": r.option(texture_ref),
            "emissive_texture": r.option(texture_ref),
        }

    def extensions():
        return {
            "material": cursor.u32(),
            "ior": r.floats(1),
            "specular": r.floats(1),
            "specular_color": r.floats(3),
            "clearcoat": r.floats(1),
            "clearcoat_roughness": r.floats(1),
            "clearcoat_normal_scale": r.floats(1),
            "sheen_color": r.floats(3),
            "sheen_roughness": r.floats(1),
            "anisotropy": r.floats(1),
            "anisotropy_rotation": r.floats(1),
            "iridescence": r.floats(1),
            "iridescence_ior": r.floats(1),
            "iridescence_thickness": r.floats(2),
            "specular_texture": r.option(texture_ref),
            "specular_color_texture": r.option(texture_ref),
            "clearcoat_texture": r.option(texture_ref),
            "clearcoat_roughness_texture": r.option(texture_ref),
            "clearcoat_normal_texture": r.option(texture_ref),
            "sheen_color_texture": r.option(texture_ref),
            "sheen_roughness_texture": r.option(texture_ref),
            "anisotropy_texture": r.option(texture_ref),
            "iridescence_texture": r.option(texture_ref),
            "iridescence_thickness_texture": r.option(texture_ref),
        }

    def glass():
        return {
            "material": cursor.u32(),
            "thickness": r.floats(1),
            "absorption": r.floats(3),
            "transmission_texture": r.option(texture_ref),
        }

    found = r.list_of(material)
    for further in r.list_of(extensions) if version >= 3 else []:
        require(further["material"] < len(found), "extensions of a material that is there")
        require("extensions" not in found[further["material"]], "extensions of each material once")
        require(not any("extensions" in later for later in found[further["material"] :]), "extensions by rising material")
        found[further.pop("material")]["extensions"] = further
    for body in r.list_of(glass) if version >= 4 else []:
        require(body["material"] < len(found), "glass of a material that is there")
        require("glass" not in found[body["material"]], "glass of each material once")
        require(not any("glass" in later for later in found[body["material"] :]), "glass by rising material")
        found[body.pop("material")]["glass"] = body
    return found


def textures(cursor):
    count = cursor.u32()
    cursor.justify(count, 16)

    def texture():
        wrap_u, wrap_v, smooth = cursor.u8(), cursor.u8(), cursor.u8()
        require(wrap_u <= 2 and wrap_v <= 2 and smooth <= 1, "a sampler of 6.4")
        cursor.zeros(1)
        mime_bytes, image_bytes = cursor.u32(), cursor.u64()
        mime, image = cursor.take(mime_bytes), cursor.take(image_bytes)
        require(mime in (b"image/png", b"image/jpeg"), "image/png or image/jpeg")
        return {"wrap": (wrap_u, wrap_v), "filter": smooth, "mime": mime.decode(), "image": image}

    return [texture() for _ in range(count)]


def stage(cursor):
    try:
        return cursor.take(cursor.left()).decode("utf-8")
    except UnicodeDecodeError as error:
        raise Refused(f"UTF-8 text: {error}") from error


def widenings(cursor, n):
    """6.6.4."""
    widened = cursor.u8()
    require(widened <= 1, "0 or 1: whether points are widened")
    found = np.frombuffer(cursor.take(n), np.uint8) if widened else None
    require(found is None or (found <= 31).all(), "widenings of 0 to 31")
    return {} if found is None or n == 0 else {"widenings": found.astype(np.uint32)}


def points(cursor, version=1):
    channels = {1: 3, 2: 1}.get(version) or cursor.u8()
    require(channels in (1, 3), "1 or 3 channels of albedo")
    count = cursor.u32()
    cursor.justify(count, 13)

    def level():
        disk, support, n = cursor.f32(), cursor.f32(), cursor.u32()
        require(disk > 0 and support > 0, "radii above 0")
        found = {
            "disk_radius": np.array([disk]),
            "support_radius": np.array([support]),
            "positions": positions(cursor, n),
            "normals": normals_12(cursor, n),
            "albedo": albedo(cursor, n, channels),
        }
        return found | widenings(cursor, n) if version == 3 else found

    return [level() for _ in range(count)]


def links_transfer(cursor, bits=10):
    receivers, senders, count = cursor.u32(), cursor.u32(), cursor.u32()
    offsets, columns = rows(cursor, receivers, count, senders)
    return {
        "receivers": receivers,
        "senders": senders,
        "row_offsets": offsets,
        "columns": columns,
        "vectors": shared_exponents(cursor, count, bits),
    }


def weights(cursor):
    """6.8."""
    size, count = cursor.u32(), cursor.u32()
    offsets, columns = rows(cursor, size, count, size)
    row_sums = bits_to_f32(planes(cursor, 4, size))
    fractions = planes(cursor, 2, count)
    total = np.concatenate([[0], np.cumsum(fractions)])
    sums = total[offsets[1:]] - total[offsets[:-1]]
    scale = np.where(sums > 0, row_sums.astype(np.float64) / np.maximum(sums, 1), 0.0)
    values = (np.repeat(scale, np.diff(offsets)) * fractions).astype(np.float32)
    row = np.repeat(np.arange(size), np.diff(offsets))
    sums = np.bincount(row, weights=values, minlength=size)
    require((np.abs(sums - row_sums) <= 1e-4 * np.abs(row_sums.astype(np.float64))).all(), "weights that sum to their row sum")
    return {"rows": size, "row_offsets": offsets, "columns": columns, "weights": values, "row_sums": row_sums}


def links_bounce(cursor):
    return {"level": cursor.u32(), "matrix": weights(cursor)}


def links_solution(cursor):
    level, channels = cursor.u32(), cursor.u32()
    require(channels in (1, 3), "1 or 3 channels")
    return {"level": level, "channels": [weights(cursor) for _ in range(channels)]}


def estimates(cursor):
    r = Records(cursor)
    return r.list_of(r.pair(r.string, lambda: cursor.array("<f8", 1)))


def senders(cursor):
    finest, levels = cursor.u32(), cursor.u32()
    require(levels >= 1, "at least 1 sender level")
    counts = cursor.array("<u4", levels).astype(np.int64)
    leaf = assignment(cursor, finest, int(counts[-1]))
    cursor.justify(finest, 1)
    importance = np.frombuffer(cursor.take(finest), np.uint8)
    parents = [assignment(cursor, int(counts[i]), int(counts[i - 1])) for i in range(1, levels)]
    return {"counts": counts, "leaf_of_point": leaf, "importance": importance, "parents": parents}


def light_tree(cursor):
    kind, height = cursor.u8(), cursor.u8()
    require(kind <= 1 and 8 <= height <= 20, "lights of kind 0 or 1, a height of 8 to 20")
    cursor.zeros(2)
    count = 1 << height
    if kind == 0:
        order = running(varints(cursor, count))
        require((np.sort(order) == np.arange(count)).all(), "a permutation of the lattice")
        return {"height": height, "order": order}
    area = cursor.f32()
    require(area > 0, "an area above 0")
    return {
        "height": height,
        "area": np.array([area]),
        "positions": positions(cursor, count),
        "normals": normals_12(cursor, count),
    }


def cuts(cursor):
    sites, height = cursor.u8(), cursor.u8()
    require(sites == 0 and height <= 20, "sites of kind 0, a height of at most 20")
    cursor.zeros(2)
    sigma, unit, count_rows, count = cursor.f32(), cursor.f32(), cursor.u32(), cursor.u32()
    require(sigma > 0 and unit > 0 and count_rows > 0, "sigma and unit above 0, a site")
    offsets, heights, values = elements(cursor, count_rows, count, height, sigma)
    return {
        "height": height,
        "sigma": np.array([sigma]),
        "unit": np.array([unit]),
        "row_offsets": offsets,
        "heights": heights,
        "values": values,
    }


def parted(cursor):
    pairs, near = cursor.u32(), cursor.u32()
    columns = []
    for count in (pairs, pairs, near):
        width = cursor.u8()
        require(1 <= width <= 4, "1 to 4 byte planes")
        columns.append(planes(cursor, width, count))
    points, parents = np.cumsum(columns[0]) & 0xFFFFFFFF, columns[1]
    nearest = np.cumsum(columns[2]) & 0xFFFFFFFF
    ascending = (points[1:] > points[:-1]) | (points[1:] == points[:-1]) & (parents[1:] > parents[:-1])
    require(ascending.all(), "pairs in ascending order")
    require((nearest[1:] > nearest[:-1]).all(), "points in ascending order")
    return {"points": points, "parents": parents, "near": nearest}


# By section and version of its layout: what this reader decodes.
DECODE = {
    (name, 1): decode
    for name, decode in {
        "provenance": provenance,
        "geometry": geometry,
        "materials": materials,
        "textures": textures,
        "stage": stage,
        "points": points,
        "links_transfer": links_transfer,
        "links_bounce": links_bounce,
        "links_solution": links_solution,
        "estimates": estimates,
        "senders": senders,
        "light_tree": light_tree,
        "cuts": cuts,
        "parted": parted,
    }.items()
}
# 6.3, version 2, 6.6, versions 2 and 3, and 6.7, version 2.
DECODE["materials", 2] = lambda cursor: materials(cursor, version=2)
DECODE["materials", 3] = lambda cursor: materials(cursor, version=3)
DECODE["materials", 4] = lambda cursor: materials(cursor, version=4)
DECODE["points", 2] = lambda cursor: points(cursor, version=2)
DECODE["points", 3] = lambda cursor: points(cursor, version=3)
DECODE["links_transfer", 2] = lambda cursor: links_transfer(cursor, bits=8)


def check_finite(name, value):
    """7.4, in all that was decoded."""
    if isinstance(value, dict):
        for key, part in value.items():
            check_finite(f"{name}.{key}", part)
    elif isinstance(value, (list, tuple)):
        for part in value:
            check_finite(name, part)
    elif isinstance(value, np.ndarray) and value.dtype.kind == "f":
        require(np.isfinite(value).all(), f"{name}: finite numbers")


def check_extensions(further, textures):
    """6.3, version 3: the ranges, and textures that are there."""
    shares = ("specular", "clearcoat", "clearcoat_roughness", "sheen_color", "sheen_roughness", "anisotropy", "iridescence")
    for name, value in further.items():
        if name.endswith("_texture"):
            require(value is None or value["texture"] < textures, "materials: a texture that is there")
        elif name in shares:
            require(((value >= 0) & (value <= 1)).all(), f"materials: {name} of 0 to 1")
        elif name in ("specular_color", "iridescence_thickness"):
            require((value >= 0).all(), f"materials: {name} of at least 0")
        elif name in ("ior", "iridescence_ior"):
            require(((value >= 1) | ((value == 0) & (name == "ior"))).all(), f"materials: {name} of at least 1")


def check_glass(body, textures):
    """6.3, version 4."""
    for name, value in body.items():
        if name == "transmission_texture":
            require(value is None or value["texture"] < textures, "materials: a texture that is there")
        else:
            require((value >= 0).all(), f"materials: {name} of at least 0")


def check_whole(asset):
    """What section 6 says of several sections together."""
    shapes = asset.get("geometry", {"meshes": [], "instances": []})
    surfaces = asset.get("materials", [])
    for part in shapes["meshes"]:
        require(part["material"] < len(surfaces), "geometry: a material that is there")
    for part in shapes["instances"]:
        require(part["mesh"] < len(shapes["meshes"]), "geometry: a mesh that is there")
    for surface in surfaces:
        require((surface["emissive"] >= 0).all(), "materials: emission of at least 0")
        for use in ("base_color", "metallic_roughness", "normal", "emissive"):
            texture = surface[f"{use}_texture"]
            require(texture is None or texture["texture"] < len(asset.get("textures", [])), "materials: a texture that is there")
        check_extensions(surface.get("extensions", {}), len(asset.get("textures", [])))
        check_glass(surface.get("glass", {}), len(asset.get("textures", [])))
    sizes = [len(level["positions"]) for level in asset.get("points", [])]
    require(sum(sizes) < 1 << 32, "points: at most 2^32 − 1")
    clusters = []
    if "senders" in asset:
        tree = asset["senders"]
        clusters = tree["counts"].tolist()
        require(len(clusters) <= len(sizes) and clusters == sizes[: len(clusters)], "senders: a cluster for each point")
        require(len(tree["leaf_of_point"]) == sizes[-1], "senders: a cluster of each finest point")
    if "links_transfer" in asset:
        links = asset["links_transfer"]
        require(links["receivers"] == sum(sizes), "links_transfer: a row for each point")
        require(links["senders"] == sum(clusters), "links_transfer: a column for each cluster")
    for name in ("links_bounce", "links_solution"):
        if name in asset:
            part = asset[name]
            require(part["level"] < len(clusters), f"{name}: a sender level that is there")
            for matrix in part.get("channels", [part.get("matrix")]):
                require(matrix["rows"] == clusters[part["level"]], f"{name}: a row for each cluster")
                sums = matrix["row_sums"]
                require((sums >= 0).all(), f"{name}: row sums of at least 0")
                require(name != "links_bounce" or (sums <= 1).all(), f"{name}: row sums of at most 1")
    if "parted" in asset:
        part = asset["parted"]
        starts = np.cumsum([0, *sizes])
        level = np.searchsorted(starts, part["points"], side="right") - 1
        require((part["points"] < starts[-1]).all(), "parted: points that are there")
        require((part["parents"] < starts[np.minimum(level, len(sizes))]).all(), "parted: points of coarser levels")
        require((part["near"] < (sizes[-1] if sizes else 0)).all(), "parted: points of the finest level")
    if "cuts" in asset:
        part = asset["cuts"]
        require("light_tree" in asset, "cuts: a light tree")
        require(part["height"] == asset["light_tree"]["height"], "cuts: the height of the light tree")
        sites = sizes[-1] if sizes else 0
        require(len(part["row_offsets"]) - 1 == sites, "cuts: a cut for each site")


def read(data):
    """The sections of a file's bytes as {name: content}; refuses what breaks a rule with `Refused`."""
    asset = {}
    for name, (layout, raw) in container(data).items():
        cursor = Cursor(raw)
        try:
            asset[name] = DECODE[name, layout](cursor)
            cursor.end()
        except Refused as error:
            raise Refused(f"{name}: {error}") from error
    check_finite("asset", asset)
    check_whole(asset)
    return asset
