#!/usr/bin/env python3
"""What each effect of the tracer costs, in instructions per path, which other work does not disturb.

  python3 scripts/effect_prices.py [--spp 8] [--size 48]

Counts the instructions of apr-trace under callgrind (Debian: valgrind) on the plain diffuse Cornell box
and on the same box with one effect added: first put into the plan where no path meets it (what leaving it
out of the plan saves), then in use. Loading and writing are taken off by a run with one sample. Needs
target/release/apr-trace.
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


def put(*keys, value):
    """A change of a scene that sets one entry."""
    def change(scene):
        for key in keys[:-1]:
            scene = scene[key]
        scene[keys[-1]] = value
    return change


def with_shape(**shape):
    return lambda scene: scene["shapes"].append(shape)


def with_lens(radius):
    return lambda scene: scene["camera"].update(aperture_radius=radius, focus_distance=3.9)


def fog(low, high):
    box = {"min": [low] * 3, "max": [high] * 3}
    return put("medium", value={"extinction": 0.2, "albedo": 0.8, "bounds": box})


def ball(place):
    return with_shape(type="sphere", center=place, radius=0.2, material="white", motion=[{"translate": [0.2, 0, 0]}])


def lamp(place):
    return with_shape(type="sphere", center=place, radius=0.05, emission=20)


def sky(radiance):
    return put("environment", value={"type": "constant", "radiance": radiance})


CHECKER = {"type": "diffuse", "reflectance": {
    "type": "checker", "color0": [0.885, 0.698, 0.667], "color1": [0.8, 0.7, 0.6], "scale": [8, 8]}}
GOLD = {"type": "conductor", "metal": "gold", "roughness": 0.2}
AWAY = [0, 0, -9]  # behind a wall

# Effect, the change that plans it where no path meets it, the change that uses it.
EFFECTS = [
    ("textures", put("materials", "unused", value=CHECKER), put("materials", "white", value=CHECKER)),
    ("glossy", put("materials", "unused", value=GOLD), put("materials", "white", value=GOLD)),
    ("environment", sky(1e-30), sky(1.0)),
    ("light choice", lamp(AWAY), lamp([0, 0.5, 0])),
    ("motion blur", ball(AWAY), ball([0, 0.2, 0.2])),
    ("depth of field", with_lens(1e-6), with_lens(0.1)),
    ("medium", fog(8.0, 9.0), fog(-0.999, 0.999)),
]
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


def price(change, options, arguments=("--features", "none")):
    """Instructions per path of the Cornell box with `change`."""
    scene = json.loads((SCENES / "cornell_box.json").read_text())
    scene["camera"]["resolution"] = [options.size, options.size]
    change(scene)
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "scene.json"
        path.write_text(json.dumps(scene))
        many, one = (instructions(path, spp, arguments) for spp in (options.spp + 1, 1))
    return (many - one) / (options.size ** 2 * options.spp)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=8)
    parser.add_argument("--size", type=int, default=48)
    options = parser.parse_args()
    plain = price(lambda scene: None, options)
    cell = lambda count: f"{count:.0f} ({count / plain - 1:+.1%})"
    print(f"plain diffuse Cornell box: {plain:.0f} instructions per path\n")
    print("| effect | planned, not met | in use |\n|---|---|---|")
    for name, idle, used in EFFECTS:
        print(f"| {name} | {cell(price(idle, options))} | {cell(price(used, options))} |", flush=True)
    for name, arguments in OUTPUTS:
        print(f"| {name} | – | {cell(price(lambda scene: None, options, arguments))} |", flush=True)


if __name__ == "__main__":
    main()
