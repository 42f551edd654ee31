"""Holds relit frames against Mitsuba 3, where it is installed: the same triangles, colours, lamp and camera.

    python compare_mitsuba.py --scene box.glb --size 160 120

The scene must be plain: triangles with base colours, which relight bakes as Lambert (`lambert=True`).
"""

import argparse
import pathlib
import tempfile

import numpy as np
import relight
from plain_glb import PlainGlb

BOX = pathlib.Path(__file__).resolve().parents[3] / "data" / "cornell.glb"
CAMERA = relight.Camera(position=(0.278, 0.273, -0.8), look_at=(0.278, 0.273, 0.0), vfov_deg=39)
LAMP = relight.Point(position=(0.35, 0.45, 0.2), intensity=(1.0, 0.9, 0.7), name="lamp")


def traced(mi, path, size, spp):
    """The scene in Mitsuba, by its path tracer."""
    scene = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 64},
        "sensor": {
            "type": "perspective",
            "fov": CAMERA.vfov_deg,
            "fov_axis": "y",
            "to_world": mi.ScalarTransform4f().look_at(origin=CAMERA.position, target=CAMERA.look_at, up=CAMERA.up),
            "film": {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}},
            "sampler": {"type": "independent", "sample_count": spp},
        },
        "lamp": {
            "type": "point",
            "position": list(LAMP.position),
            "intensity": {"type": "rgb", "value": list(LAMP.intensity)},
        },
    }
    glb = PlainGlb(path)
    for i, (vertices, faces, material) in enumerate(glb.primitives()):
        pbr = glb.json["materials"][material].get("pbrMetallicRoughness", {})
        color = pbr.get("baseColorFactor", (1, 1, 1, 1))[:3]
        properties = mi.Properties()
        diffuse = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(color)}}
        properties["bsdf"] = mi.load_dict({"type": "twosided", "nested": diffuse})
        mesh = mi.Mesh(f"mesh{i}", len(vertices), len(faces), props=properties)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = vertices.ravel()
        parameters["faces"] = faces.ravel()
        parameters.update()
        scene[f"mesh{i}"] = mesh
    return np.array(mi.render(mi.load_dict(scene)))[:, :, :3]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("asset", nargs="?", help="not looked at: the scene is baked anew, as Lambert")
    parser.add_argument("--scene", type=pathlib.Path, default=BOX, help=".glb of plain triangles")
    parser.add_argument("--size", nargs=2, type=int, default=(160, 120), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--spp", type=int, default=256)
    args = parser.parse_args()
    try:
        import mitsuba as mi
    except ImportError:
        print("Mitsuba is not installed (pip install mitsuba): nothing was compared.")
        return
    mi.set_variant("scalar_rgb")
    with tempfile.TemporaryDirectory() as folder:
        asset = relight.bake(args.scene, pathlib.Path(folder) / "a.relight", preset="draft", lambert=True)
        ours = asset.shot(CAMERA, tuple(args.size)).frame(LAMP)["beauty"]
    theirs = traced(mi, args.scene, args.size, args.spp)
    relight.write_exr("mitsuba.exr", {"beauty": ours, "mitsuba": theirs})
    off = ours.mean() / theirs.mean() - 1
    # Of blocks of pixels, whose noise is small.
    block = 4
    cut = [image[: image.shape[0] // block * block, : image.shape[1] // block * block] for image in (ours, theirs)]
    means = [c.reshape(c.shape[0] // block, block, -1, block, 3).mean(axis=(1, 3)) for c in cut]
    error = np.sqrt(((means[0] - means[1]) ** 2).mean() / (means[1] ** 2).mean())
    print(f"Mean radiance: {off:+.1%} of Mitsuba's; blocks of {block} × {block} pixels differ by {error:.1%}.")
    assert abs(off) < 0.05 and error < 0.1, "they differ"


if __name__ == "__main__":
    main()
