"""Bake how light travels through a scene, then relight it in milliseconds: numpy arrays in and out.

>>> import relight
>>> asset = relight.bake("hall.glb", "hall.relight", preset="draft")      # or relight.open("hall.relight")
>>> shot = asset.shot(size=(640, 360))
>>> image = shot.frame(lights=[relight.Point(position=(0, 2, 0), intensity=40)])["beauty"]

Radiance is in W/(m² sr), linear RGB (Rec. 709 primaries); lengths are in metres, +Y is up.
"""

from ._csr import CSR
from ._relight import Asset, Error, Lights, Points, Shot, Warning, __version__, bake, open, read_exr, write_exr
from ._sequence import (
    Camera,
    Directional,
    Emissive,
    Environment,
    Ies,
    Keys,
    Light,
    Point,
    Rect,
    Sphere,
    Spot,
    SunSky,
    Weather,
)

__all__ = [
    "CSR",
    "Asset",
    "Camera",
    "Directional",
    "Emissive",
    "Environment",
    "Error",
    "Ies",
    "Keys",
    "Light",
    "Lights",
    "Point",
    "Points",
    "Rect",
    "Shot",
    "Sphere",
    "Spot",
    "SunSky",
    "Warning",
    "Weather",
    "__version__",
    "bake",
    "open",
    "read_exr",
    "write_exr",
]
