#!/usr/bin/env python3
"""The fixtures that Blender's Cycles writes: fixtures_blender.py FOLDER. Run by make_fixtures.py.

A small room with two lights, each in a light group of its own. `room_seed1.exr` and
`room_seed2.exr` are two independent renders with the passes that compositors ask for: `Combined` is
denoised by Blender, `Noisy Image` is what Cycles rendered. `room_ref.exr` has many samples.
"""

import math
import pathlib
import sys

import bpy

WIDTH, HEIGHT, SPP, REFERENCE_SPP = 96, 72, 16, 4096


def material(name, color, roughness=1.0, metallic=0.0):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    surface = made.node_tree.nodes["Principled BSDF"]
    surface.inputs["Base Color"].default_value = (*color, 1)
    surface.inputs["Roughness"].default_value = roughness
    surface.inputs["Metallic"].default_value = metallic
    return made


def checkered(made, a, b, scale):
    nodes, links = made.node_tree.nodes, made.node_tree.links
    board = nodes.new("ShaderNodeTexChecker")
    board.inputs["Color1"].default_value = (*a, 1)
    board.inputs["Color2"].default_value = (*b, 1)
    board.inputs["Scale"].default_value = scale
    place = nodes.new("ShaderNodeTexCoord")
    links.new(place.outputs["Generated"], board.inputs["Vector"])
    links.new(board.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
    return made


def add(name, made, operator, **where):
    operator(**where)
    thing = bpy.context.object
    thing.name = name
    thing.data.materials.append(made)
    for face in thing.data.polygons:
        face.use_smooth = operator is bpy.ops.mesh.primitive_uv_sphere_add
    return thing


def lamp(name, energy, color, size, location, target):
    data = bpy.data.lights.new(name, "AREA")
    data.energy, data.color, data.size = energy, color, size
    made = bpy.data.objects.new(name, data)
    made.location = location
    toward = [t - l for t, l in zip(target, location)]
    made.rotation_euler = (
        math.atan2(math.hypot(toward[0], toward[1]), -toward[2]),
        0,
        math.atan2(toward[1], toward[0]) - math.pi / 2,
    )
    made.lightgroup = name
    bpy.context.collection.objects.link(made)


def room():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    plane, cube, ball = (getattr(bpy.ops.mesh, f"primitive_{kind}_add") for kind in ("plane", "cube", "uv_sphere"))
    tiles = checkered(material("tiles", (1, 1, 1), 0.4), (0.7, 0.68, 0.62), (0.12, 0.13, 0.16), 10)
    add("floor", tiles, plane, size=6)
    add("wall", material("plaster", (0.7, 0.66, 0.6)), plane, size=6, location=(0, 2, 2), rotation=(math.pi / 2, 0, 0))
    add("ball", material("paint", (0.6, 0.08, 0.06), 0.3), ball, radius=0.6, location=(-0.8, 0.3, 0.6))
    add("metal", material("brass", (0.9, 0.7, 0.3), 0.15, 1.0), ball, radius=0.45, location=(0.5, -0.3, 0.45))
    add("box", material("wood", (0.35, 0.2, 0.1)), cube, size=0.9, location=(1.5, 0.9, 0.45), rotation=(0, 0, 0.5))
    lamp("key", 120, (1.0, 0.85, 0.7), 0.8, (-2.2, -2.0, 3.2), (0, 0, 0.5))
    lamp("rim", 60, (0.6, 0.75, 1.0), 0.3, (2.6, -0.5, 2.4), (0, 0, 0.5))
    bpy.ops.object.camera_add(location=(0.2, -4.6, 1.7), rotation=(math.radians(76), 0, math.radians(2)))
    bpy.context.scene.camera = bpy.context.object


def settings():
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.cycles.device = "CPU"
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.pixel_filter_type = "BOX"  # denoisers need pixels whose noise is independent
    scene.cycles.filter_width = 1.0
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.image_settings.color_depth = "16"
    scene.render.image_settings.exr_codec = "ZIP"
    return scene


def passes(scene):
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_position = True
    layer.use_pass_diffuse_color = layer.use_pass_cryptomatte_object = True
    layer.pass_cryptomatte_depth = 2
    layer.cycles.denoising_store_passes = True
    for group in ("key", "rim"):
        layer.lightgroups.add(name=group)


def render(scene, path, spp, seed, denoise):
    scene.cycles.samples, scene.cycles.seed, scene.cycles.use_denoising = spp, seed, denoise
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def main():
    folder = pathlib.Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    room()
    scene = settings()
    render(scene, folder / "room_ref.exr", REFERENCE_SPP, 77, denoise=False)
    passes(scene)
    for seed in (1, 2):
        render(scene, folder / f"room_seed{seed}.exr", SPP, seed, denoise=True)


main()
