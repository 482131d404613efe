#!/usr/bin/env python3
"""What neighbouring frames bring: error and flicker on two animations of the tracer, with references.

  python3 scripts/temporal.py [--spp 16] [--reference 512] [--frames 8] [--size 160x120]

Prints the tables of docs/TEMPORAL.md. Needs numpy and OpenEXR for Python. Renders go to a folder of
these options in target/temporal and are kept between runs; remove it to render anew.

Errors are those of the denoised frames against the references, squared and divided by the reference's squared
brightness plus 0.01; the references' own noise, known from their variances, is taken off everywhere.
- error: mean over the frames and pixels.
- flicker: variance of the error over the frames at pixels that nothing moves over.
- warped: squared difference between a pixel's error and that of the pixel which shows the same in the next
  frame, where motion vectors lead there and back.
"""

import argparse
import json
import pathlib
import shutil
import subprocess

import numpy
import OpenEXR

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCENES = ROOT / "fixtures" / "scenes"
WORK = ROOT / "target" / "temporal"
EPSILON = 0.01
MOVES = 0.25  # pixels a frame
CHANGES = 0.05  # of the light, relative, from frame to frame, on what does not move


def walk(scene):
    """A camera that walks through the textured room, whose ball is of rough copper."""
    scene["camera"]["end"] = {"origin": [-0.6, 1.6, 3.3], "target": [0.35, 1.1, -1]}
    scene["materials"]["metal"] = {"type": "conductor", "metal": "copper", "roughness": 0.15}
    for shape in scene["shapes"]:
        if shape["type"] == "sphere":
            shape["material"] = "metal"


def ball(scene):
    """A still camera; a ball and a cube move, and their shadows with them."""
    for shape in scene["shapes"]:
        if shape["type"] == "sphere":
            shape["motion"] = [{"translate": [-0.4, 1.3, 0.9]}]
        if shape["type"] == "cube":
            shape["motion"] = [{"scale": 0.35}, {"rotate": {"axis": [0, 1, 0.3], "angle": 40}}, {"translate": [1.3, 0.9, 0.5]}]


ANIMATIONS = {"walk": ("textured_room", walk), "ball": ("motion_blur", ball)}


def program(name, *arguments):
    subprocess.run([ROOT / "target" / "release" / name, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


def read(path):
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return {name: channel.pixels.astype(numpy.float64) for name, channel in channels.items()}


def rgb(file, layer=""):
    return numpy.stack([file[layer + c] for c in "RGB"])


def render(name, options):
    """Renders all frames and references; the folder."""
    base, change = ANIMATIONS[name]
    # Renders of other options are other renders.
    folder = WORK / f"{options.size}-{options.spp}-{options.reference}-{options.frames}" / name
    if not folder.exists():
        shutil.copytree(SCENES, folder)
    scene = json.loads((SCENES / f"{base}.json").read_text())
    scene["camera"]["resolution"] = [int(side) for side in options.size.split("x")]
    change(scene)
    path = folder / "animation.json"
    path.write_text(json.dumps(scene))
    for frame in range(1, options.frames + 1):
        for kind, spp, seed in (("ref", options.reference, 1), ("noisy", options.spp, 2)):
            out = folder / f"{kind}.{frame:04}.exr"
            if not out.exists():
                program("apr-trace", path, out, "--spp", spp, "--seed", seed, "--frame", f"{frame}/{options.frames}", "--quiet")
    return folder


def denoise(folder, label, *arguments):
    for old in folder.glob(f"den.{label}.*.exr"):
        old.unlink()
    program("apr-denoise", folder / "noisy.####.exr", folder / f"den.{label}.####.exr", "--quiet", *arguments)


class Truth:
    """The references of an animation, and where in it what happens."""

    def __init__(self, folder, count):
        files = [read(folder / f"ref.{frame:04}.exr") for frame in range(1, count + 1)]
        self.color = numpy.stack([rgb(file) for file in files])
        self.scale = 1 / (self.color.mean(axis=1) ** 2 + EPSILON)
        self.noise = numpy.stack([rgb(file, "variance.") for file in files]).mean(axis=1) * self.scale
        ways = [[file[f"motion{to}.{axis}"] for axis in "XY"] for file in files for to in ("Previous", "Next")]
        self.ways = numpy.array(ways).reshape(count, 2, 2, *self.scale.shape[1:])
        moves = numpy.hypot(self.ways[:, :, 0], self.ways[:, :, 1]).max(axis=1) > MOVES
        light = self.color.mean(axis=1)
        step = numpy.abs(numpy.diff(light, axis=0))
        deviation = numpy.sqrt(self.noise / self.scale)
        step = step > CHANGES * light[1:] + 4 * (deviation[1:] + deviation[:-1])
        changes = numpy.zeros_like(moves)
        changes[1:] |= step
        changes[:-1] |= step
        self.regions = {"all": numpy.ones_like(moves), "moving": moves, "changing light": changes & ~moves,
                        "still": ~(moves | changes)}
        self.never = ~moves.any(axis=0)

    def error(self, error, region):
        return ((error**2).mean(axis=1) * self.scale - self.noise)[self.regions[region]].mean()

    def flicker(self, error):
        spread = error.var(axis=0, ddof=1).mean(axis=0) * self.scale.mean(axis=0) - self.noise.mean(axis=0)
        return spread[self.never].mean() if self.never.any() else float("nan")

    def warped(self, error):
        """Over the pixels that move and can be followed."""
        height, width = self.scale.shape[1:]
        y, x = numpy.mgrid[:height, :width]
        total, count = 0.0, 0
        for frame in range(len(error) - 1):
            dx, dy = self.ways[frame, 1]
            to_x, to_y = numpy.rint(x + dx).astype(int), numpy.rint(y + dy).astype(int)
            inside = (to_x >= 0) & (to_x < width) & (to_y >= 0) & (to_y < height)
            to_x, to_y = numpy.where(inside, to_x, 0), numpy.where(inside, to_y, 0)
            back = self.ways[frame + 1, 0][:, to_y, to_x]
            good = inside & (numpy.hypot(dx + back[0], dy + back[1]) < 1) & (numpy.hypot(dx, dy) > MOVES)
            apart = ((error[frame] - error[frame + 1][:, to_y, to_x]) ** 2).mean(axis=0) * self.scale[frame]
            apart -= self.noise[frame] + self.noise[frame + 1][to_y, to_x]
            total, count = total + apart[good].sum(), count + good.sum()
        return total / count


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--reference", type=int, default=512)
    parser.add_argument("--frames", type=int, default=8)
    parser.add_argument("--size", default="160x120")
    options = parser.parse_args()
    blind = ["--map", "motionPrevious=none", "--map", "motionNext=none"]
    runs = {"0": [], "1": ["--temporal", 1], "2": ["--temporal", 2], "1, no vectors": ["--temporal", 1, *blind]}
    print("| animation | N | error | moving | changing light | still | flicker | warped |")
    print("|---|---|--:|--:|--:|--:|--:|--:|")
    for name in ANIMATIONS:
        folder = render(name, options)
        truth = Truth(folder, options.frames)
        for label, arguments in runs.items():
            denoise(folder, label.replace(", ", "-").replace(" ", "-"), *arguments)
            files = folder.glob(f"den.{label.replace(', ', '-').replace(' ', '-')}.*.exr")
            error = numpy.stack([rgb(read(path)) for path in sorted(files)]) - truth.color
            figures = [truth.error(error, region) for region in truth.regions]
            figures += [truth.flicker(error), truth.warped(error)]
            print(f"| {name} | {label} | " + " | ".join(f"{1e3 * v:.3f}" for v in figures) + " |", flush=True)


main()
