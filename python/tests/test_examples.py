"""The examples run for real where their renderers are installed."""

import pathlib
import subprocess
import sys

import numpy as np
import pytest

import apr

EXAMPLES = pathlib.Path(__file__).resolve().parents[1] / "examples"


def needs(module, remedy):
    """Skips the test where `module` cannot be imported; tried in a process of its own, as renderers dislike company."""
    tried = subprocess.run([sys.executable, "-c", f"import {module}"], capture_output=True, text=True)
    if tried.returncode != 0:
        last = (tried.stderr.strip().splitlines() or [f"import ended with {tried.returncode}"])[-1]
        pytest.skip(f"{last}; {remedy}")


def run(name, *arguments):
    done = subprocess.run([sys.executable, EXAMPLES / name, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_mitsuba_render_is_denoised_in_memory(tmp_path):
    needs("mitsuba", "pip install mitsuba")
    said = run("mitsuba_in_memory.py", tmp_path)
    noisy, denoised, truth = (apr.read_exr(tmp_path / f"{n}.exr")["color"] for n in ("noisy", "denoised", "reference"))
    error = lambda picture: (np.square(picture - truth) / (np.square(truth) + 0.01)).mean()
    assert error(denoised) < 0.3 * error(noisy), said


def test_blender_renders_twice_and_gets_its_own_file_back(tmp_path):
    needs("bpy", "pip install 'bpy==4.5.*' with Python 3.11")
    output = tmp_path / "out.exr"
    said = run("blender_two_seeds.py", output)
    layout = apr.inspect_exr(output, aovs=["auto"])
    assert layout["renderer"] == "cycles", said
    assert sorted(layout["sums"][0]["layers"]) == ["ViewLayer.Combined_fill", "ViewLayer.Combined_key"]
    assert layout["sums"][0]["before"]["relative_rms"] < 1e-5, said  # of the denoised file
    color = apr.read_exr(output)["color"]
    # The wall above the ball is smooth: from pixel to pixel one render differs by 9 %, the result by 1 %.
    wall = color[:30, :, 1]
    assert np.isfinite(color).all() and wall.mean() > 0.1
    assert np.abs(np.diff(wall, axis=1)).mean() < 0.02 * wall.mean(), said
    # Blender takes it for a multilayer file and offers the passes that it wrote.
    passes = subprocess.run([sys.executable, "-c", PASSES, output], capture_output=True, text=True, check=True)
    for name in ("Combined", "Depth", "Combined_fill", "Combined_key", "Denoising Normal"):
        assert f"<{name}>" in passes.stdout, passes.stdout + passes.stderr


PASSES = """
import sys, bpy
image = bpy.data.images.load(sys.argv[1])
bpy.context.scene.use_nodes = True
node = bpy.context.scene.node_tree.nodes.new("CompositorNodeImage")
node.image = image
print(image.type, *(f"<{output.name}>" for output in node.outputs))
"""
