#!/usr/bin/env python3
"""Render a scene of mitsuba_scenes.py into the files that the denoiser reads.

  render_mitsuba.py SCENE OUT [--size 240x180] [--spp 16,64,256] [--reference 4096] [--seed 0] [--variant llvm_ad_rgb]

writes OUT/SCENE/spp16.exr … and OUT/SCENE/ref.exr. Samples are independent, the pixel filter is a
box. A sample is one camera ray; it gives the radiance of the scene's own integrator and the features
of its first hit:
  R,G,B               mean radiance
  variance.{R,G,B}    variance of that mean, from 16 batches
  halfA.{R,G,B}       mean of the first 8 batches; the other half is 2·mean − halfA
  albedo normal position depth visibility, and the same with `Variance` after the name
Albedo is 1 where the surface has no diffuse part. Visibility is one shadow ray to the very point on
an emitter that the path integrator samples at its first hit, so that its noise is correlated with
the colour's. A miss has all features 0 and visibility 1. `samplesPerPixel` is in the header.

The reference carries R,G,B and the means of its two halves of samples, halfA. A reference that
exists is refined: its samples are kept beside it in ref.npz and new ones are added.
"""

import argparse
import os
import pathlib
import time

import numpy as np
import OpenEXR

BATCHES = 16
LANES = 1 << 21  # rays per launch; bounds the memory of the vectorised variants
FEATURES = {"albedo": "RGB", "normal": "XYZ", "position": "XYZ", "depth": "Z", "visibility": "Y"}
HALF = {"albedo", "normal", "visibility"}  # bounded to [-1, 1]: half floats do


class Renderer:
    """One scene at one size."""

    def __init__(self, scene, width, height):
        import drjit as dr
        import mitsuba as mi

        self.dr, self.mi, self.width, self.height = dr, mi, width, height
        film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}}
        scene = dict(scene, sensor=dict(scene["sensor"], film=film))
        self.scene = mi.load_dict(scene)
        self.integrator = self.scene.integrator()
        self.sensor = self.scene.sensors()[0]
        self.medium = scene["sensor"].get("medium")  # where the camera stands

    def batch(self, spp, seed, features=True):
        """Means over `spp` samples of each pixel: rows × columns × (3, or 3 + the features')."""
        dr, mi = self.dr, self.mi
        sampler = mi.load_dict({"type": "independent", "sample_count": spp})
        sampler.seed(seed, self.width * self.height * spp)
        pixel = dr.arange(mi.UInt32, self.width * self.height * spp) // spp
        corner = mi.Point2f(mi.Float(pixel % self.width), mi.Float(pixel // self.width))
        at = (corner + sampler.next_2d()) / mi.Point2f(self.width, self.height)
        ray, weight = self.sensor.sample_ray_differential(0.0, sampler.next_1d(), at, sampler.next_2d())
        light = sampler.clone().next_2d()  # what the path integrator will draw first
        color, _, _ = self.integrator.sample(self.scene, sampler, ray, self.medium)
        color = mi.Color3f(color * weight)
        values = [color.x, color.y, color.z]
        if features:
            values += self.first_hit(ray, light)
        sums = [dr.block_reduce(dr.ReduceOp.Add, dr.select(dr.isfinite(v), v, 0), spp) for v in values]
        dr.eval(sums)
        planes = [np.asarray(s, np.float32).reshape(self.height, self.width) for s in sums]
        return np.stack(planes, -1).astype(np.float64) / spp

    def first_hit(self, ray, light):
        """Albedo, normal, position, depth and visibility of each ray's first hit."""
        dr, mi = self.dr, self.mi
        hit = self.scene.ray_intersect(ray)
        seen = hit.is_valid()
        bsdf = hit.bsdf(ray)
        matt = mi.has_flag(bsdf.flags(), mi.BSDFFlags.DiffuseReflection)
        albedo = mi.Color3f(dr.select(matt, bsdf.eval_diffuse_reflectance(hit), 1.0))
        spot, _ = self.scene.sample_emitter_direction(hit, light, False, seen)
        blocked = self.scene.ray_test(hit.spawn_ray_to(spot.p), seen)
        zero = lambda v: dr.select(seen, v, 0.0)
        normal, position = hit.sh_frame.n, hit.p
        return [
            *(zero(v) for v in (albedo.x, albedo.y, albedo.z)),
            *(zero(v) for v in (normal.x, normal.y, normal.z)),
            *(zero(v) for v in (position.x, position.y, position.z)),
            zero(hit.t),
            dr.select(seen & blocked, mi.Float(0), mi.Float(1)),
        ]

    def noisy(self, spp, seed):
        """The channels of a noisy picture, as a dictionary of float arrays."""
        assert spp % BATCHES == 0, f"{spp} samples do not divide into {BATCHES} batches"
        batches = np.stack([self.batch(spp // BATCHES, seed * BATCHES + i) for i in range(BATCHES)])
        mean = batches.mean(0)
        variance = batches.var(0, ddof=1) / BATCHES
        half = batches[: BATCHES // 2].mean(0)
        channels = {}
        for i, c in enumerate("RGB"):
            channels[c] = mean[..., i]
            channels[f"variance.{c}"] = variance[..., i]
            channels[f"halfA.{c}"] = half[..., i]
        i = 3
        for name, components in FEATURES.items():
            for c in components:
                channels[f"{name}.{c}"] = mean[..., i]
                channels[f"{name}Variance.{c}"] = variance[..., i]
                i += 1
        return channels


def write_exr(path, channels, header=()):
    """Writes beside `path` and renames, so that a reader never meets half a file."""
    typed = {
        name: np.ascontiguousarray(value, np.float16 if name.split(".")[0] in HALF else np.float32)
        for name, value in channels.items()
    }
    draft = f"{path}.part.exr"
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **dict(header)}, typed).write(draft)
    os.replace(draft, path)


def add_reference(renderer, folder, spp, seed, log=print):
    """Brings the reference in `folder` to `spp` samples: two running sums, saved as it goes on."""
    state = folder / "ref.npz"
    shape = (renderer.height, renderer.width, 3)
    halves, counts, launch = [np.zeros(shape), np.zeros(shape)], [0, 0], 0
    if state.exists():
        kept = np.load(state)
        halves, counts, launch = list(kept["halves"]), list(kept["counts"]), int(kept["launch"])
    step = max(1, min(spp // 2, LANES // (renderer.width * renderer.height)))
    began = saved = time.monotonic()
    while sum(counts) < spp or counts[0] != counts[1]:
        side = launch % 2
        # The offset keeps a reference's seeds apart from every noisy picture's.
        halves[side] = halves[side] + renderer.batch(step, (1 << 20) + seed * (1 << 16) + launch, features=False) * step
        counts[side] += step
        launch += 1
        done = counts[0] == counts[1] and sum(counts) >= spp
        if done or (time.monotonic() - saved > 60 and counts[0] == counts[1]):
            saved = time.monotonic()
            np.savez(f"{state}.part.npz", halves=np.stack(halves), counts=counts, launch=launch)
            os.replace(f"{state}.part.npz", state)
            log(f"  {sum(counts)} samples, {saved - began:.0f} s", flush=True)
    a, b = (h / c for h, c in zip(halves, counts))
    channels = {c: (a[..., i] + b[..., i]) / 2 for i, c in enumerate("RGB")}
    channels |= {f"halfA.{c}": a[..., i] for i, c in enumerate("RGB")}
    write_exr(folder / "ref.exr", channels, {"samplesPerPixel": int(sum(counts))})


def render(name, scene, out, size, counts, reference_spp, seed=0):
    """Noisy pictures of so many samples, and the reference, in the folder OUT/NAME."""
    folder = out / name
    folder.mkdir(parents=True, exist_ok=True)
    renderer = Renderer(scene, *size)
    for i, spp in enumerate(counts):
        began = time.monotonic()
        channels = renderer.noisy(spp, seed * 1000 + i + 1)
        write_exr(folder / f"spp{spp}.exr", channels, {"samplesPerPixel": spp})
        print(f"{name}: {spp} samples, {time.monotonic() - began:.1f} s", flush=True)
    if reference_spp:
        add_reference(renderer, folder, reference_spp, seed)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--size", default="240x180")
    parser.add_argument("--spp", default="16,64,256", help="noisy pictures, comma-separated; empty for none")
    parser.add_argument("--reference", type=int, default=4096, help="samples of the reference; 0 for none")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    options = parser.parse_args()
    import mitsuba as mi

    mi.set_variant(options.variant)
    from mitsuba_scenes import SCENES

    width, height = map(int, options.size.split("x"))
    counts = [int(spp) for spp in options.spp.split(",") if spp]
    render(options.scene, SCENES[options.scene](), options.out, (width, height), counts, options.reference, options.seed)


if __name__ == "__main__":
    main()
