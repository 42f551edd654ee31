import os
import pathlib
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, Union, final

import numpy as np
import numpy.typing as npt

from ._csr import CSR
from ._sequence import Camera, Light

__all__ = ["Asset", "Error", "Lights", "Points", "Shot", "Warning", "__version__", "bake", "open", "read_exr", "write_exr"]

__version__: str

_Path = Union[str, "os.PathLike[str]"]
_Lights = Union[Lights, _Path, Dict[str, Any], Light, Sequence[Union[Light, Dict[str, Any]]]]
_Image = npt.NDArray[np.float32]

class Error(Exception): ...
class Warning(UserWarning): ...

def open(path: _Path) -> Asset: ...
def bake(
    scene: _Path,
    out: _Path,
    *,
    preset: str = "standard",
    lights: Optional[_Lights] = None,
    levels: Optional[int] = None,
    sender_levels: Optional[int] = None,
    coarse_radius: Optional[float] = None,
    epsilon: Optional[float] = None,
    rays: Optional[int] = None,
    bounces: Optional[int] = None,
    solution: bool = False,
    cuts: Optional[str] = None,
    viewpoints: Sequence[Sequence[float]] = ...,
    cameras_only: bool = False,
    keep: Sequence[str] = ...,
    lambert: bool = False,
    variant: Optional[str] = None,
    seed: int = 0,
    progress: Optional[Callable[[str, int, Optional[int]], object]] = None,
) -> Asset: ...
def read_exr(path: _Path) -> Dict[str, _Image]: ...
def write_exr(path: _Path, layers: Union[npt.ArrayLike, Dict[str, npt.ArrayLike]], *, float: bool = True) -> None: ...

@final
class Asset:
    @property
    def path(self) -> pathlib.Path: ...
    @property
    def cameras(self) -> List[str]: ...
    @property
    def materials(self) -> List[str]: ...
    @property
    def points(self) -> Points: ...
    @property
    def links(self) -> Dict[str, CSR]: ...
    @property
    def senders(self) -> Dict[str, Any]: ...
    @property
    def expected(self) -> Optional[Dict[str, Any]]: ...
    def statistics(self) -> Dict[str, Any]: ...
    def lights(self, lights: Optional[_Lights] = None) -> Lights: ...
    def shot(
        self,
        camera: Union[None, str, Camera, Dict[str, Any]] = None,
        size: Tuple[int, int] = (640, 360),
        *,
        time: float = 0.0,
        spp: Optional[int] = None,
        integrator: str = "auto",
        vpls: int = 0,
    ) -> Shot: ...
    def edited(self, materials: Union[_Path, Dict[str, Any], Sequence[Dict[str, Any]]], time: float = 0.0) -> Asset: ...

@final
class Points:
    @property
    def positions(self) -> npt.NDArray[Any]: ...
    @property
    def normals(self) -> npt.NDArray[np.float32]: ...
    @property
    def albedo(self) -> npt.NDArray[np.float32]: ...
    @property
    def level(self) -> npt.NDArray[np.uint8]: ...
    @property
    def widening(self) -> npt.NDArray[np.uint8]: ...
    @property
    def disk_radius(self) -> npt.NDArray[np.float32]: ...
    @property
    def support_radius(self) -> npt.NDArray[np.float32]: ...
    def __len__(self) -> int: ...

@final
class Lights:
    @property
    def names(self) -> List[str]: ...
    @property
    def frames(self) -> int: ...
    @property
    def fps(self) -> float: ...
    def __len__(self) -> int: ...

@final
class Shot:
    @property
    def size(self) -> Tuple[int, int]: ...
    def frame(
        self,
        lights: Optional[_Lights] = None,
        time: float = 0.0,
        *,
        light_layers: bool = False,
        surface_layers: bool = False,
        seed: int = 0,
    ) -> Dict[str, _Image]: ...
    def basis(self, lights: Optional[_Lights] = None, time: float = 0.0, *, seed: int = 0) -> _Image: ...
