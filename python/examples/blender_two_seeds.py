#!/usr/bin/env python3
"""Renders with Blender twice, denoises, and writes multilayer EXR: blender_two_seeds.py OUTPUT.exr [SCENE.blend]

Needs `pip install bpy==4.5.*` (Python 3.11). Cycles exports no variance, so the frame is rendered with two
seeds of half the samples each: their difference tells the noise. The result is Blender's own file with the
beauty and the light groups denoised, which still sum to it; cryptomatte, depth and the rest are untouched.
Without SCENE.blend a small room with two light groups is rendered.
"""

import pathlib
import sys
import tempfile

import bpy

import apr

SPP = 32  # of both renders together
SIZE = 160, 120


def room():
    """A floor, a ball and two lamps, each lamp a light group of its own."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add = bpy.ops.mesh
    for operator, where, color in (
        (add.primitive_plane_add, {"size": 8}, (0.6, 0.6, 0.55)),
        (add.primitive_plane_add, {"size": 8, "location": (0, 2, 2), "rotation": (1.5708, 0, 0)}, (0.3, 0.5, 0.7)),
        (add.primitive_uv_sphere_add, {"radius": 0.7, "location": (0, 0, 0.7)}, (0.7, 0.15, 0.1)),
    ):
        operator(**where)
        material = bpy.data.materials.new("paint")
        material.use_nodes = True
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*color, 1)
        bpy.context.object.data.materials.append(material)
    for name, energy, x in (("key", 150, -2.5), ("fill", 40, 2.5)):
        lamp = bpy.data.lights.new(name, "AREA")
        lamp.energy, lamp.size = energy, 0.7
        thing = bpy.data.objects.new(name, lamp)
        thing.location, thing.lightgroup = (x, -1, 3), name
        bpy.context.collection.objects.link(thing)
        bpy.context.scene.view_layers[0].lightgroups.add(name=name)
    bpy.ops.object.camera_add(location=(0, -4.5, 1.6), rotation=(1.35, 0, 0))
    bpy.context.scene.camera = bpy.context.object
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = SIZE


def settings(scene):
    """What a denoiser wants: independent pixels, features, 32-bit floats, Blender's own denoiser off."""
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = SPP // 2
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = 1.0
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.image_settings.color_depth = "32"
    for layer in scene.view_layers:
        layer.use_pass_z = True
        layer.cycles.denoising_store_passes = True


def render(scene, path, seed):
    scene.cycles.seed = seed
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return path


def main():
    output = pathlib.Path(sys.argv[1]).resolve()
    if len(sys.argv) > 2:
        bpy.ops.wm.open_mainfile(filepath=sys.argv[2])
    else:
        room()
    scene = bpy.context.scene
    settings(scene)
    with tempfile.TemporaryDirectory() as folder:
        first, second = (render(scene, pathlib.Path(folder) / f"seed{seed}.exr", seed) for seed in (1, 2))
        report = apr.denoise_exr(first, output, half=second, aovs=["auto"], aux=True)
    for sum in report["sums"]:
        print(f"{sum['set']}: {' + '.join(sum['layers'])} less the beauty, relative RMS "
              f"{sum['before']['relative_rms']:.1e} before, {sum['after']['relative_rms']:.1e} after")
    print(f"{output}: {report['layout']['samples_per_pixel'] or SPP:g} samples per pixel")


if __name__ == "__main__":
    main()
