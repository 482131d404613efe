#!/usr/bin/env python3
"""Denoise renders with Intel Open Image Denoise, for `apr-compare sweep --rivals`.

  rivals_oidn.py FOLDER RENDER.exr …

writes one EXR for each render and mode into FOLDER, and FOLDER/rivals.json. Modes: colour alone;
with noisy albedo and normal; with both prefiltered and taken as clean. Renders need this project's
channel names. Seconds are the filters' own, without reading and writing: the best of three runs by the
clock; of processor time what two further runs add to the program's.
"""

import json
import os
import pathlib
import re
import resource
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


class Seconds:
    """Of the filters run so far, by the clock and of processor time."""

    def __init__(self):
        self.clock, self.processor = 0.0, 0.0

    def run(self, *arguments):
        """Runs the program once with one run of its filter, once with three."""
        environment = dict(os.environ, LD_LIBRARY_PATH=str(ROOT / "lib"))
        spent = []
        for runs in (1, 3):
            command = [PROGRAM, "-d", "cpu", "-n", str(runs), *map(str, arguments)]
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        self.clock += min(float(ms) for ms in re.findall(r"^\s*msec=([0-9.]+)", done.stdout, re.M)) / 1e3
        self.processor += max(0.0, (spent[1] - spent[0]) / 2)


def modes(render, scratch):
    """Yields (name, picture, seconds)."""
    color, albedo, normal, out = (scratch / f"{name}.pfm" for name in ("color", "albedo", "normal", "out"))
    clean_albedo, clean_normal = scratch / "clean_albedo.pfm", scratch / "clean_normal.pfm"
    write_pfm(color, read(render, ["R", "G", "B"]).clip(0, None))
    write_pfm(albedo, read(render, ["albedo.R", "albedo.G", "albedo.B"]).clip(0, 1))
    write_pfm(normal, read(render, ["normal.X", "normal.Y", "normal.Z"]).clip(-1, 1))
    features = ["--alb", albedo, "--nrm", normal]
    clean_features = ["--alb", clean_albedo, "--nrm", clean_normal, "--clean_aux"]
    for name, filters in (
        ("colour", [["--hdr", color, "-o", out]]),
        ("features", [["--hdr", color, *features, "-o", out]]),
        (
            "prefiltered",
            [
                ["--alb", albedo, "-o", clean_albedo],
                ["--nrm", normal, "-o", clean_normal],
                ["--hdr", color, *clean_features, "-o", out],
            ],
        ),
    ):
        seconds = Seconds()
        for arguments in filters:
            seconds.run(*arguments)
        yield f"OIDN {name}", read_pfm(out), seconds


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
                times = {"seconds": seconds.clock, "processor_seconds": seconds.processor}
                rivals.append({"name": name, "input": render, "picture": file, **times})
    (folder / "rivals.json").write_text(json.dumps(rivals, indent=1))


main()
