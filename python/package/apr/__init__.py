"""Adaptive Polynomial Rendering: a denoiser for Monte Carlo renders.

>>> import apr
>>> result = apr.denoise(color, variance=variance, albedo=albedo, normal=normal, depth=depth)
>>> result["color"], result["mse"]

All arrays are height × width × channels, linear, top row first. 32-bit floats are read where they lie;
other real numbers are converted. Nothing is changed in place, and other Python threads run meanwhile.
"""

from __future__ import annotations

import os
from typing import Any, Callable, Mapping, Sequence, TypedDict, Union

import numpy as np
from numpy.typing import NDArray

from . import _apr
from ._apr import LayoutWarning, __version__, denoise, write_exr

__all__ = [
    "LayoutWarning",
    "Result",
    "__version__",
    "denoise",
    "denoise_exr",
    "inspect_exr",
    "read_exr",
    "write_exr",
]

Path = Union[str, "os.PathLike[str]"]


class Result(TypedDict):
    """What :func:`denoise` returns."""

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


def _reading(
    profile: str | None,
    map: Mapping[str, str] | None,
    features: Mapping[str, str] | None,
    variance_kind: str | None,
    spp: float | None,
    half: Path | None,
    further: Sequence[Path] | None,
    aovs: Sequence[str] | None,
    motion: bool = False,
) -> dict[str, Any]:
    if isinstance(aovs, str) or isinstance(further, (str, os.PathLike)):
        raise TypeError("aovs and further are sequences of names, not one name")
    return {
        "profile": profile,
        "map": list((map or {}).items()),
        "features": list((features or {}).items()),
        "variance_kind": variance_kind,
        "spp": spp,
        "half": half,
        "further": list(further or ()),
        "aovs": list(aovs or ()),
        "motion": motion,
    }


def read_exr(
    path: Path,
    *,
    profile: str | None = None,
    map: Mapping[str, str] | None = None,
    features: Mapping[str, str] | None = None,
    variance_kind: str | None = None,
    spp: float | None = None,
    half: Path | None = None,
    further: Sequence[Path] | None = None,
    aovs: Sequence[str] | None = None,
    motion: bool = False,
) -> dict[str, Any]:
    """Reads a render of any renderer into the keywords of :func:`denoise`.

    ``apr.denoise(**apr.read_exr(path))`` gives the command line's bits. The keywords are those of the
    command line: ``profile`` the renderer's name, ``map`` and ``features`` dictionaries of role or name to
    channels (``{"albedo": "diffuse"}``), ``half`` a render of the same frame with another seed, ``further``
    files with more layers, ``aovs`` components of the beauty to denoise with it (``["auto"]``). ``motion``
    asks for motion vectors, of which only frames of a sequence (``before``, ``after``) have a use.

    ``apr.write_exr(path, **keywords)`` writes them again. What makes the result worse than it could be is warned of as
    :class:`LayoutWarning`. Raises FileNotFoundError and OSError for files, ValueError where something is lacking or makes
    no sense.
    """
    reading = _reading(profile, map, features, variance_kind, spp, half, further, aovs, motion)
    return _apr.read_exr(path, reading)


def inspect_exr(
    path: Path,
    *,
    profile: str | None = None,
    map: Mapping[str, str] | None = None,
    features: Mapping[str, str] | None = None,
    variance_kind: str | None = None,
    spp: float | None = None,
    half: Path | None = None,
    further: Sequence[Path] | None = None,
    aovs: Sequence[str] | None = None,
) -> dict[str, Any]:
    """What was found in a file: files, parts, roles, sums, notes, warnings. Keywords as in :func:`read_exr`."""
    reading = _reading(profile, map, features, variance_kind, spp, half, further, aovs)
    return _apr.inspect_exr(path, reading)


def denoise_exr(
    input: Path,
    output: Path,
    *,
    profile: str | None = None,
    map: Mapping[str, str] | None = None,
    features: Mapping[str, str] | None = None,
    variance_kind: str | None = None,
    spp: float | None = None,
    half: Path | None = None,
    further: Sequence[Path] | None = None,
    aovs: Sequence[str] | None = None,
    preset: str = "balanced",
    options: Mapping[str, Any] | None = None,
    aux: bool = False,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> dict[str, Any]:
    """Denoises a file as the command line does: only the beauty (and ``aovs``) change, bit for bit.

    ``output`` ends in .exr and may be ``input``, but no other file that is read; it appears whole or not at all. With
    ``aux`` the layers ``apr.mse`` and ``apr.order`` are added. ``progress`` is called with the share of the denoising that
    is done, 0 to 1; what it raises stops the run, as Ctrl-C does, and is raised again. Returns layout, summary, sums and
    notes.
    """
    reading = _reading(profile, map, features, variance_kind, spp, half, further, aovs)
    return _apr.denoise_exr(input, output, reading, preset, options, aux, threads, progress)
