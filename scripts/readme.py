#!/usr/bin/env python3
"""Make the README's results and picture again from the shipped scenes, with the programs themselves.

  python3 scripts/readme.py [--spp 16,64,256] [--reference 4096] [--scenes NAME,…] [--oidn]

Renders go to target/readme and are kept: a second run only denoises. One sweep page for each scene
lies in target/readme/SCENE/report. --oidn adds Intel Open Image Denoise (installs the package
pyoidn into .venv/oidn); without it the table has no rival. The first run takes hours of a small
machine, nearly all of it in the references; a killed one continues.
"""

import argparse
import json
import math
import re
import subprocess

import environments

ROOT = environments.ROOT
WORK = ROOT / "target" / "readme"
PICTURE_SCENE, PICTURE_SPP = "teapot_specular", 16
BEGIN, END = "<!-- results: scripts/readme.py -->", "<!-- end of results -->"


def program(name, *arguments):
    subprocess.run([ROOT / "target" / "release" / name, *map(str, arguments)], check=True)


def render(scene, counts, reference):
    """The renders and the reference of a scene, as paths; what exists is kept."""
    folder = WORK / scene
    folder.mkdir(parents=True, exist_ok=True)
    description = ROOT / "fixtures" / "scenes" / f"{scene}.json"
    renders = [folder / f"spp{spp}.exr" for spp in counts]
    for seed, (spp, path) in enumerate(zip(counts, renders), start=1):
        if not path.exists():
            program("apr-trace", description, path, "--spp", spp, "--seed", seed, "--quiet")
    truth = folder / f"ref{reference}.exr"
    if not truth.exists():
        program("apr-trace", description, truth, "--reference", reference, "--seed", 99, "--quiet")
    return renders, truth


def sweep(scene, renders, truth, oidn):
    """What `apr-compare sweep` measured, as its JSON."""
    folder = WORK / scene
    more = []
    if oidn:
        environments.run("oidn", "rivals_oidn.py", folder / "oidn", *renders)
        more = ["--rivals", folder / "oidn" / "rivals.json"]
    program("apr-compare", "sweep", *renders, "--reference", truth, "--out", folder / "report", *more)
    return json.loads((folder / "report" / "sweep.json").read_text())


def rows(scene, measured):
    """(scene, spp, noisy, ours, best of the rivals or None, seconds, energy), less the reference's noise."""
    floor = measured["reference_noise"] or 0.0
    for one in measured["inputs"]:
        runs = one["runs"]
        ours = next(run for run in runs if run["calibration"])  # the first variant is the default
        rivals = [run["scores"]["rel_mse"] - floor for run in runs if not run["calibration"]]
        error = max(ours["scores"]["rel_mse"] - floor, 1e-9)
        noisy = one["noisy"]["rel_mse"] - floor
        yield scene, int(one["spp"]), noisy, error, min(rivals, default=None), ours["seconds"], ours["scores"]["energy"]


def table(all_rows):
    lines = ["| scene | spp | noisy | apr-denoise | OIDN, best mode | ratio | seconds | energy |", "|---|--:|--:|--:|--:|--:|--:|--:|"]
    for scene, spp, noisy, ours, rival, seconds, energy in all_rows:
        versus = f"{rival:.6f} | {ours / rival:.2f}" if rival else "– | –"
        lines.append(f"| {scene} | {spp} | {noisy:.5f} | {ours:.6f} | {versus} | {seconds:.2f} | {energy:+.2%} |")
    lines.append("")
    for spp in sorted({row[1] for row in all_rows}):
        group = [row for row in all_rows if row[1] == spp]
        rivals = [row[3] / row[4] for row in group if row[4]]
        words = f"{geometric_mean([row[3] / row[2] for row in group]):.3f} of the noisy input's"
        if rivals:
            ahead = sum(ratio < 1 for ratio in rivals)
            words += f", {geometric_mean(rivals):.2f} of OIDN's; ahead in {ahead} of {len(rivals)} scenes"
        lines.append(f"- relMSE at {spp} spp, geometric mean: {words}.")
    return "\n".join(lines)


def geometric_mean(ratios):
    return math.exp(sum(map(math.log, ratios)) / len(ratios))


def picture(scene, spp, truth):
    noisy, denoised = WORK / scene / f"spp{spp}.exr", WORK / scene / "denoised.exr"
    program("apr-denoise", noisy, denoised, "--quiet")
    program("apr-compare", noisy, truth, denoised, "--side-by-side", ROOT / "fixtures" / "readme.png")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spp", default="16,64,256")
    parser.add_argument("--reference", type=int, default=4096)
    parser.add_argument("--scenes", help="comma-separated; all of fixtures/scenes by default")
    parser.add_argument("--oidn", action="store_true")
    options = parser.parse_args()
    scenes = sorted(path.stem for path in (ROOT / "fixtures" / "scenes").glob("*.json"))
    if options.scenes:
        scenes = options.scenes.split(",")
    counts = [int(spp) for spp in options.spp.split(",")]
    subprocess.run(["cargo", "build", "--release", "--bins"], cwd=ROOT, check=True)
    all_rows = []
    for scene in scenes:
        renders, truth = render(scene, counts, options.reference)
        all_rows += rows(scene, sweep(scene, renders, truth, options.oidn))
        if scene == PICTURE_SCENE and PICTURE_SPP in counts:
            picture(scene, PICTURE_SPP, truth)
    readme = ROOT / "README.md"
    block = f"{BEGIN}\n{table(all_rows)}\n{END}"
    text, found = re.subn(f"{re.escape(BEGIN)}.*?{re.escape(END)}", lambda _: block, readme.read_text(), flags=re.S)
    if not found:
        raise SystemExit(f"README.md lacks the mark {BEGIN}")
    readme.write_text(text)


main()
