#!/usr/bin/env python3
"""Makes fixtures/scenes: the scene files, the teapot's mesh, the textures and the sky.

Needs the standard library only. What it makes is committed; run it after a change here.
"""

import json
import math
import pathlib
import random
import struct
import zlib

OUT = pathlib.Path(__file__).resolve().parent.parent / "fixtures" / "scenes"

# ------------------------------------------------------------------------------------ the teapot

# Martin Newell's teapot (1975), z up. Body, rim, lid and bottom are turned: cubic profiles of
# radius and height, whose rings Newell drew with this share of the radius as Bézier handle.
RING = 0.56
PROFILES = [
    [(1.4, 2.4), (1.3375, 2.53125), (1.4375, 2.53125), (1.5, 2.4)],
    [(1.5, 2.4), (1.75, 1.875), (2.0, 1.35), (2.0, 0.9)],
    [(2.0, 0.9), (2.0, 0.45), (1.5, 0.225), (1.5, 0.15)],
    [(0.0, 3.15), (0.8, 3.15), (0.0, 2.85), (0.2, 2.7)],
    [(0.2, 2.7), (0.4, 2.55), (1.3, 2.55), (1.3, 2.4)],
    [(1.5, 0.15), (1.5, 0.075), (1.425, 0.0), (0.0, 0.0)],
]
# Handle and spout are tubes: inner (x, z), outer (x, z), half width of each ring.
HANDLE = [
    ((-1.6, 2.025), (-1.5, 2.25), 0.3), ((-2.3, 2.025), (-2.5, 2.25), 0.3),
    ((-2.7, 2.025), (-3.0, 2.25), 0.3), ((-2.7, 1.8), (-3.0, 1.8), 0.3),
    ((-2.7, 1.575), (-3.0, 1.35), 0.3), ((-2.5, 1.125), (-2.65, 0.9375), 0.3),
    ((-2.0, 0.9), (-1.9, 0.6), 0.3),
]
SPOUT = [
    ((1.7, 1.425), (1.7, 0.6), 0.66), ((2.6, 1.425), (3.1, 0.825), 0.66),
    ((2.3, 2.1), (2.4, 2.025), 0.25), ((2.7, 2.4), (3.3, 2.4), 0.25),
    ((2.8, 2.475), (3.525, 2.49375), 0.25), ((2.9, 2.475), (3.45, 2.5125), 0.15),
    ((2.8, 2.4), (3.2, 2.4), 0.15),
]
SEGMENTS = 7  # per patch and direction


def patches():
    """The 32 patches as 4 x 4 control points; crossing the rows' and columns' direction points out."""
    for profile in PROFILES:
        for quarter in range(4):
            c, s = [(1, 0), (0, 1), (-1, 0), (0, -1)][quarter]
            ring = [(1.0, 0.0), (1.0, RING), (RING, 1.0), (0.0, 1.0)]
            yield [[(r * (c * x - s * y), r * (s * x + c * y), z) for x, y in ring] for r, z in profile]
    for tube, turn in ((HANDLE, -1), (SPOUT, 1)):
        for rows in (tube[:4], tube[3:]):
            for side in (1, -1):
                patch = []
                for (xi, zi), (xo, zo), w in rows:
                    ring = [(xi, 0, zi), (xi, side * w, zi), (xo, side * w, zo), (xo, 0, zo)]
                    patch.append(ring if side * turn > 0 else ring[::-1])
                yield [row[::-1] for row in patch]


def bezier(points, t):
    """Point and derivative of a cubic with the four `points`."""
    u = 1 - t
    b = (u * u * u, 3 * u * u * t, 3 * u * t * t, t * t * t)
    d = (-3 * u * u, 3 * u * u - 6 * u * t, 6 * u * t - 3 * t * t, 3 * t * t)
    return (tuple(sum(w * p[i] for w, p in zip(b, points)) for i in range(3)),
            tuple(sum(w * p[i] for w, p in zip(d, points)) for i in range(3)))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def surface(patch, s, t):
    """Point and unit normal; where the surface comes to a point, the normal beside it."""
    rows = [bezier(row, t) for row in patch]
    point, along = bezier([p for p, _ in rows], s)
    across = bezier([d for _, d in rows], s)[0]
    normal = cross(along, across)
    length = math.sqrt(sum(n * n for n in normal))
    if length < 1e-6:
        inward = s + (1e-3 if s < 0.5 else -1e-3)
        return point, surface(patch, inward, t)[1]
    return point, tuple(n / length for n in normal)


def write_teapot(path):
    lines = ["# Martin Newell's teapot, y up, made by scripts/make_scenes.py"]
    faces = []
    vertices = 0
    for patch in patches():
        for i in range(SEGMENTS + 1):
            for j in range(SEGMENTS + 1):
                (x, y, z), (nx, ny, nz) = surface(patch, i / SEGMENTS, j / SEGMENTS)
                lines.append(f"v {x:.5g} {z:.5g} {-y:.5g}")
                lines.append(f"vn {nx:.4f} {nz:.4f} {-ny:.4f}")
        for i in range(SEGMENTS):
            for j in range(SEGMENTS):
                a = vertices + i * (SEGMENTS + 1) + j + 1
                b, c, d = a + 1, a + SEGMENTS + 2, a + SEGMENTS + 1
                faces += [f"f {a}//{a} {d}//{d} {c}//{c}", f"f {a}//{a} {c}//{c} {b}//{b}"]
        vertices += (SEGMENTS + 1) ** 2
    path.write_text("\n".join(lines + faces) + "\n")


# ------------------------------------------------------------------------------------ pictures

def write_png(path, width, height, pixel):
    rows = b"".join(b"\0" + bytes(c for x in range(width) for c in pixel(x, y)) for y in range(height))

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows, 9))
                     + chunk(b"IEND", b""))


def write_hdr(path, width, height, radiance):
    """Radiance's RGBE format, without run lengths."""
    data = bytearray(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width))
    for y in range(height):
        for x in range(width):
            rgb = radiance((x + 0.5) / width, (y + 0.5) / height)
            exponent = math.frexp(max(rgb))[1]
            data += bytes(min(255, int(c * 256 / 2 ** exponent)) for c in rgb) + bytes([exponent + 128])
    path.write_bytes(data)


def bricks(x, y):
    row, column = y // 16, (x + 16 * (y // 16 % 2)) // 32
    if y % 16 < 2 or (x + 16 * (row % 2)) % 32 < 2:
        return 190, 185, 175
    shade = random.Random(row * 7 + column % 4 * 13).uniform(0.8, 1.1)
    grain = random.Random(x * 131 + y * 7919).uniform(0.93, 1.07)
    return tuple(min(255, int(c * shade * grain)) for c in (150, 75, 55))


def painting(x, y):
    rings = 0.5 + 0.5 * math.sin(0.55 * math.hypot(x - 40, y - 28))
    stripes = 0.5 + 0.5 * math.sin(0.35 * x + 0.2 * y)
    return int(40 + 200 * rings), int(50 + 150 * stripes), int(60 + 160 * (1 - rings) * stripes)


def sky(u, v):
    """A clear sky with a veiled sun over a brown ground."""
    if v > 0.5:
        return 0.10, 0.08, 0.06
    theta, phi = math.pi * v, 2 * math.pi * u
    d = (math.sin(phi) * math.sin(theta), math.cos(theta), -math.cos(phi) * math.sin(theta))
    sun = (0.48, 0.64, 0.6)
    glow = max(0.0, sum(a * b for a, b in zip(d, sun)))
    veil = 40.0 * glow ** 256 + 0.6 * glow ** 8
    blue = 0.35 + 0.5 * (v / 0.5)
    return 0.55 * blue + veil, 0.75 * blue + 0.9 * veil, 1.1 * blue + 0.7 * veil


# ------------------------------------------------------------------------------------ scene parts

def rotate(axis, angle):
    return {"rotate": {"axis": axis, "angle": angle}}


def shape(kind, material, *transform, **more):
    result = {"type": kind, **({"material": material} if material else {})}
    if transform:
        result["transform"] = list(transform)
    return result | more


def floor(material, half, y=0.0, center=(0, 0)):
    return shape("rectangle", material, rotate([1, 0, 0], -90), {"scale": [half, 1, half]},
                 {"translate": [center[0], y, center[1]]})


def ceiling(material, half_x, half_z, y, center=(0, 0), **more):
    return shape("rectangle", material, rotate([1, 0, 0], 90), {"scale": [half_x, 1, half_z]},
                 {"translate": [center[0], y, center[1]]}, **more)


def wall(material, half_x, half_y, center, turn=0, **more):
    """An upright rectangle that faces +z, turned about the y axis."""
    return shape("rectangle", material, {"scale": [half_x, half_y, 1]}, rotate([0, 1, 0], turn),
                 {"translate": list(center)}, **more)


def box(material, half, center, turn=0, **more):
    return shape("cube", material, {"scale": list(half)}, rotate([0, 1, 0], turn),
                 {"translate": list(center)}, **more)


def sphere(material, center, radius, **more):
    return {"type": "sphere", **({"material": material} if material else {}), "center": list(center),
            "radius": radius} | more


def teapot(material, scale, position, turn=0, **more):
    return shape("mesh", material, {"scale": scale}, rotate([0, 1, 0], turn), {"translate": list(position)},
                 file="teapot.obj") | more


def diffuse(*rgb):
    return {"type": "diffuse", "reflectance": list(rgb) if len(rgb) > 1 else rgb[0]}


def view(origin, target, fov, size=(256, 192), **more):
    return {"origin": list(origin), "target": list(target), "fov": fov, "resolution": list(size)} | more


GRAY = {"gray": diffuse(0.6)}


# ------------------------------------------------------------------------------------ the scenes

def cornell_box():
    white, light = "white", [18.4, 15.6, 8.0]
    return {
        "camera": view((0, 0, 3.9), (0, 0, 0), 39.3, (192, 192)),
        "materials": {"white": diffuse(0.885, 0.698, 0.667), "green": diffuse(0.105, 0.378, 0.076),
                      "red": diffuse(0.57, 0.043, 0.044)},
        "shapes": [
            ceiling(white, 0.235, 0.19, 0.99, (0, 0.01), emission=light),
            floor(white, 1, -1), ceiling(white, 1, 1, 1), wall(white, 1, 1, (0, 0, -1)),
            wall("green", 1, 1, (1, 0, 0), -90), wall("red", 1, 1, (-1, 0, 0), 90),
            box(white, (0.3, 0.3, 0.3), (0.335, -0.7, 0.38), -17),
            box(white, (0.3, 0.61, 0.3), (-0.33, -0.4, -0.28), 18.25),
        ],
    }


def teapot_scene(material, floor_material):
    return {
        "camera": view((0.3, 3.6, 8.2), (0.1, 1.35, 0), 44),
        "materials": {"pot": material, "floor": floor_material, "wall": diffuse(0.5, 0.55, 0.6)},
        "shapes": [
            teapot("pot", 1.0, (0, 0, 0), -25),
            floor("floor", 8), wall("wall", 8, 4, (0, 4, -5)),
            ceiling(None, 1.2, 1.2, 6.0, (-2, 2), emission=[16, 15, 13]),
        ],
        "environment": {"type": "constant", "radiance": [0.25, 0.3, 0.4]},
    }


def teapot_diffuse():
    return teapot_scene(diffuse(0.75, 0.35, 0.25), diffuse(0.55, 0.5, 0.45))


def teapot_specular():
    checker = {"type": "checker", "color0": [0.2, 0.2, 0.25], "color1": [0.7, 0.7, 0.65], "scale": [12, 12]}
    return teapot_scene({"type": "conductor", "metal": "copper", "roughness": 0.12},
                        {"type": "diffuse", "reflectance": checker})


def textured_room():
    tiles = {"type": "checker", "color0": [0.15, 0.12, 0.1], "color1": [0.8, 0.75, 0.65], "scale": [8, 8]}
    return {
        "camera": view((-1.2, 1.7, 3.6), (0.2, 1.1, -1), 62),
        "materials": {
            "tiles": {"type": "diffuse", "reflectance": tiles},
            "bricks": {"type": "diffuse", "reflectance": {"type": "bitmap", "file": "bricks.png", "scale": [2, -1.5]}},
            "painting": {"type": "diffuse", "reflectance": {"type": "bitmap", "file": "painting.png", "scale": [1, -1]}},
            "plaster": diffuse(0.75), "wood": diffuse(0.4, 0.25, 0.12),
        },
        "shapes": [
            floor("tiles", 3), ceiling("plaster", 3, 3, 3), wall("bricks", 3, 1.5, (0, 1.5, -3)),
            wall("plaster", 4, 1.5, (3, 1.5, 0), -90), wall("plaster", 4, 1.5, (-3, 1.5, 0), 90),
            wall("plaster", 3, 1.5, (0, 1.5, 4), 180),
            wall("painting", 0.8, 0.55, (0.3, 1.7, -2.98)),
            box("wood", (0.7, 0.05, 0.5), (1.0, 0.75, -0.8), 20), box("wood", (0.06, 0.35, 0.06), (1.0, 0.35, -0.8)),
            sphere("painting", (1.1, 1.05, -0.8), 0.25),
            wall(None, 0.9, 0.6, (-2.97, 1.7, -0.5), 90, emission=[12, 12.5, 14]),
        ],
    }


def glossy_gallery():
    panels = []
    materials = {"floor": {"type": "plastic", "reflectance": [0.25, 0.2, 0.18]}, "wall": diffuse(0.7, 0.68, 0.62),
                 "mirror": {"type": "conductor", "metal": "silver"}, "red": {"type": "plastic", "reflectance": [0.6, 0.1, 0.08]},
                 "blue": diffuse(0.1, 0.2, 0.6)}
    for i, (metal, roughness) in enumerate([("gold", 0.05), ("silver", 0.15), ("copper", 0.3), ("aluminium", 0.08)]):
        materials[f"panel{i}"] = {"type": "conductor", "metal": metal, "roughness": roughness}
        panels.append(box(f"panel{i}", (0.42, 0.7, 0.04), (-1.65 + 1.1 * i, 0.9, -1.6), 12 - 8 * i))
    return {
        "camera": view((0.4, 1.5, 3.8), (0, 0.9, -1), 52),
        "materials": materials,
        "shapes": [
            floor("floor", 4), ceiling("wall", 4, 4, 3), wall("wall", 4, 1.5, (0, 1.5, -3)),
            wall("mirror", 4, 1.5, (-3, 1.5, 0), 90), wall("wall", 4, 1.5, (3, 1.5, 0), -90),
            wall("wall", 4, 1.5, (0, 1.5, 4), 180), *panels,
            sphere("red", (-0.7, 0.35, 0.1), 0.35), sphere("panel0", (0.3, 0.3, 0.5), 0.3),
            sphere("blue", (1.15, 0.4, -0.1), 0.4),
            ceiling(None, 0.9, 0.25, 2.98, (0, -0.8), emission=[14, 13, 12]),
            ceiling(None, 0.25, 0.8, 2.98, (1.8, 1.0), emission=[7, 8, 10]),
        ],
    }


def glass_caustics():
    return {
        "camera": view((0, 2.0, 4.6), (0, 0.55, 0), 40),
        "integrator": {"max_depth": 12},
        "materials": {"floor": diffuse(0.6, 0.55, 0.5), "back": diffuse(0.3, 0.4, 0.5), "glass": {"type": "dielectric"},
                      "water": {"type": "dielectric", "eta": 1.33}},
        "shapes": [
            floor("floor", 4), wall("back", 4, 2, (0, 2, -2.5)),
            sphere("glass", (-0.85, 0.6, 0.0), 0.6), box("glass", (0.3, 0.45, 0.3), (0.45, 0.4501, -0.3), 30),
            sphere("water", (1.25, 0.35, 0.6), 0.35),
            sphere(None, (1.6, 3.4, 1.8), 0.22, emission=[130, 120, 100]),
        ],
        "environment": {"type": "constant", "radiance": [0.05, 0.06, 0.08]},
    }


def lens_table():
    rng = random.Random(5)
    lamps = [sphere(None, (rng.uniform(-3, 3), rng.uniform(0.6, 2.8), rng.uniform(-6, -3.5)), 0.06,
                    emission=[rng.uniform(30, 120), rng.uniform(30, 90), rng.uniform(15, 90)]) for _ in range(14)]
    return {
        "camera": view((0, 1.3, 3.4), (0, 0.5, 0), 42, aperture_radius=0.09, focus_distance=3.5),
        "materials": {"table": diffuse(0.45, 0.28, 0.16), "wall": diffuse(0.25), "clay": diffuse(0.7, 0.4, 0.3),
                      "steel": {"type": "conductor", "metal": "aluminium", "roughness": 0.1},
                      "green": {"type": "plastic", "reflectance": [0.1, 0.45, 0.15]}},
        "shapes": [
            floor("table", 3), wall("wall", 6, 3, (0, 3, -7)), teapot("clay", 0.28, (-0.1, 0, 0.1), 20),
            sphere("steel", (1.2, 0.4, -1.2), 0.4), sphere("green", (-1.2, 0.3, -0.9), 0.3),
            sphere("green", (0.75, 0.15, 1.3), 0.15), box("clay", (0.2, 0.2, 0.2), (-1.0, 0.2, 1.2), 25), *lamps,
            ceiling(None, 1.5, 1.0, 4.0, (0, 1), emission=[2.2, 2.2, 2.4]),
        ],
    }


def motion_blur():
    return {
        "camera": view((0, 1.7, 5.6), (0, 0.75, 0), 44),
        "materials": {"floor": {"type": "diffuse", "reflectance": {"type": "checker", "color0": 0.25, "color1": 0.65, "scale": [10, 10]}},
                      "orange": diffuse(0.8, 0.4, 0.1), "blue": diffuse(0.15, 0.25, 0.7), "pot": diffuse(0.6, 0.6, 0.55)},
        "shapes": [
            floor("floor", 5), teapot("pot", 0.35, (0, 0, -0.4), -30),
            sphere("orange", (0, 0, 0), 0.4) | {"transform": [{"translate": [-1.9, 0.9, 0.3]}], "motion": [{"translate": [-1.2, 1.3, 0.3]}]},
            shape("cube", "blue", {"scale": 0.35}, {"translate": [1.5, 0.6, 0.2]},
                  motion=[{"scale": 0.35}, rotate([0, 1, 0.3], 40), {"translate": [1.6, 0.75, 0.2]}]),
            ceiling(None, 1.0, 1.0, 4.5, (1, 2), emission=[14, 14, 13]),
        ],
        "environment": {"type": "constant", "radiance": [0.3, 0.33, 0.4]},
    }


def fog_shaft():
    return {
        "camera": view((0, 1.4, 4.4), (0, 1.1, -1), 48),
        "integrator": {"max_depth": 10},
        "materials": GRAY | {"dark": diffuse(0.25, 0.22, 0.2), "pillar": diffuse(0.5, 0.45, 0.35)},
        "shapes": [
            floor("dark", 3), ceiling("gray", 3, 4, 3), wall("gray", 3, 1.5, (0, 1.5, -3)),
            wall("gray", 4, 1.5, (-3, 1.5, 0), 90), wall("gray", 4, 1.5, (3, 1.5, 0), -90),
            box("pillar", (0.25, 1.2, 0.25), (-0.9, 1.2, -1.0), 15), sphere("pillar", (0.9, 0.45, -0.6), 0.45),
        ],
        "lights": [{"type": "spot", "position": [2.6, 2.8, -1.6], "target": [-0.8, 0.3, -0.4], "intensity": [60, 54, 42],
                    "cutoff_angle": 14, "beam_angle": 10}],
        "medium": {"extinction": 0.16, "albedo": 0.9, "anisotropy": 0.4,
                   "bounds": {"min": [-2.999, 0.001, -2.999], "max": [2.999, 2.999, 3.5]}},
    }


def door_ajar():
    return {
        "camera": view((-1.6, 1.5, 3.2), (0.3, 1.0, -0.6), 62),
        "integrator": {"max_depth": 16, "roulette_depth": 8},
        "materials": {"wall": diffuse(0.8, 0.77, 0.7), "floor": diffuse(0.5, 0.4, 0.3), "door": diffuse(0.35, 0.2, 0.1),
                      "clay": diffuse(0.6, 0.3, 0.25), "metal": {"type": "conductor", "metal": "silver", "roughness": 0.2}},
        "shapes": [
            floor("floor", 4.5), ceiling("wall", 4.5, 4.5, 2.8), wall("wall", 4.5, 1.4, (0, 1.4, -4.5)),
            wall("wall", 4.5, 1.4, (0, 1.4, 4.5), 180), wall("wall", 4.5, 1.4, (-3, 1.4, 0), 90), wall("wall", 4.5, 1.4, (4.5, 1.4, 0), -90),
            # The wall between the rooms, with a door of 1.0 x 2.1 that stands ajar.
            box("wall", (0.08, 1.4, 1.75), (1.6, 1.4, -2.75)), box("wall", (0.08, 1.4, 2.25), (1.6, 1.4, 2.25)),
            box("wall", (0.08, 0.35, 0.5), (1.6, 2.45, -0.5)),
            box("door", (0.5, 1.05, 0.03), (1.25, 1.05, -0.62), 62),
            teapot("clay", 0.22, (0.1, 0.55, -0.6), 30), box("door", (0.6, 0.27, 0.5), (0.1, 0.275, -0.6), 10),
            sphere("metal", (-0.9, 0.4, -0.9), 0.4),
            ceiling(None, 0.8, 0.8, 2.79, (3.1, -0.6), emission=[60, 56, 48]),
        ],
    }


def hundred_lights():
    rng = random.Random(9)
    lights = []
    for i in range(100):
        x, z = i % 10 - 4.5, i // 10 - 6.5
        color = [rng.uniform(4, 30), rng.uniform(4, 24), rng.uniform(2, 26)]
        lights.append(sphere(None, (0.62 * x + rng.uniform(-0.2, 0.2), rng.uniform(0.25, 1.6), 0.7 * z + 2.2), 0.04, emission=color))
    blocks = [box("gray", (rng.uniform(0.12, 0.3), h, rng.uniform(0.12, 0.3)), (rng.uniform(-2.6, 2.6), h, rng.uniform(-2.6, 1.4)),
                  rng.uniform(0, 90)) for h in [rng.uniform(0.1, 0.6) for _ in range(14)]]
    return {
        "camera": view((0, 2.1, 4.4), (0, 0.5, -0.3), 50),
        "materials": GRAY | {"floor": {"type": "plastic", "reflectance": 0.35}},
        "shapes": [floor("floor", 4), *blocks, *lights],
    }


def foliage():
    rng = random.Random(3)
    leaves = [shape("disk" if i % 4 else "rectangle", "leaf" if i % 3 else "young", {"scale": [0.05, 0.11, 1]},
                    rotate([1, 0, 0], rng.uniform(-80, 80)), rotate([0, 1, 0], rng.uniform(0, 360)),
                    {"translate": [rng.gauss(0, 0.25), rng.uniform(0.1, 1.1), rng.gauss(0, 0.25)]}) for i in range(160)]
    bush = [box("bark", (0.02, 0.5, 0.02), (0, 0.5, 0)), *leaves]
    places = [{"type": "instance", "of": "bush", "transform": [
        {"scale": rng.uniform(0.7, 1.2)}, rotate([0, 1, 0], rng.uniform(0, 360)),
        {"translate": [-2.2 + 1.1 * (i % 5) + rng.uniform(-0.3, 0.3), 0, -2.4 + 1.2 * (i // 5) + rng.uniform(-0.3, 0.3)]}]}
        for i in range(15)]
    return {
        "camera": view((0, 1.5, 4.2), (0, 0.7, 0), 45),
        "materials": {"leaf": diffuse(0.12, 0.35, 0.06), "young": diffuse(0.35, 0.5, 0.1), "bark": diffuse(0.25, 0.17, 0.1),
                      "ground": diffuse(0.3, 0.22, 0.14)},
        "groups": {"bush": bush},
        "shapes": [floor("ground", 6), *places],
        "environment": {"type": "map", "file": "sky.hdr", "scale": 1.0},
    }


def frosted_glass():
    checker = {"type": "checker", "color0": [0.1, 0.3, 0.5], "color1": [0.8, 0.8, 0.75], "scale": [10, 10]}
    return {
        "camera": view((0, 1.3, 4.2), (0, 0.6, 0), 40, filter="tent"),
        "integrator": {"max_depth": 12},
        "materials": {"floor": {"type": "diffuse", "reflectance": checker},
                      "frosted": {"type": "dielectric", "roughness": 0.2}, "satin": {"type": "dielectric", "roughness": 0.08},
                      "coat": {"type": "plastic", "reflectance": [0.7, 0.2, 0.1]}, "gray": diffuse(0.5)},
        "shapes": [floor("floor", 4), wall("gray", 4, 2, (0, 2, -3)), sphere("frosted", (-0.8, 0.6, 0), 0.6),
                   box("satin", (0.35, 0.5, 0.1), (0.5, 0.501, 0.5), -25), sphere("coat", (0.9, 0.45, -0.8), 0.45)],
        "lights": [{"type": "directional", "direction": [-0.5, -1, -0.6], "irradiance": [2.0, 1.9, 1.7]},
                   {"type": "point", "position": [2, 2, 2], "intensity": [4, 4, 5]}],
        "environment": {"type": "constant", "radiance": [0.35, 0.4, 0.5]},
    }


SCENES = [cornell_box, teapot_diffuse, teapot_specular, textured_room, glossy_gallery, glass_caustics, lens_table,
          motion_blur, fog_shaft, door_ajar, hundred_lights, foliage, frosted_glass]


def text(scene):
    """JSON with one line for each shape, material and the like."""
    def member(key, value):
        if isinstance(value, list) and value and isinstance(value[0], dict):
            return f'"{key}": [\n    ' + ",\n    ".join(json.dumps(v) for v in value) + "\n  ]"
        if key in ("materials", "groups"):
            inner = ",\n    ".join(member(k, v) for k, v in value.items())
            return f'"{key}": {{\n    {inner}\n  }}'
        return f'"{key}": {json.dumps(value)}'

    def rounded(value):
        if isinstance(value, float):
            return round(value, 4)
        if isinstance(value, list):
            return [rounded(v) for v in value]
        return {k: rounded(v) for k, v in value.items()} if isinstance(value, dict) else value

    return "{\n  " + ",\n  ".join(member(k, v) for k, v in rounded(scene).items()) + "\n}\n"


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    write_teapot(OUT / "teapot.obj")
    write_png(OUT / "bricks.png", 128, 96, bricks)
    write_png(OUT / "painting.png", 80, 56, painting)
    write_hdr(OUT / "sky.hdr", 128, 64, sky)
    for scene in SCENES:
        (OUT / f"{scene.__name__}.json").write_text(text(scene()))


if __name__ == "__main__":
    main()
