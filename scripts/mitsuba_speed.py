#!/usr/bin/env python3
"""Paths per second of apr-trace beside Mitsuba 3, on the scenes of fixtures/scenes.

  python3 scripts/mitsuba_speed.py [SCENE …] [--size 256x192] [--spp 32] [--repeat 3] [--json FILE]

Same scene, camera, resolution, samples, depths and box filter, one after the other in one run, on all
cores. apr-trace is timed with and without features (Mitsuba renders colour alone). llvm_ad_rgb renders
once before, since it compiles then. The four take turns --repeat times and the least time of each counts, since
other work on the machine only ever adds. Columns are million paths per second of wall clock, and in brackets
per second of processor time, which other work on the machine disturbs less. Loading is not counted.
Needs target/release/apr-trace; llvm_ad_rgb needs LLVM (Debian: libllvm19, and DRJIT_LIBLLVM_PATH).
"""

import argparse
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent

try:
    import mitsuba as mi
except ImportError:
    import environments

    environments.run("mitsuba", "mitsuba_speed.py", *sys.argv[1:])
    sys.exit(0)

FEWEST = 2  # samples per pixel that have variances and halves: as much is written as of many
PROGRAM = ROOT / "target" / "release" / "apr-trace"


def timed(work, who):
    """Wall clock and processor seconds of `work`."""
    def processor():
        usage = resource.getrusage(who)
        return usage.ru_utime + usage.ru_stime

    wall, cpu = time.monotonic(), processor()
    work()
    return time.monotonic() - wall, processor() - cpu


def own(path, spp, features):
    """Seconds for `spp` samples, less those of the fewest that have all layers: start, loading and writing."""
    def run(count):
        command = [PROGRAM, path, path.with_suffix(".exr"), "--quiet", "--features", features, "--spp", str(count)]
        return timed(lambda: subprocess.run(command, check=True), resource.RUSAGE_CHILDREN)

    long, short = run(spp + FEWEST), run(FEWEST)
    return [a - b for a, b in zip(long, short)]


def mitsuba(path, spp, variant):
    """Run in a process of its own: a variant cannot be left."""
    code = (f"import sys; sys.path.insert(0, {str(ROOT / 'scripts')!r}); import mitsuba_speed as s; "
            f"s.render_mitsuba({str(path)!r}, {spp}, {variant!r})")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    return json.loads(done.stdout) if done.returncode == 0 else None


def render_mitsuba(path, spp, variant):
    mi.set_variant(variant)
    import mitsuba_convert as convert

    scene = mi.load_dict(convert.convert(convert.scene_at(convert.load(path), 0.5), spp))
    import numpy as np

    def render(seed):
        np.array(mi.render(scene, spp=spp, seed=seed))

    if variant.startswith("llvm"):
        render(0)
    print(json.dumps(timed(lambda: render(1), resource.RUSAGE_SELF)))


def least(turns):
    """The least wall clock and processor time of each column; None where a column cannot run."""
    return [None if None in column else [min(times) for times in zip(*column)] for column in zip(*turns)]


def main():
    import mitsuba_convert as convert

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", help="names in fixtures/scenes; all by default")
    parser.add_argument("--size", default="256x192")
    parser.add_argument("--spp", type=int, default=32)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    paths = width * height * options.spp / 1e6
    names = options.scenes or sorted(path.stem for path in (ROOT / "fixtures" / "scenes").glob("*.json"))
    columns = ["own", "own, no features", "scalar_rgb", "llvm_ad_rgb"]
    print(f"Mitsuba {mi.__version__}: million paths per second of wall clock (of processor time), {options.size}, {options.spp} spp, {os.cpu_count()} cores")
    print("| scene | " + " | ".join(columns) + " | own / scalar | llvm / own |\n|---|" + "---|" * 6)
    table = {}
    for name in names:
        scene = convert.load(ROOT / "fixtures" / "scenes" / f"{name}.json")
        scene["camera"]["resolution"] = [width, height]
        scene["camera"].pop("filter", None)
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "scene.json"
            path.write_text(json.dumps(scene))
            seconds = least([[own(path, options.spp, "first-hit"), own(path, options.spp, "none"),
                              mitsuba(path, options.spp, "scalar_rgb"), mitsuba(path, options.spp, "llvm_ad_rgb")]
                             for _ in range(options.repeat)])
        rates = [pair and [paths / s for s in pair] for pair in seconds]
        table[name] = dict(zip(columns, rates))
        cells = [f"{r[0]:.2f} ({r[1]:.2f})" if r else "–" for r in rates]
        ratio = lambda a, b: f"{rates[a][1] / rates[b][1]:.2f}" if rates[a] and rates[b] else "–"
        print(f"| {name} | " + " | ".join(cells) + f" | {ratio(1, 2)} | {ratio(3, 1)} |", flush=True)
    if options.json:
        options.json.write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    main()
