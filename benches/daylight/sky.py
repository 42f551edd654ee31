"""The sky's 145 patches, and their radiance over a day as relight's weather light has them.

Patches are Tregenza's (1987), in the order of Radiance's gendaymtx without its ground: from the horizon up, in each row from north by
east, the zenith last.
"""

import math

import numpy as np

ROWS = (30, 30, 24, 24, 18, 12, 6, 1)
HEIGHT = math.pi / 2 / 7.5
COUNT = sum(ROWS)


def firsts():
    """Number of each row's first patch."""
    return np.concatenate([[0], np.cumsum(ROWS)[:-1]])


def patches():
    """Of each patch its middle's azimuth, clockwise from north, how wide it is, the sines of the altitudes at which it begins and ends,
    and its solid angle."""
    rows = np.repeat(np.arange(len(ROWS)), ROWS)
    wide = 2 * math.pi / np.array(ROWS)[rows]
    low, high = np.sin(HEIGHT * rows), np.sin(np.minimum(HEIGHT * (rows + 1), math.pi / 2))
    azimuth = (np.arange(COUNT) - firsts()[rows]) * wide
    return {"azimuth": azimuth, "wide": wide, "low": low, "high": high, "solid_angle": wide * (high - low)}


def middles():
    """Unit vectors towards the patches' middles: x east, y up, z south."""
    rows = np.repeat(np.arange(len(ROWS)), ROWS)
    altitude = np.where(rows == len(ROWS) - 1, math.pi / 2, HEIGHT * (rows + 0.5))
    azimuth, level = patches()["azimuth"], np.cos(altitude)
    return np.stack([np.sin(azimuth) * level, np.sin(altitude), -np.cos(azimuth) * level], axis=-1)


def patch_of(directions):
    """The patch that each of some unit vectors shows, -1 below the horizon."""
    altitude = np.arcsin(np.clip(directions[..., 1], -1, 1))
    row = np.clip((altitude / HEIGHT).astype(int), 0, len(ROWS) - 1)
    count, first = np.array(ROWS)[row], firsts()[row]
    azimuth = np.arctan2(directions[..., 0], -directions[..., 2]) / (2 * math.pi)
    return np.where(altitude < 0, -1, first + np.floor(azimuth * count + 0.5).astype(int) % count)


def seen(images, views, size):
    """Radiance of the patches, [frame, patch, RGB], from pictures of a bare sky: per view the frames [frame, height, width, RGB]."""
    towards = middles()
    radiance = np.full((len(images[0]), COUNT, 3), np.nan)
    nearest = np.full(COUNT, -1.0)
    width, height = size
    for frames, view in zip(images, views):
        right, up, back = view.axes()
        scale = math.tan(math.radians(view.vfov_deg) / 2)
        y, x = np.mgrid[0:height, 0:width]
        across = ((x + 0.5) / width * 2 - 1) * scale * width / height
        along = (1 - (y + 0.5) / height * 2) * scale
        pixels = across[..., None] * right + along[..., None] * up - back
        pixels /= np.linalg.norm(pixels, axis=-1, keepdims=True)
        pixels = pixels.reshape(-1, 3)
        for patch, middle in enumerate(towards):
            cosines = pixels @ middle
            best = int(cosines.argmax())
            if cosines[best] > nearest[patch]:
                nearest[patch] = cosines[best]
                radiance[:, patch] = frames.reshape(len(frames), -1, 3)[:, best]
    assert nearest.min() > math.cos(math.radians(2)), "a patch is in no picture"
    return radiance


# The nearest place to nowhere: overcast until noon, then the sun comes through; it shines from four patches, as in gendaymtx.
DAY = "03-21"
HOURS = (7.0, 17.0)
FRAMES = 48
# Hour, direct normal and diffuse horizontal irradiance, W/m².
WEATHER = [
    (6.5, 0, 20),
    (7.5, 0, 60),
    (8.5, 0, 110),
    (9.5, 0, 150),
    (10.5, 0, 180),
    (11.5, 0, 200),
    (12.5, 0, 210),
    (13.5, 420, 190),
    (14.5, 640, 150),
    (15.5, 560, 120),
    (16.5, 380, 90),
    (17.5, 120, 50),
]
# Frames that are held against truth, and what shines in them.
TRUE = {7: "overcast", 21: "overcast", 35: "sun", 43: "sun"}


def sequence(repeated=1):
    """The day as a lighting sequence; `repeated`: so many days one after the other, for the time of a frame."""
    lines = [f"3 21 {hour} {direct} {diffuse}" for hour, direct, diffuse in WEATHER]
    place = "place Nowhere\nlatitude 47.4\nlongitude -8.5\ntime_zone -15\nsite_elevation 400\nweather_data_file_units 1\n"
    keys = []
    for day in range(repeated):
        keys += [[day * FRAMES, HOURS[0]], [(day + 1) * FRAMES - 1, HOURS[1]]]
    light = {"name": "day", "type": "weather", "day": DAY, "scale": 0.02, "file": place + "\n".join(lines)}
    light["hours"] = {"keys": keys, "interpolation": "linear"}
    return {"relight_sequence": 1, "frames": FRAMES * repeated, "lights": [light]}
