#!/usr/bin/env python3
"""Make the table of docs/RESULTS.md and the README's picture of the shipped scenes again, with the programs themselves.

  python3 scripts/readme.py [--spp 16] [--scale 0.625] [--scenes NAME,…] [--oidn]

Renders go to target/shipped and are kept: a second run only denoises. One sweep page for each scene lies
in target/shipped/SCALE/SCENE/report. --oidn adds Intel Open Image Denoise (installs the package pyoidn into
.venv/oidn). The references take about ten minutes of processor time, once; the rest takes about three.
"""

import argparse
import re

import environments
import shipped

METHODS = ["apr", "nlm", "lp", "wavelet", "nfor", "student"]
OIDN = "OIDN"
PICTURE_SCENE, PICTURE_SPP = "teapot_specular", 16
BEGIN, END = "<!-- results: scripts/readme.py -->", "<!-- end of results -->"


class Row:
    """A scene's figures: of the render, and (error, processor seconds) by method. Errors are relMSE less the
    reference's own noise."""

    def __init__(self, scene, measured):
        floor = measured["reference_noise"]
        (one,) = measured["inputs"]
        error = lambda scores: max(scores["rel_mse"] - floor, 1e-9)
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
    options = parser.parse_args()
    shipped.build()
    scenes = options.scenes.split(",") if options.scenes else shipped.names()
    block = f"{BEGIN}\n{table([measure(name, options) for name in scenes])}\n{END}"
    results = shipped.ROOT / "docs" / "RESULTS.md"
    text, found = re.subn(f"{re.escape(BEGIN)}.*?{re.escape(END)}", lambda _: block, results.read_text(), flags=re.S)
    if not found:
        raise SystemExit(f"docs/RESULTS.md lacks the mark {BEGIN}")
    results.write_text(text)
    if not options.scenes:
        picture()


main()
