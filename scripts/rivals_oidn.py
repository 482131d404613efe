#!/usr/bin/env python3
"""Denoise renders with Intel Open Image Denoise, for `apr-compare sweep --rivals`.

  rivals_oidn.py FOLDER RENDER.exr …

writes one EXR for each render and mode into FOLDER, and FOLDER/rivals.json. Modes: colour alone;
with noisy albedo and normal; with both prefiltered and taken as clean. Renders need this project's
channel names. Seconds are the filters' own, without reading and writing, the best of three runs.
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np
import OpenEXR
import pyoidn

ROOT = pathlib.Path(pyoidn.__file__).parent / "oidn"
PROGRAM = ROOT / "bin" / "oidnDenoise"


def read(path, names):
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return np.stack([np.asarray(channels[name].pixels, np.float32) for name in names], -1)


def write_pfm(path, picture):
    height, width, _ = picture.shape
    path.write_bytes(b"PF\n%d %d\n-1.0\n" % (width, height) + np.ascontiguousarray(picture[::-1], "<f4").tobytes())


def read_pfm(path):
    _, size, _, data = path.read_bytes().split(b"\n", 3)
    width, height = map(int, size.split())
    return np.frombuffer(data, "<f4").reshape(height, width, 3)[::-1]


def filter_seconds(*arguments):
    """Runs the program and tells the seconds of its filter."""
    environment = dict(os.environ, LD_LIBRARY_PATH=str(ROOT / "lib"))
    command = [PROGRAM, "-d", "cpu", "-n", "3", *map(str, arguments)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return min(float(ms) for ms in re.findall(r"^\s*msec=([0-9.]+)", done.stdout, re.M)) / 1e3


def modes(render, scratch):
    """Yields (name, picture, seconds)."""
    color, albedo, normal, out = (scratch / f"{name}.pfm" for name in ("color", "albedo", "normal", "out"))
    clean_albedo, clean_normal = scratch / "clean_albedo.pfm", scratch / "clean_normal.pfm"
    write_pfm(color, read(render, ["R", "G", "B"]).clip(0, None))
    write_pfm(albedo, read(render, ["albedo.R", "albedo.G", "albedo.B"]).clip(0, 1))
    write_pfm(normal, read(render, ["normal.X", "normal.Y", "normal.Z"]).clip(-1, 1))
    seconds = filter_seconds("--hdr", color, "-o", out)
    yield "OIDN colour", read_pfm(out), seconds
    seconds = filter_seconds("--hdr", color, "--alb", albedo, "--nrm", normal, "-o", out)
    yield "OIDN features", read_pfm(out), seconds
    seconds = filter_seconds("--alb", albedo, "-o", clean_albedo) + filter_seconds("--nrm", normal, "-o", clean_normal)
    features = ["--alb", clean_albedo, "--nrm", clean_normal, "--clean_aux"]
    seconds += filter_seconds("--hdr", color, *features, "-o", out)
    yield "OIDN prefiltered", read_pfm(out), seconds


def main():
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    PROGRAM.chmod(0o755)  # the wheel forgets it
    rivals = []
    for i, render in enumerate(sys.argv[2:]):
        with tempfile.TemporaryDirectory() as scratch:
            for j, (name, picture, seconds) in enumerate(modes(render, pathlib.Path(scratch))):
                file = f"{i}_{j}.exr"
                channels = {c: np.ascontiguousarray(picture[..., k]) for k, c in enumerate("RGB")}
                OpenEXR.File({}, channels).write(str(folder / file))
                rivals.append({"name": name, "input": render, "picture": file, "seconds": seconds})
    (folder / "rivals.json").write_text(json.dumps(rivals, indent=1))


main()
