#!/usr/bin/env python3
"""Renders with Mitsuba and denoises without a file in between: mitsuba_in_memory.py [FOLDER]

Needs `pip install mitsuba`. `moment` around `aov` gives the second moment of the colour and of every
feature, from which their variances follow; a box filter keeps the noise of neighbours independent.
Prints the relative error before and after; with FOLDER writes noisy.exr, denoised.exr and reference.exr.
"""

import pathlib
import sys

import mitsuba as mi
import numpy as np

import apr

SPP, REFERENCE_SPP, SIZE = 16, 1024, 128
FEATURES = {"albedo": ("alb", 3), "normal": ("nn", 3), "depth": ("dd", 1)}


def scene():
    room = mi.cornell_box()
    room["sensor"]["film"] = {
        "type": "hdrfilm", "width": SIZE, "height": SIZE, "pixel_format": "rgb", "component_format": "float32",
        "rfilter": {"type": "box"},
    }
    aovs = "alb:albedo,nn:sh_normal,dd:depth"
    room["integrator"] = {
        "type": "moment",
        "nested": {"type": "aov", "aovs": aovs, "img": {"type": "path", "max_depth": 8}},
    }
    return mi.load_dict(room)


def layers(room, names, spp, seed):
    """The render's channels by name."""
    pixels = np.asarray(mi.render(room, spp=spp, seed=seed))
    return dict(zip(names, np.moveaxis(pixels, -1, 0)))


def pick(channels, layer, components):
    """The channels of a layer, whatever stands around its name."""
    found = [next(n for n in channels if n == f"{layer}.{c}" or n.endswith(f".{layer}.{c}")) for c in components]
    return np.stack([channels[name] for name in found], -1)


def main():
    mi.set_variant("scalar_rgb")
    room = scene()
    # The names of the channels, in the order of the render's last axis.
    names = ["R", "G", "B", *room.integrator().aov_names()]
    noisy = layers(room, names, SPP, seed=1)
    reference = layers(room, names, REFERENCE_SPP, seed=2)

    means = {n: v for n, v in noisy.items() if not n.startswith("m2_")}
    moments = {n.removeprefix("m2_"): v for n, v in noisy.items() if n.startswith("m2_")}

    def statistics(layer, components):
        mean = pick(means, layer, components)
        return mean, np.maximum(pick(moments, layer, components) - mean**2, 0) / (SPP - 1)

    color, variance = statistics("img", "RGB")
    features, feature_variance = {}, {}
    for name, (layer, _) in FEATURES.items():
        components = {"albedo": "RGB", "normal": "XYZ", "depth": "T"}[name]
        features[name], feature_variance[name] = statistics(layer, components)
    result = apr.denoise(
        color, variance=variance, features=features, feature_variance=feature_variance, spp=SPP
    )

    truth = pick(reference, "img", "RGB")
    error = lambda picture: (np.square(picture - truth) / (np.square(truth) + 0.01)).mean()
    print(f"relMSE {error(color):.5f} -> {error(result['color']):.5f}, "
          f"estimated MSE {result['mse'].mean():.2e}, true {np.square(result['color'] - truth).mean():.2e}")
    if len(sys.argv) > 1:
        folder = pathlib.Path(sys.argv[1])
        apr.write_exr(folder / "noisy.exr", color, features=features, spp=SPP)
        apr.write_exr(folder / "denoised.exr", result["color"], layers={"apr.mse": result["mse"]})
        apr.write_exr(folder / "reference.exr", truth)


if __name__ == "__main__":
    main()
