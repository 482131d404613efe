#!/usr/bin/env python3
"""Make the tables of docs/RESULTS.md and the README's picture of the shipped scenes again, with the programs themselves.

  python3 scripts/readme.py [--spp 16] [--scale 0.625] [--scenes NAME,…] [--oidn]
  python3 scripts/readme.py --slopes [--scale 0.625] [--scenes NAME,…]

Renders go to target/shipped and are kept: a second run only denoises. One sweep page for each scene lies
in target/shipped/SCALE/SCENE/report. --oidn adds Intel Open Image Denoise (installs the package pyoidn into
.venv/oidn). The references take about ten minutes of processor time, once; the rest takes about three.
--slopes makes the table of the errors against samples instead, of renders with up to 1024 samples: with their
references of 2048 to 16384 samples about twenty-five minutes of processor time, once.
"""

import argparse
import math
import re
import statistics

import environments
import shipped

METHODS = ["apr", "nlm", "lp", "wavelet", "nfor", "student"]
OIDN = "OIDN"
PICTURE_SCENE, PICTURE_SPP = "teapot_specular", 16
RESULTS = "<!-- results: scripts/readme.py -->", "<!-- end of results -->"
SLOPES = "<!-- slopes: scripts/readme.py --slopes -->", "<!-- end of slopes -->"
SLOPE_SPP = [16, 64, 256, 1024]


def less_noise(scores, measured):
    """relMSE less the reference's own noise."""
    return max(scores["rel_mse"] - measured["reference_noise"], 1e-9)


class Row:
    """A scene's figures: of the render, and (error, processor seconds) by method."""

    def __init__(self, scene, measured):
        (one,) = measured["inputs"]
        error = lambda scores: less_noise(scores, measured)
        runs = {run["name"]: (error(run["scores"]), run["processor_seconds"], run) for run in one["runs"]}
        modes = [runs.pop(name) for name in list(runs) if name.startswith(OIDN)]
        if modes:
            runs[OIDN] = min(modes, key=lambda run: run[0])  # the mode with the least error
        self.scene, self.noisy = scene, error(one["noisy"])
        self.runs = {name: run[:2] for name, run in runs.items()}
        self.energy = runs["apr"][2]["scores"]["energy"]

    def ratios(self, method):
        """Error and seconds of a method as multiples of our own."""
        return [theirs / ours for theirs, ours in zip(self.runs[method], self.runs["apr"])]

    def best(self):
        return min(self.runs, key=lambda method: self.runs[method][0])


def measure(name, options):
    scene = shipped.Scene(name, options.scale)
    render, _ = scene.render(f"spp{options.spp}", "--spp", options.spp, "--seed", 1)
    more = []
    if options.oidn:
        environments.run("oidn", "rivals_oidn.py", scene.folder / "oidn", render)
        more = ["--rivals", scene.folder / "oidn" / "rivals.json"]
    return Row(name, scene.sweep([render], [{"name": name, "method": name} for name in METHODS], *more))


def table(rows):
    methods = [method for method in METHODS + [OIDN] if method in rows[0].runs]
    rivals = methods[1:]
    lines = [
        f"| scene | noisy | apr | {' | '.join(rivals)} | energy of apr |",
        "|---|--:|--:|" + "--:|" * (len(rivals) + 1),
    ]
    cell = lambda ratios: f"{ratios[0]:.2f} · {ratios[1]:.2g}"
    for row in rows:
        cells = " | ".join(cell(row.ratios(method)) for method in rivals)
        lines.append(f"| {row.scene} | {row.noisy:.4f} | {row.runs['apr'][0]:.6f} | {cells} | {row.energy:+.2%} |")
    means = [[shipped.geometric_mean(column) for column in zip(*(row.ratios(m) for row in rows))] for m in rivals]
    lines.append(f"| *geometric mean* | | | {' | '.join(map(cell, means))} | |")
    least = [sum(row.best() == method for row in rows) for method in methods]
    lines.append(f"| *least error in* | | {' | '.join(map(str, least))} | |")
    lines += ["", summary(rows)]
    return "\n".join(lines)


def summary(rows):
    own = [row.runs["apr"] for row in rows]
    share = shipped.geometric_mean([error / row.noisy for (error, _), row in zip(own, rows)])
    words = f"apr has the least error in {sum(row.best() == 'apr' for row in rows)} of {len(rows)} scenes"
    if OIDN in rows[0].runs:
        unlearnt = [min(error for method, (error, _) in row.runs.items() if method != OIDN) for row in rows]
        words += f", in {sum(o[0] == u for o, u in zip(own, unlearnt))} among the methods that have learnt nothing"
    seconds = shipped.geometric_mean([seconds for _, seconds in own])
    return f"{words}; its error is {share:.3f} of the noisy input's, its time {seconds:.2f} s of one core (geometric means)."


def slope_table(names, scale):
    """The errors of apr against samples, and the slopes of the straight lines through their logarithms."""
    columns = [*SLOPE_SPP, "slope", *(f"{a} to {b}" for a, b in zip(SLOPE_SPP, SLOPE_SPP[1:])), "reference's noise"]
    lines = [f"| scene | {' | '.join(map(str, columns))} |", "|---|" + "--:|" * len(columns)]
    for name in names:
        scene = shipped.Scene(name, scale)
        renders = [scene.render(f"slope{spp}", "--spp", spp, "--seed", spp)[0] for spp in SLOPE_SPP]
        measured = scene.sweep(renders, [{"name": "apr", "method": "apr"}], fine=True)
        errors = [less_noise(one["runs"][0]["scores"], measured) for one in measured["inputs"]]
        x, y = [math.log(spp) for spp in SLOPE_SPP], [math.log(error) for error in errors]
        steps = [(y[i + 1] - y[i]) / (x[i + 1] - x[i]) for i in range(len(x) - 1)]
        slopes = [statistics.linear_regression(x, y).slope, *steps]
        cells = [f"{error:.6f}" for error in errors] + [f"{slope:.2f}".replace("-", "−") for slope in slopes]
        lines.append(f"| {name} | {' | '.join(cells)} | {measured['reference_noise']:.6f} |")
    return "\n".join(lines)


def put(marks, table):
    """Puts the table between its marks in docs/RESULTS.md."""
    begin, end = marks
    results = shipped.ROOT / "docs" / "RESULTS.md"
    block = f"{begin}\n{table}\n{end}"
    text, found = re.subn(f"{re.escape(begin)}.*?{re.escape(end)}", lambda _: block, results.read_text(), flags=re.S)
    if not found:
        raise SystemExit(f"docs/RESULTS.md lacks the mark {begin}")
    results.write_text(text)


def picture():
    """The README's first: the scene at its whole size."""
    scene = shipped.Scene(PICTURE_SCENE, 1.0)
    noisy, _ = scene.render(f"spp{PICTURE_SPP}", "--spp", PICTURE_SPP, "--seed", 1)
    denoised = scene.folder / "denoised.exr"
    shipped.program("apr-denoise", noisy, denoised, "--quiet")
    target = shipped.ROOT / "fixtures" / "readme.png"
    shipped.program("apr-compare", noisy, scene.reference(), denoised, "--side-by-side", target, "--overwrite")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--scale", type=float, default=0.625)
    parser.add_argument("--scenes", help="comma-separated; all of fixtures/scenes by default, and only then the picture")
    parser.add_argument("--oidn", action="store_true")
    parser.add_argument("--slopes", action="store_true", help="the table of the errors against samples, and nothing else")
    options = parser.parse_args()
    shipped.build()
    scenes = options.scenes.split(",") if options.scenes else shipped.names()
    if options.slopes:
        put(SLOPES, slope_table(scenes, options.scale))
        return
    put(RESULTS, table([measure(name, options) for name in scenes]))
    if not options.scenes:
        picture()


main()
