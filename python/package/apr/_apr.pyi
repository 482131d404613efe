"""Types of the compiled part; what the functions do, `help` of each tells."""

import os
from typing import Any, Mapping, Sequence, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

class Result(TypedDict):
    color: NDArray[np.float32]
    """The denoised colour, height × width × 3."""
    aovs: dict[str, NDArray[np.float32]]
    """The components through the same operator."""
    mse: NDArray[np.float32]
    """Estimated mean squared error of ``color`` over its channels, height × width, never negative."""
    order: NDArray[np.float32]
    """Polynomial order chosen, averaged over the fits that cover the pixel, 0 to 3."""
    summary: dict[str, Any]
    """Counts of repaired pixels, outliers, fits; notes."""

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
    spp: float | None = None,
    preset: str = "balanced",
    options: Mapping[str, Any] | None = None,
    threads: int | None = None,
) -> Result: ...

def read_exr(path: str | os.PathLike[str], reading: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]: ...
def write_exr(
    path: str | os.PathLike[str],
    color: ArrayLike,
    *,
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
) -> dict[str, Any]: ...
