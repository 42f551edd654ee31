"""Reads what is plain in a .glb: triangles of accessors that are neither sparse nor compressed, for other programs to render."""

import json
import struct

import numpy as np

COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}


class PlainGlb:
    """`json`: the document as it stands in the file."""

    def __init__(self, path):
        data = path.read_bytes()
        length = struct.unpack_from("<I", data, 12)[0]
        self.json, self._binary = json.loads(data[20 : 20 + length]), data[28 + length :]

    def view(self, index):
        """The bytes of a buffer view."""
        view = self.json["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self._binary[start : start + view["byteLength"]]

    def accessor(self, index):
        """An array of shape (count, components)."""
        a = self.json["accessors"][index]
        view, dtype, columns = self.json["bufferViews"][a["bufferView"]], np.dtype(TYPES[a["componentType"]]), COLUMNS[a["type"]]
        start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        stride = view.get("byteStride", dtype.itemsize * columns)
        return np.ndarray((a["count"], columns), dtype, self._binary, start, (stride, dtype.itemsize))

    def primitives(self):
        """Of each primitive that the scene shows its vertices in world space, metres, its triangles (indices), and its material's index."""
        for root in self.json["scenes"][self.json.get("scene", 0)]["nodes"]:
            yield from self._below(root, np.eye(4))

    def _below(self, node, parent):
        n = self.json["nodes"][node]
        world = parent @ _matrix(n)
        for primitive in self.json["meshes"][n["mesh"]]["primitives"] if "mesh" in n else ():
            vertices = self.accessor(primitive["attributes"]["POSITION"]) @ world[:3, :3].T + world[:3, 3]
            triangles = self.accessor(primitive["indices"]).reshape(-1, 3)
            yield vertices.astype(np.float32), triangles.astype(np.uint32), primitive["material"]
        for child in n.get("children", ()):
            yield from self._below(child, world)


def _matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"]).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    local = np.eye(4)
    local[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)))
    local[:3, 3] = node.get("translation", (0, 0, 0))
    return local
