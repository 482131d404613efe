#!/usr/bin/env python3
"""Compare renders in rounds with uniform ones of as many samples, on the shipped scenes.

  python3 scripts/adaptive.py [--spp 32] [--seeds 3] [--scale 0.625] [--scenes NAME,…]

Prints the table of docs/SAMPLING.md: relMSE (ε = 0.01) after denoising with the default options, less the
references' own noise, each the mean over the seeds; what the rounds cost; the ratio at equal seconds, for which
the uniform picture gets as many more samples as the render in rounds took longer; and how far the mean of
the picture, not denoised, is from the reference's. Seconds are of processor time. Renders go to target/shipped
and are made anew; references are kept.
"""

import argparse
import json
import statistics

import shipped

VARIANTS = [{"name": "apr", "method": "apr"}]

def rendered(scene, name, *arguments):
    """A render made anew, and its processor seconds."""
    (scene.folder / f"{name}.exr").unlink(missing_ok=True)
    return scene.render(name, *arguments)


def measure(name, options):
    """Of a scene: errors {uniform, adaptive, longer}, energies {uniform, adaptive}, each a list over the seeds; and
    what the rounds took longer and their estimates took, as shares."""
    scene = shipped.Scene(name, options.scale)
    renders, more, overheads = [], [], []
    for seed in range(1, options.seeds + 1):
        common = ["--seed", seed, "--threads", 1, "--spp"]
        uniform, uniform_seconds = rendered(scene, f"uniform{seed}", *common, options.spp)
        report = scene.folder / "rounds.json"
        adaptive, seconds = rendered(scene, f"adaptive{seed}", *common, options.spp, "--adaptive", "--report", report)
        more.append(seconds / uniform_seconds)
        overheads.append(json.loads(report.read_text())["adaptive"]["overhead"])
        longer, _ = rendered(scene, f"longer{seed}", *common, max(1, round(options.spp * more[-1])))
        renders += [uniform, adaptive, longer]
    measured = scene.sweep(renders, VARIANTS)
    errors = [one["runs"][0]["scores"]["rel_mse"] - measured["reference_noise"] for one in measured["inputs"]]
    energies = [one["noisy"]["energy"] for one in measured["inputs"]]
    return [errors[i::3] for i in range(3)], [energies[i::3] for i in range(2)], more, overheads


def percent(values):
    """Mean and its standard deviation."""
    deviation = statistics.stdev(values) / len(values) ** 0.5 if len(values) > 1 else float("nan")
    return f"{100 * statistics.mean(values):+.2f} ± {100 * deviation:.2f} %"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--scale", type=float, default=0.625)
    parser.add_argument("--scenes", help="comma-separated; all of fixtures/scenes by default")
    options = parser.parse_args()
    shipped.build()
    scenes = options.scenes.split(",") if options.scenes else shipped.names()
    print("| scene | uniform | adaptive | ratio | seconds | ratio at equal seconds | overhead | mean, uniform | mean, adaptive |")
    print("|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    ratios, equal = [], []
    for name in scenes:
        errors, energies, more, overheads = measure(name, options)
        uniform, adaptive, longer = map(statistics.mean, errors)
        ratios.append(adaptive / uniform)
        equal.append(adaptive / longer)
        print(
            f"| {name} | {uniform:.6f} | {adaptive:.6f} | {ratios[-1]:.2f} | {statistics.mean(more):.2f} "
            f"| {equal[-1]:.2f} | {statistics.mean(overheads):.1%} | {percent(energies[0])} | {percent(energies[1])} |",
            flush=True,
        )
    means = [f"{shipped.geometric_mean(column):.2f}" for column in (ratios, equal)]
    print(f"| *geometric mean* | | | {means[0]} | | {means[1]} | | | |")


main()
