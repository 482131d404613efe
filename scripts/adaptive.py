#!/usr/bin/env python3
"""Compare renders in rounds with uniform ones of as many samples, on the shipped scenes.

  python3 scripts/adaptive.py [--spp 32] [--seeds 3] [--reference 1024] [--scale 0.625] [--scenes NAME,…]

Prints the table of docs/SAMPLING.md: relMSE (ε = 0.01) after denoising with the default options, without
the references' noise, each the mean over the seeds; what the estimates between the rounds
cost; and the ratio at equal seconds, for which the uniform picture gets as many more samples as the
render in rounds took longer. Renders go to target/adaptive; references are kept between runs.
"""

import argparse
import json
import math
import shutil
import subprocess

import environments

ROOT = environments.ROOT
WORK = ROOT / "target" / "adaptive"
FIRST_SEED = 1
REFERENCE_SEEDS = (98, 99)


def program(name, *arguments):
    done = subprocess.run([ROOT / "target" / "release" / name, *map(str, arguments)], check=True, stdout=subprocess.PIPE)
    return done.stdout.decode()


def scaled(scene, scale):
    """The scene at another resolution, beside copies of the files it names."""
    folder = WORK / "scenes"
    source = ROOT / "fixtures" / "scenes"
    if not folder.exists():
        shutil.copytree(source, folder)
    description = json.loads((source / f"{scene}.json").read_text())
    camera = description["camera"]
    camera["resolution"] = [round(scale * size) for size in camera["resolution"]]
    path = folder / f"{scene}.json"
    path.write_text(json.dumps(description))
    return path


def trace(scene, out, *arguments):
    """Renders and returns the report."""
    report = out.with_suffix(".json")
    program("apr-trace", scene, out, "--quiet", "--report", report, *arguments)
    return json.loads(report.read_text())


def difference(result, reference):
    return json.loads(program("apr-compare", result, reference, "--json"))["results"][0]["rel_mse"]


class Truth:
    """Two references: what they agree on is no noise of theirs."""

    def __init__(self, scene, folder, samples):
        self.references = [folder / f"ref{samples}_{seed}.exr" for seed in REFERENCE_SEEDS]
        for path, seed in zip(self.references, REFERENCE_SEEDS):
            if not path.exists():
                trace(scene, path, "--reference", samples, "--seed", seed)
        self.noise = difference(*self.references)

    def error(self, render):
        """relMSE of the denoised render, without the references' noise."""
        denoised = render.with_name("denoised.exr")
        program("apr-denoise", render, denoised, "--quiet")
        return 0.5 * (sum(difference(denoised, reference) for reference in self.references) - self.noise)


def measure(scene, options):
    folder = WORK / scene
    folder.mkdir(parents=True, exist_ok=True)
    description = scaled(scene, options.scale)
    truth = Truth(description, folder, options.reference // len(REFERENCE_SEEDS))
    uniform, adaptive, longer, overhead, slower = 0.0, 0.0, 0.0, 0.0, 0.0
    for seed in range(FIRST_SEED, FIRST_SEED + options.seeds):
        out = folder / "render.exr"
        one = trace(description, out, "--spp", options.spp, "--seed", seed)
        uniform += truth.error(out)
        two = trace(description, out, "--spp", options.spp, "--seed", seed, "--adaptive")
        adaptive += truth.error(out)
        overhead += two["adaptive"]["overhead"]
        slower += two["seconds"] / one["seconds"]
        more = max(1, round(options.spp * two["seconds"] / one["seconds"]))
        trace(description, out, "--spp", more, "--seed", seed)
        longer += truth.error(out)
    return [value / options.seeds for value in (uniform, adaptive, longer, overhead, slower)]


def geometric_mean(values):
    return math.exp(sum(map(math.log, values)) / len(values))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--reference", type=int, default=1024)
    parser.add_argument("--scale", type=float, default=0.625)
    parser.add_argument("--scenes", help="comma-separated; all of fixtures/scenes by default")
    options = parser.parse_args()
    scenes = sorted(path.stem for path in (ROOT / "fixtures" / "scenes").glob("*.json"))
    if options.scenes:
        scenes = options.scenes.split(",")
    subprocess.run(["cargo", "build", "--release", "--bins"], cwd=ROOT, check=True)
    print("| scene | uniform | adaptive | ratio | ratio at equal seconds | overhead | seconds, of uniform's |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    ratios, timed = [], []
    for scene in scenes:
        uniform, adaptive, longer, overhead, slower = measure(scene, options)
        ratios.append(adaptive / uniform)
        timed.append(adaptive / longer)
        print(
            f"| {scene} | {uniform:.6f} | {adaptive:.6f} | {ratios[-1]:.2f} | {timed[-1]:.2f} "
            f"| {overhead:.1%} | {slower:.2f} |",
            flush=True,
        )
    print(f"| *geometric mean* | | | {geometric_mean(ratios):.2f} | {geometric_mean(timed):.2f} | | |")


main()
