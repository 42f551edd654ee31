"""Truth, by paths that Mitsuba 3's ray caster follows, and Mitsuba's own path tracer beside it.

One set of paths serves several skies: what a path brings from a patch counts for each of them. At every vertex a direction into the sky
is drawn, patch by patch as much as they were seen to bring, and weighted with the reflected direction that finds the sky by itself
(balance heuristic). Nothing of this comes from relight or Radiance.
"""

import math
import time

import numpy as np

import sky

# Reflections after which paths end by chance (Russian roulette), and the most.
CERTAIN_REFLECTIONS = 5
MOST_REFLECTIONS = 64
MOST_SURVIVING = 0.95
# Paths at once, those that find out which patches matter, and the share of all that goes to all of the sky alike.
AT_ONCE = 1 << 21
PILOT = 1 << 20
EVEN = 0.1
# Of the map of patches for Mitsuba's own path tracer: edges of patches are blurred by a pixel.
MAP = (2048, 1024)


def find():
    """Mitsuba on all cores, by LLVM; None without."""
    try:
        import mitsuba as mi

        mi.set_variant("llvm_ad_rgb")
        mi.Float([0.0, 1.0]) + 1
        return mi
    except (ImportError, RuntimeError, AttributeError):
        return None


def read(mi, path):
    """RGB of an image file, [height, width, 3]."""
    bitmap = mi.Bitmap(str(path))
    return np.array(bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False), np.float64)


class Tracer:
    def __init__(self, mi, scene):
        self.mi, self.scene = mi, scene
        self.shapes = {}
        for i, (name, color, triangles) in enumerate(scene.surfaces):
            diffuse = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(color)}}
            self.shapes[name] = self.mesh(f"mesh{i}", triangles, {"type": "twosided", "nested": diffuse})
        everything = np.concatenate([triangles for _, _, triangles in scene.surfaces])
        merged = self.mesh("all", everything, {"type": "diffuse"})
        self.caster = mi.load_dict({"type": "scene", "all": merged})
        colors = np.repeat([c for _, c, _ in scene.surfaces], [len(t) for _, _, t in scene.surfaces], axis=0)
        self.colors = [mi.Float(colors[:, c].astype(np.float32)) for c in range(3)]

    def mesh(self, name, triangles, bsdf):
        mi = self.mi
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(bsdf)
        mesh = mi.Mesh(name, 3 * len(triangles), len(triangles), props=properties)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = triangles.ravel()
        parameters["faces"] = np.arange(3 * len(triangles), dtype=np.uint32)
        parameters.update()
        return mesh

    def truth(self, view, size, step, skies, spp, parts, seed=1):
        """Images under some skies, [part, sky, height / step, width / step, RGB], each part from paths of its own: every `step`th pixel
        in both directions, from the first."""
        patches = sky.patches()
        even = patches["solid_angle"] / patches["solid_angle"].sum()
        at_hand = max(1, PILOT * step * step // (size[0] * size[1]))
        bright = skies.mean(axis=(0, 2))
        chances = even * bright / (even * bright).sum()
        mattering = self.paths(view, size, step, skies, chances, at_hand, seed)[1]
        chances = (1 - EVEN) * np.sqrt(mattering) / np.sqrt(mattering).sum() + EVEN * even
        pixels = -(-size[0] // step) * -(-size[1] // step)
        passes = -(-spp * pixels // AT_ONCE)
        images = []
        for part in range(parts):
            made = [
                self.paths(view, size, step, skies, chances, -(-spp // passes), seed + 1 + part * passes + p)[0]
                for p in range(passes)
            ]
            images.append(np.mean(made, axis=0))
        return np.array(images)

    def paths(self, view, size, step, skies, chances, spp, seed):
        """Images, and of each patch what it brought, squared."""
        import drjit as dr

        mi = self.mi
        patches = sky.patches()
        table = {key: mi.Float(value.astype(np.float32)) for key, value in patches.items()}
        density = mi.Float((chances / patches["solid_angle"]).astype(np.float32))
        choice = mi.DiscreteDistribution(mi.Float(chances.astype(np.float32)))
        radiance = [mi.Float(sky_[:, c].astype(np.float32)) for sky_ in skies for c in range(3)]
        grey = mi.Float(skies.mean(axis=(0, 2)).astype(np.float32))
        brought = dr.zeros(mi.Float, sky.COUNT)

        width, height = -(-size[0] // step), -(-size[1] // step)
        lane = dr.arange(mi.UInt32, width * height * spp)
        pixel = lane // spp
        random = mi.PCG32(initstate=lane, initseq=seed)
        x = mi.Float(pixel % width) * step + random.next_float32()
        y = mi.Float(pixel // width) * step + random.next_float32()
        right, up, back = (mi.Vector3f(*map(float, axis)) for axis in view.axes())
        scale = math.tan(math.radians(view.vfov_deg) / 2)
        across = (x / size[0] * 2 - 1) * (scale * size[0] / size[1])
        along = (1 - y / size[1] * 2) * scale
        ray = mi.Ray3f(mi.Point3f(*view.position), dr.normalize(across * right + along * up - back))

        sums = walk(
            mi, dr, self.caster, self.colors, table, density, choice, radiance, grey, brought, ray, random
        )
        images = np.array([np.array(s).reshape(height, width, spp).mean(axis=2, dtype=np.float64) for s in sums])
        images = images.reshape(len(skies), 3, height, width).transpose(0, 2, 3, 1)
        return images, np.array(brought, np.float64)

    def rendered(self, view, size, radiance, spp, seed):
        """An image of Mitsuba's own path tracer under patches of these radiances, [patch, RGB], and its CPU seconds."""
        mi = self.mi
        width, height = MAP
        x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
        # Columns of maps go clockwise, seen from above, and begin at -z, which is north.
        theta, phi = y * math.pi, x * 2 * math.pi
        towards = [np.sin(phi) * np.sin(theta), np.cos(theta), -np.cos(phi) * np.sin(theta)]
        patch = sky.patch_of(np.stack(towards, axis=-1))
        pixels = np.where((patch >= 0)[..., None], radiance[patch], 0).astype(np.float32)
        described = {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": MOST_REFLECTIONS, "rr_depth": CERTAIN_REFLECTIONS},
            "sensor": {
                "type": "perspective",
                "fov": view.vfov_deg,
                "fov_axis": "y",
                "near_clip": 0.001,
                "to_world": mi.ScalarTransform4f().look_at(
                    origin=list(view.position), target=list(view.look_at), up=[0, 1, 0]
                ),
                "film": {"type": "hdrfilm", "width": size[0], "height": size[1], "rfilter": {"type": "box"}},
                "sampler": {"type": "independent", "sample_count": spp},
            },
            "sky": {"type": "envmap", "bitmap": mi.Bitmap(pixels)},
        }
        loaded = mi.load_dict(described | self.shapes)
        before = time.process_time()
        image = np.array(mi.render(loaded, spp=spp, seed=seed), np.float64)[:, :, :3]
        return image, time.process_time() - before


def walk(mi, dr, caster, colors, table, density, choice, radiance, grey, brought, ray, random):
    """Follows paths to their ends. Sums per lane: of each sky red, green and blue."""

    def patch_of(d):
        altitude = dr.asin(dr.clip(d.y, -1, 1))
        row = dr.clip(mi.Int32(dr.floor(altitude / sky.HEIGHT)), 0, len(sky.ROWS) - 1)
        # Of paths that have ended what is looked up is 0, by which nothing may be divided.
        count = dr.maximum(dr.gather(mi.UInt32, mi.UInt32(sky.ROWS), mi.UInt32(row)), 1)
        first = dr.gather(mi.UInt32, mi.UInt32(sky.firsts()), mi.UInt32(row))
        turns = dr.atan2(d.x, -d.z) / (2 * math.pi)
        place = mi.Int32(dr.floor(turns * mi.Float(count) + 0.5)) + mi.Int32(count)
        return first + mi.UInt32(place) % count, altitude >= 0

    def look(what, index, active=True):
        return dr.gather(mi.Float, what, index, active)

    def step(active, depth, share, reflected, ray, random, sums):
        hit = caster.ray_intersect(ray, active)
        met = active & hit.is_valid()

        # The sky, by the direction that the path has anyway.
        patch, above = patch_of(ray.d)
        found = active & ~met & above
        drawn = look(density, patch, found)
        weight = dr.select(reflected < 0, 1, reflected / (reflected + drawn))
        for i in range(len(sums)):
            light = look(radiance[i], patch, found)
            sums[i] = sums[i] + dr.select(found, share[i % 3] * weight * light, 0)

        color = mi.Color3f(*[look(c, hit.prim_index, met) for c in colors])
        normal = dr.select(dr.dot(hit.n, ray.d) > 0, -hit.n, hit.n)
        share = dr.select(met, share * color, share)

        # The sky, by a direction that is drawn.
        chosen = choice.sample(random.next_float32(), met)
        azimuth = look(table["azimuth"], chosen) + (random.next_float32() - 0.5) * look(table["wide"], chosen)
        low, high = look(table["low"], chosen), look(table["high"], chosen)
        sine = low + (high - low) * random.next_float32()
        level = dr.sqrt(dr.maximum(1 - sine * sine, 0))
        towards = mi.Vector3f(dr.sin(azimuth) * level, sine, -dr.cos(azimuth) * level)
        cosine = dr.dot(normal, towards)
        lit = met & (cosine > 0)
        lit = lit & ~caster.ray_test(hit.spawn_ray(towards), lit)
        drawn = look(density, chosen, lit)
        weight = cosine / math.pi / (drawn + cosine / math.pi)
        for i in range(len(sums)):
            light = look(radiance[i], chosen, lit)
            sums[i] = sums[i] + dr.select(lit, share[i % 3] * weight * light, 0)
        brings = dr.mean(share) * cosine / math.pi * look(grey, chosen, lit)
        dr.scatter_add(brought, dr.square(brings) / drawn * look(table["solid_angle"], chosen), chosen, lit)

        # On.
        depth = depth + 1
        going = dr.select(depth < CERTAIN_REFLECTIONS, 1, dr.minimum(dr.max(share), MOST_SURVIVING))
        active = met & (depth < MOST_REFLECTIONS) & (random.next_float32() < going)
        share = share / going
        frame = mi.Frame3f(normal)
        local = mi.warp.square_to_cosine_hemisphere(mi.Point2f(random.next_float32(), random.next_float32()))
        reflected = local.z / math.pi
        ray = dr.select(active, hit.spawn_ray(frame.to_world(local)), ray)
        return active, depth, share, reflected, ray, random, sums

    lanes = dr.width(ray.d)
    start = dr.full(mi.Bool, True, lanes), dr.zeros(mi.UInt32, lanes), dr.ones(mi.Color3f, lanes)
    start += dr.full(mi.Float, -1, lanes), ray, random, [dr.zeros(mi.Float, lanes) for _ in radiance]
    sums = dr.while_loop(start, lambda active, *_: active, step)[-1]
    dr.eval(sums, brought)
    return sums
