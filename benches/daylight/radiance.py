"""Radiance's way: rfluxmtx makes an image per patch of the sky, dctimestep adds them up."""

import math
import os
import pathlib
import shutil

import numpy as np

from processes import pipeline

SKY = """#@rfluxmtx h=u u=+Y
void glow groundglow
0
0
4 1 1 1 0
groundglow source ground
0
0
4 0 0 -1 180
#@rfluxmtx h=r1 u=+Y
void glow skyglow
0
0
4 1 1 1 0
skyglow source sky
0
0
4 0 0 1 180
"""


def find():
    """Where Radiance's programs are, and the environment that they take; None without them."""
    try:
        import pyradiance

        home = pathlib.Path(pyradiance.__file__).parent
    except ImportError:
        program = shutil.which("rfluxmtx")
        if not program:
            return None
        return pathlib.Path(program).parent, dict(os.environ)
    bin = home / "bin"
    return bin, dict(os.environ, PATH=f"{bin}:{os.environ['PATH']}", RAYPATH=f".:{home / 'lib'}")


def turned(points):
    """From x east, y up, z south to x east, y north, z up."""
    return np.stack([points[..., 0], -points[..., 2], points[..., 1]], axis=-1)


class Radiance:
    def __init__(self, home, scene, folder):
        self.bin, self.env = home
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "sky.rad").write_text(SKY)
        with (folder / "scene.rad").open("w") as out:
            for name, color, triangles in scene.surfaces:
                r, g, b = color
                out.write(f"void plastic {name}\n0\n0\n5 {r:.7g} {g:.7g} {b:.7g} 0 0\n")
                for i, triangle in enumerate(turned(triangles)):
                    numbers = " ".join(f"{v:.7g}" for v in triangle.ravel())
                    out.write(f"{name} polygon {name}.{i}\n0\n0\n9 {numbers}\n")
        with (folder / "scene.oct").open("wb") as out:
            self.scene_seconds = self.run([["oconv", "scene.rad"]], out)

    def run(self, commands, out=None):
        commands = [[str(self.bin / c[0]), *map(str, c[1:])] for c in commands]
        return pipeline(commands, cwd=self.folder, env=self.env, out=out)

    def images(self, view, size, options, rays, out, threads):
        """One image per patch, ground first. CPU seconds."""
        shutil.rmtree(self.folder / out, ignore_errors=True)
        (self.folder / out).mkdir()
        width, height = size
        right, up, back = (turned(axis) for axis in view.axes())
        vfov = math.radians(view.vfov_deg)
        hfov = 2 * math.atan(math.tan(vfov / 2) * width / height)
        look = ["-vtv", "-vp", *turned(np.array(view.position)), "-vd", *-back, "-vu", *up]
        look += ["-vh", math.degrees(hfov), "-vv", view.vfov_deg, "-vs", 0, "-vl", 0, "-vo", 0, "-va", 0]
        pixels = ["-x", width, "-y", height]
        rays_of = ["vwrays", "-ff", *look, *pixels, "-pa", 0, "-pj", 1, "-c", rays]
        flux = ["rfluxmtx", "-ffc", *pixels, "-ld-", "-n", threads, "-c", rays, *options]
        flux += ["-o", f"{out}/%03d.hdr", "-", "sky.rad", "-i", "scene.oct"]
        return self.run([rays_of, flux])

    def frames(self, patches, sky, out):
        """The frames of a sky, [frame, patch, RGB]. CPU seconds of all."""
        shutil.rmtree(self.folder / out, ignore_errors=True)
        (self.folder / out).mkdir()
        frames, count, _ = sky.shape
        # The ground is dark.
        matrix = np.zeros((count + 1, frames, 3), np.float32)
        matrix[1:] = sky.transpose(1, 0, 2)
        head = f"#?RADIANCE\nNROWS={count + 1}\nNCOLS={frames}\nNCOMP=3\nFORMAT=float\n\n"
        (self.folder / "sky.smx").write_bytes(head.encode() + matrix.tobytes())
        return self.run([["dctimestep", "-o", f"{out}/%03d.hdr", f"{patches}/%03d.hdr", "sky.smx"]])
