"""Matt scenes that every program reads the same: triangles in colours, without textures, normals or gloss.

Axes are glTF's: x east, y up, z south. Radiance gets x east, y north, z up.
"""

import io
import json
import math
import struct
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "crates/python/examples"))
from plain_glb import PlainGlb  # noqa: E402

# Of triangles that count, m²: Radiance warns of smaller ones.
LEAST_AREA = 1e-10


@dataclass
class View:
    """What a camera sees: 16:9, upright."""

    name: str
    position: tuple
    look_at: tuple
    vfov_deg: float

    def axes(self):
        """Right, up and backward, unit."""
        back = np.subtract(self.position, self.look_at)
        back = back / np.linalg.norm(back)
        right = np.cross((0, 1, 0), back)
        right /= np.linalg.norm(right)
        return right, np.cross(back, right), back


@dataclass
class Scene:
    """Surfaces as (name, linear RGB reflectance, vertices of triangles [n, 3, 3])."""

    name: str
    surfaces: list
    views: list

    def triangles(self):
        return sum(len(triangles) for _, _, triangles in self.surfaces)


def whole(triangles):
    edges = triangles[:, 1:] - triangles[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
    return triangles[area > LEAST_AREA].astype(np.float32)


def linear(srgb):
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def read_glb(path):
    """Surfaces of a .glb (plain accessors), each material in the mean colour of its texture."""
    from PIL import Image

    glb = PlainGlb(path)
    gltf = glb.json

    def color(material):
        pbr = material.get("pbrMetallicRoughness", {})
        rgb = np.array(pbr.get("baseColorFactor", (1, 1, 1, 1))[:3])
        if "baseColorTexture" in pbr:
            image = gltf["images"][gltf["textures"][pbr["baseColorTexture"]["index"]]["source"]]
            pixels = Image.open(io.BytesIO(glb.view(image["bufferView"]))).convert("RGB")
            rgb = rgb * linear(np.asarray(pixels) / 255).mean(axis=(0, 1))
        return tuple(float(v) for v in rgb)

    colors = [color(material) for material in gltf["materials"]]
    found = [[] for _ in colors]

    for vertices, triangles, material in glb.primitives():
        found[material].append(vertices[triangles])
    return [
        (f"matt{i}", colors[i], whole(np.concatenate(parts))) for i, parts in enumerate(found) if parts
    ]


def sponza(path):
    """A yard: little of its light comes straight from the sky."""
    return Scene(
        "sponza",
        read_glb(path),
        [
            View("yard", (-10.2, 1.9, 0.6), (-0.4, 3.5, -0.3), 55),
            View("aisle", (9.5, 1.7, 4.6), (-2.0, 2.6, 4.0), 55),
        ],
    )


def room():
    """A furnished room, 5 x 6 x 2.8 m, with an opening of 4 x 1.9 m to the south, and the ground outside."""
    boxes = []

    def box(color, low, high):
        boxes.append((color, np.array(low, float), np.array(high, float)))

    wall, floor, ceiling, wood, cloth, ground = "wall", "floor", "ceiling", "wood", "cloth", "ground"
    colors = {
        wall: (0.7, 0.68, 0.63),
        floor: (0.36, 0.27, 0.19),
        ceiling: (0.8, 0.8, 0.8),
        wood: (0.5, 0.36, 0.22),
        cloth: (0.16, 0.28, 0.4),
        ground: (0.2, 0.2, 0.18),
    }
    box(floor, (-2.7, -0.2, -6.2), (2.7, 0, 0.2))
    box(ceiling, (-2.7, 2.8, -6.2), (2.7, 3, 0.2))
    box(wall, (-2.7, 0, -6.2), (-2.5, 2.8, 0.2))
    box(wall, (2.5, 0, -6.2), (2.7, 2.8, 0.2))
    box(wall, (-2.5, 0, -6.2), (2.5, 2.8, -6))
    # Around the opening.
    box(wall, (-2.5, 0, 0), (2.5, 0.7, 0.2))
    box(wall, (-2.5, 2.6, 0), (2.5, 2.8, 0.2))
    box(wall, (-2.5, 0.7, 0), (-2, 2.6, 0.2))
    box(wall, (2, 0.7, 0), (2.5, 2.6, 0.2))
    # A table with its chairs, a sofa, a cupboard, shelves.
    box(wood, (-0.9, 0.7, -3.2), (0.9, 0.74, -2.3))
    for x in (-0.85, 0.79):
        for z in (-3.15, -2.41):
            box(wood, (x, 0, z), (x + 0.06, 0.7, z + 0.06))
    for z, back in ((-3.75, -3.8), (-2.1, -1.7)):
        box(cloth, (-0.25, 0.42, z), (0.25, 0.47, z + 0.45))
        box(cloth, (-0.25, 0.47, back), (0.25, 0.95, back + 0.05))
        for x in (-0.25, 0.21):
            for leg in (z, z + 0.41):
                box(wood, (x, 0, leg), (x + 0.04, 0.42, leg + 0.04))
    box(cloth, (-2.4, 0.1, -5.2), (-1.6, 0.42, -3.2))
    box(cloth, (-2.4, 0.42, -5.2), (-2.15, 0.85, -3.2))
    box(wood, (1.9, 0, -5.9), (2.45, 2.1, -4.6))
    for y in (0.1, 0.55, 1.0, 1.45, 1.9):
        box(wood, (2.15, y, -4.2), (2.45, y + 0.03, -2.6))
    box(wood, (2.15, 0, -4.23), (2.45, 2.0, -4.2))
    box(wood, (2.15, 0, -2.6), (2.45, 2.0, -2.57))
    box(ground, (-60, -0.4, -60), (60, -0.25, 60))

    corners = np.array([[(i >> k) & 1 for k in range(3)] for i in range(8)])
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = np.array([f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))])
    surfaces = []
    for name, color in colors.items():
        parts = [(low + corners * (high - low))[faces] for c, low, high in boxes if c == name]
        surfaces.append((name, color, whole(np.concatenate(parts))))
    return Scene(
        "room",
        surfaces,
        [
            View("window", (-2.2, 1.6, -5.6), (1.2, 1.0, -1.2), 60),
            View("back", (1.9, 1.7, -0.4), (-0.6, 0.9, -4.2), 60),
        ],
    )


def write_glb(scene, path):
    """For relight, with the views as cameras."""
    binary, views, accessors, primitives, materials = bytearray(), [], [], [], []
    for name, color, triangles in scene.surfaces:
        points = triangles.reshape(-1, 3)
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": points.nbytes})
        binary += points.tobytes()
        low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        part = {"bufferView": len(accessors), "componentType": 5126, "count": len(points), "type": "VEC3"}
        primitives.append({"attributes": {"POSITION": len(accessors)}, "material": len(materials)})
        accessors.append(part | {"min": low, "max": high})
        pbr = {"baseColorFactor": [*color, 1], "metallicFactor": 0, "roughnessFactor": 1}
        materials.append({"name": name, "doubleSided": True, "pbrMetallicRoughness": pbr})
    cameras, nodes = [], [{"mesh": 0}]
    for view in scene.views:
        angle = math.radians(view.vfov_deg)
        perspective = {"yfov": angle, "aspectRatio": 16 / 9, "znear": 0.01}
        columns = [*view.axes(), np.array(view.position)]
        matrix = [v for c, w in zip(columns, (0, 0, 0, 1)) for v in [*map(float, c), w]]
        nodes.append({"name": view.name, "camera": len(cameras), "matrix": matrix})
        cameras.append({"type": "perspective", "name": view.name, "perspective": perspective})
    gltf = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "cameras": cameras,
        "meshes": [{"primitives": primitives}],
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    chunks = [(0x4E4F534A, text), (0x004E4942, bytes(binary))]
    body = b"".join(struct.pack("<II", len(chunk), kind) + chunk for kind, chunk in chunks)
    path.write_bytes(struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body)
