import os
from typing import Any, Mapping, TypedDict

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
    halves: tuple[ArrayLike, ArrayLike] | None = None,
    albedo: ArrayLike | None = None,
    normal: ArrayLike | None = None,
    position: ArrayLike | None = None,
    depth: ArrayLike | None = None,
    visibility: ArrayLike | None = None,
    features: Mapping[str, ArrayLike] | None = None,
    feature_variance: Mapping[str, ArrayLike] | None = None,
    feature_halves: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None,
    aovs: Mapping[str, ArrayLike] | None = None,
    spp: float | None = None,
    preset: str = "balanced",
    options: Mapping[str, Any] | None = None,
    threads: int | None = None,
) -> Result:
    """Denoises arrays.

    color: height × width × 3, linear radiance of any scale; NaN and infinities are repaired and counted.
    variance: of the colour's *mean* (the expected squared error of the stored pixel), height × width × 3.
    halves: the means of two independent halves of the samples; their average is ``color``. Without either
        the noise is estimated from the picture, which is the weakest of all sources.
    albedo, normal, position, depth, visibility: what the pixel sees, height × width (× channels).
    features: further ones by name; ``albedo2``, ``normal2``, … are taken for what their name says.
    feature_variance, feature_halves: statistics of features, by the features' names.
    aovs: components of the beauty, height × width × 3, that go through its operator: what sums to ``color``
        sums to the result.
    preset: fast, balanced, best or published; options: any option by name, dots go into depth.
    threads: one per core by default; the result does not depend on it.

    Raises ValueError for shapes that do not fit and options that make no sense, TypeError for what is no
    array of real numbers.
    """

def read_exr(path: str | os.PathLike[str], reading: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]: ...
def write_exr(
    path: str | os.PathLike[str],
    color: ArrayLike,
    *,
    layers: Mapping[str, ArrayLike] | None = None,
    spp: float | None = None,
    seed: int | None = None,
) -> None:
    """Writes ``color`` as R,G,B and every layer (1 or 3 channels) under its name, 32-bit floats, ZIP.

    The file appears whole or not at all. Raises OSError where it cannot be written.
    """

def denoise_exr(
    input: str | os.PathLike[str],
    output: str | os.PathLike[str],
    reading: Mapping[str, Any],
    preset: str,
    options: Mapping[str, Any] | None,
    aux: bool,
    threads: int | None,
) -> dict[str, Any]: ...
