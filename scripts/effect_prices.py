#!/usr/bin/env python3
"""What each effect of the tracer costs, in instructions per path, which other work does not disturb.

  python3 scripts/effect_prices.py [--spp 8] [--size 48]

Counts the instructions of apr-trace under callgrind (Debian: valgrind) on the plain diffuse Cornell box
and on the same box with one effect added: first put into the plan where no path meets it (what leaving it
out of the plan saves), then in use. Loading and writing are taken off by a run of two samples per pixel, the
fewest that have all layers. Needs target/release/apr-trace.
"""

import argparse
import json
import pathlib
import re
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCENES = ROOT / "fixtures" / "scenes"
PROGRAM = ROOT / "target" / "release" / "apr-trace"


# Changes of the Cornell box; benches/trace.rs times the same.
EFFECTS = json.loads((ROOT / "benches" / "effects.json").read_text())
FEWEST = 2  # samples per pixel that have variances and halves: as much is written as of many
OUTPUTS = [
    ("features", ["--features", "first-hit"]),
    ("features of the second hit too", ["--features", "first-hit", "--second-hit"]),
    ("light groups", ["--features", "none", "--light-groups"]),
]


def instructions(path, spp, arguments):
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", PROGRAM, path,
               path.with_suffix(".exr"), "--quiet", "--threads", "1", "--spp", str(spp), *arguments]
    said = subprocess.run(command, check=True, capture_output=True, text=True).stderr
    return int(re.search(r"Collected : (\d+)", said)[1])


def changed(scene, additions):
    """Puts each value at its JSON pointer; `-` at the end appends to a list."""
    for pointer, value in additions.items():
        *way, last = pointer.split("/")[1:]
        place = scene
        for key in way:
            place = place[key]
        if last == "-":
            place.append(value)
        else:
            place[last] = value


def price(additions, options, arguments=("--features", "none")):
    """Instructions per path of the Cornell box with `additions`."""
    scene = json.loads((SCENES / "cornell_box.json").read_text())
    scene["camera"]["resolution"] = [options.size, options.size]
    changed(scene, additions)
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "scene.json"
        path.write_text(json.dumps(scene))
        many, few = (instructions(path, spp, arguments) for spp in (options.spp + FEWEST, FEWEST))
    return (many - few) / (options.size ** 2 * options.spp)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=8)
    parser.add_argument("--size", type=int, default=48)
    options = parser.parse_args()
    plain = price({}, options)
    cell = lambda count: f"{count:.0f} ({count / plain - 1:+.1%})"
    print(f"plain diffuse Cornell box: {plain:.0f} instructions per path\n")
    print("| effect | planned, not met | in use |\n|---|---|---|")
    for effect in EFFECTS:
        planned, used = (cell(price(effect[key], options)) for key in ("planned", "used"))
        print(f"| {effect['effect']} | {planned} | {used} |", flush=True)
    for name, arguments in OUTPUTS:
        print(f"| {name} | – | {cell(price({}, options, arguments))} |", flush=True)


if __name__ == "__main__":
    main()
