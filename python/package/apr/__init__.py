"""Adaptive Polynomial Rendering: a denoiser for Monte Carlo renders.

>>> import apr
>>> result = apr.denoise(color, variance=variance, albedo=albedo, normal=normal, depth=depth)
>>> result["color"], result["mse"]

All arrays are height × width × channels, linear, top row first. 32-bit floats are read where they lie;
other real numbers are converted. Nothing is changed in place, and other Python threads run meanwhile.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Mapping, Sequence


from . import _apr
from ._apr import __version__, denoise, write_exr

__all__ = ["__version__", "denoise", "denoise_exr", "inspect_exr", "read_exr", "write_exr"]

if TYPE_CHECKING:
    Path = str | os.PathLike[str]



def _reading(
    profile: str | None,
    map: Mapping[str, str],
    features: Mapping[str, str],
    variance_kind: str | None,
    spp: float | None,
    half: Path | None,
    further: Sequence[Path],
    aovs: Sequence[str],
) -> dict[str, Any]:
    if isinstance(aovs, str) or isinstance(further, (str, os.PathLike)):
        raise TypeError("aovs and further are sequences of names, not one name")
    return {
        "profile": profile,
        "map": list(map.items()),
        "features": list(features.items()),
        "variance_kind": variance_kind,
        "spp": spp,
        "half": half,
        "further": list(further),
        "aovs": list(aovs),
    }


def read_exr(
    path: Path,
    *,
    profile: str | None = None,
    map: Mapping[str, str] = {},
    features: Mapping[str, str] = {},
    variance_kind: str | None = None,
    spp: float | None = None,
    half: Path | None = None,
    further: Sequence[Path] = (),
    aovs: Sequence[str] = (),
) -> dict[str, Any]:
    """Reads a render of any renderer into the keywords of :func:`denoise`.

    ``apr.denoise(**apr.read_exr(path))`` gives the command line's bits. The keywords are those of the
    command line: ``profile`` the renderer's name, ``map`` and ``features`` dictionaries of role or name to
    channels (``{"albedo": "diffuse"}``), ``half`` a render of the same frame with another seed, ``further``
    files with more layers, ``aovs`` components of the beauty to denoise with it (``["auto"]``).

    Raises FileNotFoundError and OSError for files, ValueError where something is lacking or makes no sense.
    """
    reading = _reading(profile, map, features, variance_kind, spp, half, further, aovs)
    return _apr.read_exr(path, reading)[0]


def inspect_exr(
    path: Path,
    *,
    profile: str | None = None,
    map: Mapping[str, str] = {},
    features: Mapping[str, str] = {},
    variance_kind: str | None = None,
    spp: float | None = None,
    half: Path | None = None,
    further: Sequence[Path] = (),
    aovs: Sequence[str] = (),
) -> dict[str, Any]:
    """What was found in a file: files, parts, roles, sums, notes, warnings. Keywords as in :func:`read_exr`."""
    reading = _reading(profile, map, features, variance_kind, spp, half, further, aovs)
    return _apr.read_exr(path, reading)[1]


def denoise_exr(
    input: Path,
    output: Path,
    *,
    profile: str | None = None,
    map: Mapping[str, str] = {},
    features: Mapping[str, str] = {},
    variance_kind: str | None = None,
    spp: float | None = None,
    half: Path | None = None,
    further: Sequence[Path] = (),
    aovs: Sequence[str] = (),
    preset: str = "balanced",
    options: Mapping[str, Any] = {},
    aux: bool = False,
    threads: int | None = None,
) -> dict[str, Any]:
    """Denoises a file as the command line does: only the beauty (and ``aovs``) change, bit for bit.

    ``output`` ends in .exr and may be ``input``, but no other file that is read; it appears whole or not at all. With ``aux`` the layers ``apr.mse`` and
    ``apr.order`` are added. Returns layout, summary, sums and notes.
    """
    reading = _reading(profile, map, features, variance_kind, spp, half, further, aovs)
    return _apr.denoise_exr(input, output, reading, preset, dict(options), aux, threads)
