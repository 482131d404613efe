"""The examples run for real where their renderers are installed."""

import pathlib
import subprocess
import sys

import numpy as np
import pytest

import apr

EXAMPLES = pathlib.Path(__file__).resolve().parents[1] / "examples"


def run(name, *arguments):
    done = subprocess.run([sys.executable, EXAMPLES / name, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_mitsuba_render_is_denoised_in_memory(tmp_path):
    pytest.importorskip("mitsuba", reason="mitsuba is not installed: pip install mitsuba")
    said = run("mitsuba_in_memory.py", tmp_path)
    noisy, denoised, truth = (apr.read_exr(tmp_path / f"{n}.exr")["color"] for n in ("noisy", "denoised", "reference"))
    error = lambda picture: (np.square(picture - truth) / (np.square(truth) + 0.01)).mean()
    assert error(denoised) < 0.3 * error(noisy), said


def test_blender_renders_twice_and_gets_its_own_file_back(tmp_path):
    pytest.importorskip("bpy", reason="bpy is not installed: pip install 'bpy==4.5.*' with Python 3.11")
    output = tmp_path / "out.exr"
    said = run("blender_two_seeds.py", output)
    layout = apr.inspect_exr(output, aovs=["auto"])
    assert layout["renderer"] == "cycles", said
    assert sorted(layout["sums"][0]["layers"]) == ["ViewLayer.Combined_fill", "ViewLayer.Combined_key"]
    assert layout["sums"][0]["before"]["relative_rms"] < 1e-5, said  # of the denoised file
    color = apr.read_exr(output)["color"]
    assert np.isfinite(color).all() and color.mean() > 0.01
