"""Lights and cameras as a lighting sequence says them; relight reads its JSON, and says what is wrong with it."""

import json
import os
from dataclasses import dataclass, fields
from typing import Any, Dict, Optional, Sequence, Tuple, Union

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Keys:
    """A value over time: pairs of frame and value. Frames rise; before the first and after the last key the nearest one's value holds."""

    keys: Sequence[Tuple[float, Any]]
    interpolation: str = "linear"
    """``"step"``, ``"linear"`` or ``"cubic"``."""


Number = Union[float, Keys]
Vector = Union[npt.ArrayLike, Keys]
"""Three numbers. A single one for a colour stands for all three channels."""

_COLOURS = ("intensity", "irradiance", "radiance")


def _plain(value: Any, colour: bool) -> Any:
    """A value as JSON has it."""
    if isinstance(value, Keys):
        keys = [[float(frame), _plain(at, colour)] for frame, at in value.keys]
        return {"keys": keys, "interpolation": value.interpolation}
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if value is None or isinstance(value, (str, dict)):
        return value
    numbers = np.asarray(value, dtype=float).tolist()
    return [numbers] * 3 if colour and isinstance(numbers, float) else numbers


@dataclass(frozen=True)
class Light:
    """What all lights have; its classes say which there are."""

    def to_dict(self) -> Dict[str, Any]:
        """The light as a lighting sequence has it; what is ``None`` is left out."""
        values = {f.name: _plain(getattr(self, f.name), f.name in _COLOURS) for f in fields(self)}
        return {"type": self._type, **{name: value for name, value in values.items() if value is not None}}

    _type = ""


@dataclass(frozen=True)
class Point(Light):
    """Shines the same in all directions: radiant intensity in W/sr."""

    position: Vector
    intensity: Vector = 1.0
    name: Optional[str] = None
    _type = "point"


@dataclass(frozen=True)
class Spot(Light):
    """A point light in a cone, with the fall-off of KHR_lights_punctual; half angles in degrees, intensity on the axis in W/sr."""

    position: Vector
    direction: Vector
    outer_angle_deg: Number
    inner_angle_deg: Number = 0.0
    intensity: Vector = 1.0
    name: Optional[str] = None
    _type = "spot"


@dataclass(frozen=True)
class Ies(Light):
    """A lamp that shines as it was measured: a photometric file (IES LM-63), or its text. A candela counts as a W/sr."""

    file: Union[str, "os.PathLike[str]"]
    position: Vector
    direction: Vector = (0.0, -1.0, 0.0)
    up: Vector = (0.0, 1.0, 0.0)
    scale: Union[Number, Vector] = 1.0
    name: Optional[str] = None
    _type = "ies"


@dataclass(frozen=True)
class Directional(Light):
    """Parallel light from infinitely far away, travelling in ``direction``: irradiance of a surface that faces it in W/m²."""

    direction: Vector
    irradiance: Vector = 1.0
    name: Optional[str] = None
    _type = "directional"


@dataclass(frozen=True)
class Rect(Light):
    """A parallelogram that emits towards ``edge_u × edge_v``: radiance in W/(m² sr). It casts no shadow."""

    center: Vector
    edge_u: Vector
    edge_v: Vector
    radiance: Vector = 1.0
    name: Optional[str] = None
    _type = "rect"


@dataclass(frozen=True)
class Sphere(Light):
    """A sphere that emits outwards: radiance in W/(m² sr). It casts no shadow."""

    center: Vector
    radius: Number
    radiance: Vector = 1.0
    name: Optional[str] = None
    _type = "sphere"


@dataclass(frozen=True)
class Environment(Light):
    """Light from all around: an equirectangular map (``.hdr`` or ``.exr``), turned about +Y in degrees."""

    file: Union[str, "os.PathLike[str]"]
    scale: Union[Number, Vector] = 1.0
    rotation_deg: Number = 0.0
    name: Optional[str] = None
    _type = "environment"


@dataclass(frozen=True)
class SunSky(Light):
    """Sun and clear sky (Preetham's model); ``sun_direction`` points towards the sun."""

    sun_direction: Vector
    turbidity: Number = 3.0
    scale: Union[Number, Vector] = 1.0
    name: Optional[str] = None
    _type = "sun_sky"


@dataclass(frozen=True)
class Weather(Light):
    """Sun and sky as the weather was: a weather file (``.epw`` or ``.wea``), and hours since the midnight before ``day`` ("MM-DD")."""

    file: Union[str, "os.PathLike[str]"]
    hours: Number
    day: Optional[str] = None
    scale: Union[Number, Vector] = 1.0
    rotation_deg: Number = 0.0
    name: Optional[str] = None
    _type = "weather"


@dataclass(frozen=True)
class Emissive(Light):
    """Lets emissive materials of the scene shine: those of a name, or all."""

    material: Optional[str] = None
    scale: Union[Number, Vector] = 1.0
    name: Optional[str] = None
    _type = "emissive"


@dataclass(frozen=True)
class Camera:
    """A pinhole camera; ``vfov_deg`` is the vertical field of view in degrees."""

    position: Vector
    look_at: Vector
    vfov_deg: Number = 45.0
    up: Vector = (0.0, 1.0, 0.0)

    def to_dict(self) -> Dict[str, Any]:
        """The camera as a lighting sequence has it."""
        return {f.name: _plain(getattr(self, f.name), False) for f in fields(self)}


def _named(lights: Sequence[Any]) -> Sequence[Dict[str, Any]]:
    """Lights as dicts; those without a name are called by their type and place."""
    plain = [light.to_dict() if isinstance(light, Light) else light for light in lights]
    for light in plain:
        if not isinstance(light, dict):
            raise TypeError(f"lights has {light!r}, but takes lights such as relight.Point, or dicts of a lighting sequence")
    return [{"name": f"{light.get('type', 'light')}_{i}", **light} for i, light in enumerate(plain)]


def _text(sequence: Dict[str, Any]) -> str:
    """JSON; numbers of numpy become numbers."""
    return json.dumps(sequence, default=lambda value: np.asarray(value).tolist())


def of_lights(given: Any) -> Tuple[Optional[str], str]:
    """The file of a sequence, or else its text, in which files are relative to the working directory."""
    if isinstance(given, os.PathLike) or (isinstance(given, str) and not given.lstrip().startswith("{")):
        return os.fspath(given), ""
    if isinstance(given, str):
        return None, given
    if isinstance(given, dict):
        return None, _text(given)
    return None, _text({"relight_sequence": 1, "lights": _named([given] if isinstance(given, Light) else list(given))})


def of_materials(given: Any) -> Tuple[Optional[str], str]:
    """The file of material edits, or else their text; a list of edits stands for a file of them."""
    if isinstance(given, (list, tuple)):
        return None, _text({"relight_materials": 1, "edits": list(given)})
    if not isinstance(given, (str, os.PathLike, dict)):
        raise TypeError(f"materials is {given!r}, but must be material edits: their file, text or dict, or a list of edits")
    return of_lights(given)


def of_camera(given: Any) -> Tuple[Optional[str], str]:
    """As `of_lights`, of a sequence without lights that has the camera."""
    camera = given.to_dict() if isinstance(given, Camera) else given
    if not isinstance(camera, dict):
        raise TypeError(f"camera is {given!r}, but must be a camera's name, a relight.Camera, or a dict of a lighting sequence")
    return None, _text({"relight_sequence": 1, "camera": camera, "lights": []})
