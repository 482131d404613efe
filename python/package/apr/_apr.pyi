"""Types of the compiled part; what the functions do, `help` of each tells."""

import os
from typing import Any, Callable, Mapping, Sequence

from numpy.typing import ArrayLike

from . import Result

__version__: str

class LayoutWarning(UserWarning): ...

def denoise(
    color: ArrayLike,
    *,
    variance: ArrayLike | None = None,
    halves: Sequence[ArrayLike] | ArrayLike | None = None,
    albedo: ArrayLike | None = None,
    normal: ArrayLike | None = None,
    position: ArrayLike | None = None,
    depth: ArrayLike | None = None,
    visibility: ArrayLike | None = None,
    features: Mapping[str, ArrayLike] | None = None,
    feature_variance: Mapping[str, ArrayLike] | None = None,
    feature_halves: Mapping[str, Sequence[ArrayLike] | ArrayLike] | None = None,
    aovs: Mapping[str, ArrayLike] | None = None,
    motion_previous: ArrayLike | None = None,
    motion_next: ArrayLike | None = None,
    spp: float | None = None,
    before: Sequence[Mapping[str, Any]] | None = None,
    after: Sequence[Mapping[str, Any]] | None = None,
    preset: str = "balanced",
    options: Mapping[str, Any] | None = None,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> Result: ...

def read_exr(path: str | os.PathLike[str], reading: Mapping[str, Any]) -> dict[str, Any]: ...
def inspect_exr(path: str | os.PathLike[str], reading: Mapping[str, Any]) -> dict[str, Any]: ...
def write_exr(
    path: str | os.PathLike[str],
    color: ArrayLike,
    *,
    variance: ArrayLike | None = None,
    halves: Sequence[ArrayLike] | ArrayLike | None = None,
    albedo: ArrayLike | None = None,
    normal: ArrayLike | None = None,
    position: ArrayLike | None = None,
    depth: ArrayLike | None = None,
    visibility: ArrayLike | None = None,
    features: Mapping[str, ArrayLike] | None = None,
    feature_variance: Mapping[str, ArrayLike] | None = None,
    feature_halves: Mapping[str, Sequence[ArrayLike] | ArrayLike] | None = None,
    aovs: Mapping[str, ArrayLike] | None = None,
    motion_previous: ArrayLike | None = None,
    motion_next: ArrayLike | None = None,
    layers: Mapping[str, ArrayLike] | None = None,
    spp: float | None = None,
    seed: int | None = None,
) -> None: ...

def denoise_exr(
    input: str | os.PathLike[str],
    output: str | os.PathLike[str],
    reading: Mapping[str, Any],
    preset: str,
    options: Mapping[str, Any] | None,
    aux: bool,
    threads: int | None,
    progress: Callable[[float], object] | None,
) -> dict[str, Any]: ...
