#!/usr/bin/env python3
"""Compares apr-trace with Mitsuba 3 on scenes of fixtures/scenes.

  python3 scripts/mitsuba_check.py [SCENE …] [--size 96x72] [--spp 256] [--out FOLDER]
  python3 scripts/mitsuba_check.py SCENE … --size 32x24 --spp 1024 --fixtures fixtures/trace

The second form writes what Mitsuba renders as fixtures, with which `cargo test` does the same.

Both programs render each scene with independent samples and a box filter, at the size given. Radiance
and the features position, normal, albedo and depth are compared by z-tests, with the variances of both:
for every pixel, for blocks of 8 × 8 pixels and for the whole picture, each at the 0.1 % level corrected
for the number of tests (Šidák). Albedo is compared where Mitsuba has one: it gives 0 for metal and glass.
Motion, which Mitsuba lacks, is replaced by many frozen moments. Prints a table; where a test fails it
writes the map of z as a picture and ends with code 1. Needs target/release/apr-trace.
"""

import argparse
import copy
import json
import math
import pathlib
import statistics
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent

try:
    import mitsuba as mi
except ImportError:
    import environments

    environments.run("mitsuba", "mitsuba_check.py", *sys.argv[1:])
    sys.exit(0)

import numpy as np  # noqa: E402
import OpenEXR  # noqa: E402

mi.set_variant("scalar_rgb")

import mitsuba_convert as convert  # noqa: E402  (needs the variant)

LEVEL = 0.001
BLOCK = 8
MOMENTS = 96  # of a scene in motion
# Rounding of single precision, relative to a channel's largest value: no deviation smaller counts.
ROUNDING = {"color": 1e-5, "position": 2e-5, "normal": 2e-4, "albedo": 1e-5, "depth": 2e-5}
AOVS = {"position": ("position", "XYZ"), "normal": ("sh_normal", "XYZ"), "albedo": ("albedo", "RGB"), "depth": ("depth", "T")}


def render_mitsuba(scene, spp):
    """For each quantity: mean, variance of the mean."""
    times = [(i + 0.5) / MOMENTS for i in range(MOMENTS)] if convert.moves(scene) else [0.0]
    each = max(1, spp // len(times))
    sums = {}
    for index, time in enumerate(times):
        moment = convert.convert(convert.scene_at(scene, time), each)
        aovs = ",".join(f"{name}:{kind}" for name, (kind, _) in AOVS.items())
        nested = {"type": "aov", "aovs": aovs, "img": moment["integrator"]}
        loaded = mi.load_dict(moment | {"integrator": {"type": "moment", "nested": nested}})
        # Seeds far apart: those of neighbours give neighbouring blocks the same numbers.
        mi.render(loaded, seed=1 + 10007 * index)
        for name, plane in channels(loaded.sensors()[0].film().bitmap()).items():
            sums[name] = sums.get(name, 0.0) + plane / len(times)
    count = each * len(times)

    def quantity(names):
        mean = np.stack([sums[n] for n in names], -1)
        square = np.stack([sums["m2_" + n] for n in names], -1)
        return mean, np.maximum(square - mean ** 2, 0) / (count - 1)

    result = {"color": quantity([f"nested.img.{c}" for c in "RGB"])}
    for name, (_, components) in AOVS.items():
        result[name] = quantity([f"nested.{name}.{c}" for c in components])
    return result


def channels(bitmap):
    data = np.array(bitmap, dtype=np.float64)
    return {bitmap.struct_()[i].name: data[..., i] for i in range(data.shape[-1])}


def render_own(scene, spp, program):
    with tempfile.TemporaryDirectory() as scratch:
        path, out = pathlib.Path(scratch) / "scene.json", pathlib.Path(scratch) / "out.exr"
        path.write_text(json.dumps(scene))
        subprocess.run([program, path, out, "--spp", str(spp), "--quiet"], check=True)
        planes = OpenEXR.File(str(out), separate_channels=True).channels()
        plane = {name: np.array(channel.pixels, dtype=np.float64) for name, channel in planes.items()}

    def quantity(mean, variance, components):
        return tuple(np.stack([plane[layer + c] for c in components], -1) for layer in (mean, variance))

    result = {"color": quantity("", "variance.", "RGB")}
    for name, (_, components) in AOVS.items():
        components = "Z" if name == "depth" else components
        result[name] = quantity(f"{name}.", f"{name}Variance.", components)
    return result


def matt(scene):
    """The scene for features: Mitsuba has no albedo of metal and glass, and takes fog for a surface."""
    scene = copy.deepcopy(scene)
    for m in scene.get("materials", {}).values():
        if m["type"] in ("conductor", "dielectric"):
            m.clear()
            m |= {"type": "diffuse", "reflectance": 0.5}
    scene.pop("medium", None)
    scene["integrator"] = {"max_depth": 1}
    return scene


def blocks(values):
    height, width = (size // BLOCK * BLOCK for size in values.shape[:2])
    cut = values[:height, :width].reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, -1)
    return cut.sum(axis=(1, 3))


def around(variance):
    """Mean over 3 × 3 pixels. A pixel that happened to miss the rare bright sample has hardly any variance
    of its own (Mitsuba chooses among a hundred lamps evenly): its neighbours know better."""
    padded = np.pad(variance, ((1, 1), (1, 1), (0, 0)), mode="edge")
    height, width = variance.shape[:2]
    return sum(padded[y:y + height, x:x + width] for y in range(3) for x in range(3)) / 9


def z_scores(difference, variance, floor):
    return np.abs(difference) / np.sqrt(variance + floor ** 2)


def test(own, other, rounding):
    """Largest |z| and its bound for pixels, blocks and the whole, and the map of z."""
    difference, variance = own[0] - other[0], own[1] + other[1]
    scale = max(np.abs(other[0]).max(), 1e-6) * rounding
    pixels = z_scores(difference, np.maximum(variance, around(variance)), scale)
    area = BLOCK * BLOCK
    block = z_scores(blocks(difference), blocks(variance), scale * area)
    whole = z_scores(difference.sum((0, 1)), variance.sum((0, 1)), scale * difference[..., 0].size)
    return [(z.max(), bound(z.size)) for z in (pixels, block, whole)], pixels


def bound(tests):
    """The |z| that the largest of `tests` exceeds with probability LEVEL."""
    single = -math.expm1(math.log1p(-LEVEL) / tests)
    return -statistics.NormalDist().inv_cdf(single / 2)


def load(name, options):
    scene = convert.load(ROOT / "fixtures" / "scenes" / f"{name}.json")
    scene["camera"]["resolution"] = [int(n) for n in options.size.split("x")]
    scene["camera"].pop("filter", None)
    return scene


def both(scene, render):
    """Features of the matt scene, radiance of the true one."""
    return render(matt(scene)) | {"color": render(scene)["color"]}


def write_fixture(name, options):
    result = both(load(name, options), lambda scene: render_mitsuba(scene, options.spp))
    planes = {}
    for quantity, components in {"color": "RGB", "position": "XYZ", "normal": "XYZ", "albedo": "RGB", "depth": "Z"}.items():
        mean_layer, variance_layer = ("", "variance.") if quantity == "color" else (f"{quantity}.", f"{quantity}Variance.")
        for i, component in enumerate(components):
            for layer, values in zip((mean_layer, variance_layer), result[quantity]):
                planes[layer + component] = np.ascontiguousarray(values[..., i], np.float32)
    options.fixtures.mkdir(parents=True, exist_ok=True)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "samplesPerPixel": options.spp}
    OpenEXR.File(header, planes).write(str(options.fixtures / f"{name}.exr"))


def check(name, options):
    scene = load(name, options)
    own = both(scene, lambda scene: render_own(scene, options.spp, options.program))
    other = both(scene, lambda scene: render_mitsuba(scene, options.spp))
    good = True
    for quantity in own:
        results, scores = test(own[quantity], other[quantity], ROUNDING[quantity])
        passed = all(z <= limit for z, limit in results)
        good &= passed
        cells = "  ".join(f"{z:7.2f} ≤ {limit:4.2f}" for z, limit in results)
        print(f"{name:16} {quantity:9} {cells}  {'ok' if passed else 'FAILED'}", flush=True)
        if not passed and options.out:
            options.out.mkdir(parents=True, exist_ok=True)
            picture = np.clip(scores.max(-1, keepdims=True) / 10, 0, 1).repeat(3, -1)
            mi.util.write_bitmap(str(options.out / f"{name}_{quantity}_z.png"), picture.astype(np.float32))
            pair = np.concatenate([own[quantity][0], other[quantity][0]], 1).astype(np.float32)
            mi.Bitmap(pair if pair.shape[-1] == 3 else pair.repeat(3, -1)).write(str(options.out / f"{name}_{quantity}.exr"))
    return good


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", help="names in fixtures/scenes; all by default")
    parser.add_argument("--size", default="96x72")
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--out", type=pathlib.Path, help="folder for pictures of what failed")
    parser.add_argument("--program", default=str(ROOT / "target" / "release" / "apr-trace"))
    parser.add_argument("--fixtures", type=pathlib.Path, help="folder for Mitsuba's results; nothing is compared")
    options = parser.parse_args()
    names = options.scenes or sorted(path.stem for path in (ROOT / "fixtures" / "scenes").glob("*.json"))
    if options.fixtures:
        for name in names:
            write_fixture(name, options)
        return
    print(f"{'scene':16} {'quantity':9} {'pixels':>14}  {'blocks':>14}  {'whole':>14}   largest |z| ≤ bound")
    results = [check(name, options) for name in names]
    sys.exit(0 if all(results) else 1)


if __name__ == "__main__":
    main()
