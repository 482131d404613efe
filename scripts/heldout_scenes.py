"""Ten scenes for Mitsuba 3 that nothing was tuned on, each a function that returns the dictionary of `mitsuba.load_dict`.

`SCENES` lists them. Textures and meshes are computed here; every random number has a seed, and drawing one more
or less makes another scene.
"""

import pathlib
import tempfile

import mitsuba as mi
import numpy as np

from mitsuba_scenes import (T, bitmap, block, box_room, camera, checker, diffuse, emission, marble, mesh, metal, path,
                            plastic, quad, rgb, sky, sphere, textured, tiles)

SCRATCH = tempfile.TemporaryDirectory()  # of what Mitsuba reads from files alone; gone when the program ends


# ---------------------------------------------------------------- parts that scenes share


def noise(size=256, seed=1, octaves=6, base=4):
    """Smooth noise over several scales from 0 to 1, which repeats."""
    rng = np.random.default_rng(seed)
    total, amplitude = np.zeros((size, size)), 1.0
    for n in (base * 2**octave for octave in range(octaves)):
        if n > size:
            break
        grid = rng.random((n, n))
        x = np.arange(size) * n / size
        i = x.astype(int)
        j, f = (i + 1) % n, x - i
        f = f * f * (3 - 2 * f)
        row = grid[:, i] * (1 - f) + grid[:, j] * f
        total += amplitude * (row[i] * (1 - f)[:, None] + row[j] * f[:, None])
        amplitude *= 0.5
    return (total - total.min()) / (total.max() - total.min())


def gray(values):
    return np.repeat(values[..., None], 3, 2)


def wood(seed=3):
    """Planks of varied tone with a wavy grain."""
    across = np.linspace(0, 1, 256)[None] * 18 + noise(256, seed, 5, 2) * 4
    planks = (np.arange(256) // 32) % 8
    tone = np.random.default_rng(seed).uniform(0.7, 1.1, 8)[planks][:, None]
    grain = (0.35 + 0.65 * (0.5 + 0.5 * np.sin(across * 6.28))) * tone
    return np.stack([grain * 0.5, grain * 0.3, grain * 0.15], -1)


def key_light(position, u, v, *radiance):
    return quad(position, u, v, diffuse(0.5), emitter=emission(*radiance))


def sunny_sky(strength):
    return {"type": "envmap", "bitmap": mi.Bitmap(sky(strength=strength).astype(np.float32))}


def even_sky(*radiance):
    return {"type": "constant", "radiance": rgb(*radiance)}


# ---------------------------------------------------------------- the scenes


def hair():
    """A head of hair: curves thinner than a pixel."""
    curves = pathlib.Path(SCRATCH.name) / "hair.txt"
    rng = np.random.default_rng(5)
    with curves.open("w") as file:
        for _ in range(1500):
            direction = rng.normal(size=3)
            direction[1] = abs(direction[1]) * 1.2 - 0.2
            direction /= np.linalg.norm(direction)
            point, step = direction * 0.5 + np.array([0, 0.8, 0]), direction * 0.09
            for i in range(7):
                file.write("%g %g %g %g\n" % (*point, 0.006 * (1 - i / 8)))
                point = point + step
                step = step + np.array([rng.normal() * 0.015, -0.022, rng.normal() * 0.015])
            file.write("\n")
    return {
        "type": "scene", "integrator": path(10),
        "sensor": camera((0, 1.2, 3.4), (0, 0.75, 0), 38),
        "sky": even_sky(0.12, 0.15, 0.2),
        "key": key_light((1.6, 2.8, 1.4), (-0.3, 0, 0.25), (0.1, -0.3, 0.1), 26, 22, 17),
        "ground": quad((0, 0, 0), (6, 0, 0), (0, 0, -6), diffuse(0.4, 0.42, 0.45)),
        "head": sphere((0, 0.8, 0), 0.5, diffuse(0.5, 0.35, 0.28)),
        "hair": {"type": "bsplinecurve", "filename": str(curves), "bsdf": plastic((0.25, 0.11, 0.04), 0.2)},
    }


def smoke():
    """A cloud of smoke of uneven density in a coloured room; slow."""
    n, at = 32, np.arange(32)
    z, y, x = np.mgrid[0:n, 0:n, 0:n] / (n - 1.0)
    layers = [(1, 1, (0, 1, 2)), (2, 3, (1, 0, 2)), (3, 5, (2, 1, 0))]
    uneven = sum(
        noise(n, seed, 3, 4)[(at * stride) % n][None].repeat(n, 0).transpose(axes) for seed, stride, axes in layers
    ) / 3
    radius = np.sqrt((x - 0.5) ** 2 + (y - 0.5) ** 2 + (z - 0.5) ** 2)
    density = np.clip(1.5 * (uneven - 0.35) - 2.4 * np.clip(radius - 0.25, 0, 1), 0, 1).astype(np.float32) * 14
    wall = diffuse(0.6, 0.6, 0.62)
    cube = lambda: T().translate([-0.1, 0.95, 0]).scale([0.8, 0.9, 0.8])
    grid = {
        "type": "gridvolume", "data": mi.TensorXf(density[..., None]),
        "to_world": cube().translate([-1, -1, -1]).scale(2.0),
    }
    return {
        "type": "scene", "integrator": {"type": "volpath", "max_depth": 24, "rr_depth": 8},
        "sensor": camera((0, 1.2, 3.6), (0, 1.0, 0), 44),
        **box_room((1.8, 1.25, 4), [diffuse(0.5, 0.2, 0.15), diffuse(0.15, 0.3, 0.5), wall, wall, wall], textured(checker(), 2)),
        "lamp": key_light((0, 2.48, 0.2), (0.35, 0, 0), (0, 0, 0.35), 18, 16, 13),
        "rim": key_light((-1.5, 1.2, -2), (0, 0.4, 0), (0.2, 0, 0.2), 4, 7, 14),
        "ball": sphere((0.9, 0.3, 0.7), 0.3, plastic((0.1, 0.4, 0.2), 0.1)),
        "smoke": {
            "type": "cube", "to_world": cube(), "bsdf": {"type": "null"},
            "interior": {"type": "heterogeneous", "albedo": rgb(0.92, 0.93, 0.95), "scale": 1.0, "sigma_t": grid},
        },
    }


def rough_glass():
    """Frosted spheres and a block before a checkered wall, under a sky with a sun."""
    glass = lambda alpha, ior: {"type": "roughdielectric", "alpha": alpha, "int_ior": ior}
    return {
        "type": "scene", "integrator": path(16),
        "sensor": camera((0, 1.1, 3.6), (0, 0.55, 0), 42),
        "sky": sunny_sky(25.0),
        "ground": quad((0, 0, 0), (8, 0, 0), (0, 0, -8), textured(tiles(count=8, seed=21), 4)),
        "wall": quad((0, 1.2, -1.6), (2.2, 0, 0), (0, 1.2, 0), textured(checker(count=12, dark=(0.1, 0.3, 0.5)), 1)),
        "a": sphere((-0.95, 0.5, 0), 0.5, glass(0.08, 1.5)),
        "b": sphere((0.15, 0.5, 0.1), 0.5, glass(0.3, 1.5)),
        "c": block((1.2, 0.5, 0), (0.32, 0.5, 0.32), glass(0.02, 1.33), 25),
        "d": sphere((0.7, 0.18, 0.9), 0.18, metal("Au", 0.05)),
    }


def mirror_hall():
    """Two mirrors that face each other, and things between them: edges that no feature knows."""
    wall = diffuse(0.6, 0.58, 0.55)
    mirror = {"type": "twosided", "bsdf": {"type": "conductor", "material": "Al"}}
    scene = {
        "type": "scene", "integrator": path(20),
        **box_room((1.4, 1.25, 3.5), [wall, wall, textured(marble(seed=31), 1), wall, wall], textured(wood(), 2)),
        "sensor": camera((0.5, 1.4, 3.0), (-0.2, 0.9, -1), 64),
        "ml": quad((-1.38, 1.25, -0.5), (0, 0, -2), (0, 0.9, 0), mirror),
        "mr": quad((1.38, 1.25, -0.5), (0, 0, 2), (0, 0.9, 0), mirror),
        "lamp": key_light((0, 2.48, -0.5), (0.2, 0, 0), (0, 0, 0.9), 9, 8.2, 7),
    }
    rng = np.random.default_rng(9)
    for i in range(7):
        x, z = rng.uniform(-0.9, 0.9), rng.uniform(-2.6, 1.2)
        radius, color = rng.uniform(0.12, 0.3), tuple(rng.uniform(0.05, 0.7, 3))
        bsdf = [diffuse(*color), plastic(color, 0.12), metal("Cu", 0.2)][i % 3]
        scene[f"o{i}"] = sphere((x, radius, z), radius, bsdf)
    scene["book"] = block((0.4, 0.3, -0.4), (0.2, 0.3, 0.2), textured(checker(count=10, dark=(0.5, 0.1, 0.1)), 1), 30)
    return scene


def bumpy():
    """Bump maps on matt, plastic and gold, and a metal floor of varied roughness."""

    def bumps(seed, bsdf, scale):
        height = bitmap(gray(noise(256, seed, 6, 8)), 3)
        return {"type": "twosided", "bsdf": {"type": "bumpmap", "arbitrary": height, "scale": scale, "bsdf": bsdf}}

    alpha = bitmap(gray(0.03 + 0.4 * noise(256, 41, 5, 4)), 2)
    red = {"type": "roughplastic", "diffuse_reflectance": rgb(0.5, 0.12, 0.08), "alpha": 0.15}
    return {
        "type": "scene", "integrator": path(10),
        "sensor": camera((0, 1.2, 3.4), (0, 0.8, 0), 48),
        "sky": even_sky(0.25, 0.28, 0.33),
        "back": quad((0, 1.5, -1.2), (2.6, 0, 0), (0, 1.5, 0),
                     bumps(51, {"type": "diffuse", "reflectance": bitmap(marble(seed=52), 2)}, 0.12)),
        "floor": quad((0, 0, 0), (2.6, 0, 0), (0, 0, -2.6), metal("Cr", alpha)),
        "key": key_light((-1.4, 2.6, 1.6), (0.3, 0, 0.2), (0.1, 0.3, -0.1), 20, 18, 15),
        "ball": sphere((-0.7, 0.5, 0.1), 0.5, bumps(53, red, 0.08)),
        "gold": sphere((0.65, 0.45, 0.2), 0.45, bumps(54, {"type": "roughconductor", "material": "Au", "alpha": 0.12}, 0.05)),
    }


def night_street():
    """Fifty small lamps and windows over a wet road."""
    rng = np.random.default_rng(77)
    asphalt = bitmap(gray(0.05 + 0.12 * noise(256, 61, 6, 8)), 6)
    road = {"type": "twosided", "bsdf": {"type": "roughplastic", "diffuse_reflectance": asphalt, "alpha": 0.12}}
    scene = {
        "type": "scene", "integrator": path(8),
        "sensor": camera((0, 1.6, 7), (0, 1.5, 0), 55),
        "sky": even_sky(0.006, 0.008, 0.015),
        "road": quad((0, 0, 0), (12, 0, 0), (0, 0, -30), road),
    }
    for i in range(8):
        side, z, height = -1 if i % 2 else 1, 3 - 4 * (i // 2) * 1.4, rng.uniform(1.5, 3.2)
        scene[f"house{i}"] = block((side * 4.2, height, z - 2), (1.6, height, 2.2), diffuse(*rng.uniform(0.2, 0.5, 3)))
        for j in range(5):
            y, along = rng.uniform(0.6, 2 * height - 0.4), z - 2 + rng.uniform(-1.8, 1.8)
            light = emission(*(rng.uniform(0.3, 6) * np.array([1, 0.8, 0.5])))
            scene[f"win{i}_{j}"] = quad((side * 2.58, y, along), (0, 0, 0.22 * side), (0, 0.28, 0), diffuse(0.3), emitter=light)
    for i in range(10):
        side, z = -1 if i % 2 else 1, 4 - 3.2 * (i // 2)
        light = emission(*(220 * rng.uniform(0.6, 1) * np.array([1, 0.75, 0.45])))
        scene[f"lamp{i}"] = sphere((side * 2.1, 2.7, z), 0.06, emitter=light)
        scene[f"pole{i}"] = {"type": "cylinder", "p0": [side * 2.1, 0, z], "p1": [side * 2.1, 2.6, z], "radius": 0.03, "bsdf": diffuse(0.15)}
    scene["car"] = block((0.8, 0.35, 1.5), (0.5, 0.3, 0.9), plastic((0.4, 0.05, 0.05), 0.06), 15)
    return scene


def sponge():
    """A Menger sponge of 8000 cubes in the sun: geometry finer than a pixel."""

    def cells(center, half, depth):
        if depth == 0:
            yield center, half
            return
        for offset in ((x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)):
            if offset.count(0) < 2:
                yield from cells(tuple(c + o * half * 2 / 3 for c, o in zip(center, offset)), half / 3, depth - 1)

    found = list(cells((0, 1.0, 0), 1.0, 3))
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    triangles = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                          [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
    centers, half = np.array([center for center, _ in found]), found[0][1]
    vertices = (centers[:, None, None, :] + half * corners[triangles][None]).reshape(-1, 3)
    faces = np.arange(len(vertices)).reshape(-1, 3)
    return {
        "type": "scene", "integrator": path(10),
        "sensor": camera((2.2, 2.3, 3.4), (0, 0.9, 0), 38),
        "sky": even_sky(0.5, 0.55, 0.65),
        "sun": {"type": "directional", "direction": [-0.5, -0.7, -0.35], "irradiance": rgb(2.6, 2.3, 1.8)},
        "ground": quad((0, 0, 0), (12, 0, 0), (0, 0, -12), diffuse(0.45, 0.42, 0.38)),
        "sponge": mesh(vertices.astype(np.float32), faces.astype(np.uint32), diffuse(0.65, 0.5, 0.3)),
    }


def sun_room():
    """A living room lit by the sun and the sky through two windows."""
    white = diffuse(0.78, 0.76, 0.72)
    room = box_room((2.4, 1.3, 2.8), [white, white, white, white, diffuse(0.8, 0.8, 0.78)], textured(wood(), 3))
    del room["left"]
    cloth = np.stack([level + depth * noise(128, seed, 5, 16) for level, depth, seed in [(0.3, 0.2, 71), (0.12, 0.05, 72), (0.1, 0.05, 73)]], -1)
    scene = {
        "type": "scene", "integrator": path(16), **room,
        "sensor": camera((1.4, 1.4, 2.5), (-0.6, 0.85, -0.6), 66),
        "sky": even_sky(0.9, 1.1, 1.4),
        "sun": {"type": "directional", "direction": [0.75, -0.5, -0.25], "irradiance": rgb(18, 15.5, 12)},
        "sofa": block((0.6, 0.3, -1.9), (0.9, 0.3, 0.45), textured(cloth, 3)),
        "back": block((0.6, 0.7, -2.25), (0.9, 0.25, 0.12), diffuse(0.35, 0.13, 0.11)),
        "table": block((-0.5, 0.42, -0.4), (0.55, 0.03, 0.35), plastic((0.25, 0.13, 0.06), 0.08)),
        "vase": sphere((-0.6, 0.62, -0.4), 0.17, {"type": "dielectric"}),
        "bowl": sphere((-0.2, 0.53, -0.3), 0.08, metal("Cu", 0.1)),
        "pic": quad((0.3, 1.6, -2.78), (0.5, 0, 0), (0, 0.35, 0), textured(tiles(count=8, seed=81), 1)),
        "rug": quad((-0.4, 0.005, 0.3), (1.0, 0, 0), (0, 0, -0.7),
                    textured(checker(count=14, dark=(0.1, 0.15, 0.35), light=(0.6, 0.5, 0.35)), 1)),
    }
    # The left wall in strips around the windows: from and to, in y and in z.
    strips = [(0, 0.8, -2.8, 2.8), (2.1, 2.6, -2.8, 2.8), (0.8, 2.1, -2.8, -1.8), (0.8, 2.1, -0.7, -0.2), (0.8, 2.1, 0.9, 2.8)]
    for i, (y0, y1, z0, z1) in enumerate(strips):
        scene[f"wl{i}"] = block((-2.45, (y0 + y1) / 2, (z0 + z1) / 2), (0.05, (y1 - y0) / 2, (z1 - z0) / 2), white)
    return scene


def softbox_product():
    """Lacquer, brushed metal, cloth and glass between soft boxes."""
    principled = lambda color, **more: {"type": "principled", "base_color": rgb(*color), **more}
    return {
        "type": "scene", "integrator": path(10),
        "sensor": camera((0, 1.0, 3.2), (0, 0.5, 0), 40),
        "sweep": quad((0, 0, 0), (5, 0, 0), (0, 0, -5), diffuse(0.8)),
        "bk": quad((0, 2, -2.5), (5, 0, 0), (0, 2.2, 0), diffuse(0.8)),
        "l": key_light((-2.2, 1.5, 0.8), (0, 0, 0.7), (0, 0.9, 0), 5, 5, 5),
        "r": key_light((2.2, 1.5, 0.8), (0, 0, -0.7), (0, 0.9, 0), 3, 3, 3.2),
        "t": key_light((0, 2.9, 0), (0.9, 0, 0), (0, 0, 0.9), 3, 3, 3),
        "a": sphere((-0.9, 0.4, 0), 0.4, principled((0.7, 0.05, 0.05), roughness=0.3, clearcoat=1.0, clearcoat_gloss=0.95, specular=0.5)),
        "b": sphere((0, 0.45, -0.1), 0.45, principled((0.9, 0.75, 0.4), metallic=1.0, roughness=0.25, anisotropic=0.7)),
        "c": sphere((0.95, 0.4, 0.05), 0.4, principled((0.15, 0.2, 0.5), roughness=0.7, sheen=1.0, sheen_tint=0.5)),
        "d": sphere((0.4, 0.15, 0.75), 0.15, {"type": "dielectric"}),
        "e": block((-0.35, 0.13, 0.8), (0.13, 0.13, 0.13), principled((0.05, 0.05, 0.06), roughness=0.1, specular=0.6), 30),
    }


def masked_leaves():
    """Leaves cut out of rectangles by their opacity."""
    rng = np.random.default_rng(8)
    y, x = np.mgrid[0:128, 0:128] / 64.0 - 1
    leaf = (x**2 / 0.35**2 + y**2 / 0.9**2 < 1).astype(float) * (np.abs(np.sin(y * 9 + np.abs(x) * 6)) > 0.12)
    opacity = bitmap(gray(leaf))
    scene = {
        "type": "scene", "integrator": path(10),
        "sensor": camera((0, 1.0, 3.2), (0, 0.9, 0), 44),
        "sky": sunny_sky(40.0),
        "ground": quad((0, 0, 0), (10, 0, 0), (0, 0, -10), textured(marble(seed=91) * 0.7, 8)),
    }
    for i in range(220):
        center = rng.normal(size=3) * np.array([0.6, 0.4, 0.5]) + np.array([0, 1.05, 0])
        u = rng.normal(size=3)
        u /= np.linalg.norm(u)
        v = np.cross(u, rng.normal(size=3))
        v /= np.linalg.norm(v)
        green = tuple(np.array([0.2, 0.4, 0.08]) * rng.uniform(0.5, 1.3, 3))
        scene[f"leaf{i}"] = quad(center, u * 0.1, v * 0.14, {"type": "mask", "opacity": opacity, "bsdf": diffuse(*green)})
    return scene


SCENES = {f.__name__: f for f in [hair, smoke, rough_glass, mirror_hall, bumpy, night_street, sponge, sun_room, softbox_product, masked_leaves]}
