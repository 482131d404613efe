"""The shipped scenes at a small size, rendered by the program itself. What is there already is kept."""

import json
import math
import os
import shutil
import subprocess

import environments

ROOT = environments.ROOT
WORK = ROOT / "target" / "shipped"
SCENES = ROOT / "fixtures" / "scenes"
REFERENCE_SEED = 99

# Samples of the reference, where 1024 are too few or more than it takes. Its halves tell what noise is left.
REFERENCE = {
    "door_ajar": 4096,
    "fog_shaft": 2048,
    "glass_caustics": 2048,
    "foliage": 512,
    "motion_blur": 512,
    "teapot_diffuse": 512,
    "teapot_specular": 512,
}

# The same where results of 1024 samples are measured, which are nearer to the truth than those references.
FINE_REFERENCE = {
    "fog_shaft": 16384,
    "glass_caustics": 8192,
    "cornell_box": 4096,
    "door_ajar": 4096,
    "frosted_glass": 4096,
    "glossy_gallery": 4096,
    "lens_table": 4096,
}


def names():
    return sorted(path.stem for path in SCENES.glob("*.json"))


def build():
    subprocess.run(["cargo", "build", "--release", "--bins"], cwd=ROOT, check=True)


def program(name, *arguments):
    """Runs one of the programs; the processor seconds that it took."""
    process = subprocess.Popen([ROOT / "target" / "release" / name, *map(str, arguments)], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{name} {' '.join(map(str, arguments))}: exit code {process.returncode}")
    return usage.ru_utime + usage.ru_stime


class Scene:
    """A scene at `scale` times its resolution, and the folder of its renders."""

    def __init__(self, name, scale):
        self.name, self.folder = name, WORK / f"{scale:g}" / name
        self.folder.mkdir(parents=True, exist_ok=True)
        files = self.folder.parent / "scenes"
        if not files.exists():
            shutil.copytree(SCENES, files)
        description = json.loads((SCENES / f"{name}.json").read_text())
        camera = description["camera"]
        camera["resolution"] = [round(scale * size) for size in camera["resolution"]]
        self.file = files / f"{name}.json"
        self.file.write_text(json.dumps(description))

    def reference(self, fine=False):
        samples = FINE_REFERENCE.get(self.name, 2048) if fine else REFERENCE.get(self.name, 1024)
        path = self.folder / f"reference-{samples}.exr"
        if not path.exists():
            program("apr-trace", self.file, path, "--reference", samples, "--seed", REFERENCE_SEED, "--quiet")
        return path

    def render(self, name, *arguments):
        """The render and its processor seconds; none where it was there."""
        path = self.folder / f"{name}.exr"
        seconds = None if path.exists() else program("apr-trace", self.file, path, "--quiet", *arguments)
        return path, seconds

    def sweep(self, renders, variants, *more, fine=False):
        """What `apr-compare sweep` measures of the variants on the renders, as its JSON."""
        list_of_variants = self.folder / "variants.json"
        list_of_variants.write_text(json.dumps(variants))
        out = self.folder / "report"
        common = ["--reference", self.reference(fine), "--out", out, "--variants", list_of_variants]
        program("apr-compare", "sweep", *renders, *common, *more)
        return json.loads((out / "sweep.json").read_text())


def geometric_mean(values):
    return math.exp(sum(map(math.log, values)) / len(values))
