"""Scenes for Mitsuba 3, each a function that returns the dictionary of `mitsuba.load_dict`.

They are kept apart from the renderer so that every script means the same scene by the same name.
`SCENES` lists them; a scene is self-contained: textures and meshes are computed here.
"""

import math

import mitsuba as mi
import numpy as np

T = mi.ScalarTransform4f if hasattr(mi, "ScalarTransform4f") else None


# ---------------------------------------------------------------- parts that scenes share


def camera(origin, target, fov, kind="perspective", **more):
    to_world = T().look_at(origin=list(origin), target=list(target), up=[0, 1, 0])
    return {"type": kind, "fov": fov, "fov_axis": "x", "to_world": to_world, **more}


def rgb(*value):
    return {"type": "rgb", "value": list(value) if len(value) > 1 else value[0]}


def diffuse(*value):
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": rgb(*value)}}


def metal(material, alpha):
    return {"type": "twosided", "bsdf": {"type": "roughconductor", "material": material, "alpha": alpha}}


def plastic(color, alpha):
    return {"type": "twosided", "bsdf": {"type": "roughplastic", "diffuse_reflectance": rgb(*color), "alpha": alpha}}


def bitmap(pixels, scale=1.0):
    """A repeating texture from an array of linear values, rows × columns × 3."""
    data = mi.TensorXf(np.ascontiguousarray(pixels, np.float32))
    uv = T().scale([scale, scale, 1])
    return {"type": "bitmap", "data": data, "raw": True, "to_uv": uv}


def textured(pixels, scale=1.0):
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": bitmap(pixels, scale)}}


def quad(position, u, v, bsdf, **more):
    """A rectangle about `position` with the half edges `u` and `v`; its normal is u × v."""
    u, v = np.asarray(u, float), np.asarray(v, float)
    n = np.cross(u, v)
    n /= np.linalg.norm(n)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = u, v, n, position
    shape = {"type": "rectangle", "to_world": T(matrix.tolist()), **more}
    return {**shape, "bsdf": bsdf} if bsdf else shape


def sphere(center, radius, bsdf=None, **more):
    shape = {"type": "sphere", "center": list(center), "radius": radius, **more}
    return {**shape, "bsdf": bsdf} if bsdf else shape


def block(center, half, bsdf, turn=0.0):
    to_world = T().translate(list(center)).rotate([0, 1, 0], turn).scale(list(half))
    return {"type": "cube", "to_world": to_world, "bsdf": bsdf}


def emission(*value):
    return {"type": "area", "radiance": rgb(*value)}


def path(depth=12):
    return {"type": "path", "max_depth": depth, "rr_depth": 5}


def box_room(half, walls, floor):
    """Six walls about the origin, the floor at y = 0; `walls` are left, right, back, front, ceiling."""
    x, y, z = half
    left, right, back, front, ceiling = walls
    return {
        "floor": quad((0, 0, 0), (x, 0, 0), (0, 0, -z), floor),
        "ceiling": quad((0, 2 * y, 0), (x, 0, 0), (0, 0, z), ceiling),
        "left": quad((-x, y, 0), (0, 0, -z), (0, y, 0), left),
        "right": quad((x, y, 0), (0, 0, z), (0, y, 0), right),
        "back": quad((0, y, -z), (x, 0, 0), (0, y, 0), back),
        "front": quad((0, y, z), (-x, 0, 0), (0, y, 0), front),
    }


def marble(size=256, seed=1):
    """Soft veins over several scales."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.fftfreq(size)[:, None] ** 2 + np.fft.fftfreq(size)[None] ** 2
    noise = np.fft.ifft2(np.fft.fft2(rng.standard_normal((size, size))) / (spectrum + 1e-4) ** 0.75).real
    vein = np.abs(noise / np.abs(noise).max()) ** 0.4
    return vein[..., None] * np.array([0.75, 0.68, 0.6]) + 0.08


def tiles(size=256, count=8, seed=2):
    """Tiles of varied colour with dark joints and a fine grain."""
    rng = np.random.default_rng(seed)
    cell = size // count
    color = 0.25 + 0.5 * rng.random((count, count, 1)) * np.array([1.0, 0.85, 0.65])
    picture = color.repeat(cell, 0).repeat(cell, 1) * (0.9 + 0.2 * rng.random((size, size, 1)))
    joint = (np.arange(size) % cell) < max(1, cell // 16)
    picture[joint] = 0.06
    picture[:, joint] = 0.06
    return picture


def checker(size=64, count=8, dark=(0.05, 0.05, 0.07), light=(0.8, 0.78, 0.72)):
    board = (np.arange(size) * count // size)[:, None] + (np.arange(size) * count // size)[None]
    return np.where((board % 2 == 0)[..., None], light, dark)


def sky(width=256, sun=(0.62, 0.28), strength=60.0):
    """A clear sky with a broad sun, dull ground below the horizon; latitude–longitude."""
    v, u = np.meshgrid((np.arange(width // 2) + 0.5) / (width // 2), (np.arange(width) + 0.5) / width, indexing="ij")
    up = np.cos(np.pi * v)
    blue = np.where((up > 0)[..., None], np.array([0.35, 0.55, 0.95]) * (0.5 + 0.7 * (1 - up[..., None]).clip(0, 1)), 0.12)
    direction = lambda u, v: np.stack([np.sin(np.pi * v) * np.sin(2 * np.pi * u), np.cos(np.pi * v), -np.sin(np.pi * v) * np.cos(2 * np.pi * u)], -1)
    cosine = direction(u, v) @ direction(*map(np.asarray, sun))
    return blue + strength * np.exp((cosine[..., None] - 1) * 400) * np.array([1, 0.9, 0.75])


def leaves(count, seed, low, high, size):
    """`count` folded leaf blades in the ellipsoid between `low` and `high`, as one mesh."""
    rng = np.random.default_rng(seed)
    low, high = np.asarray(low, float), np.asarray(high, float)
    spot = rng.standard_normal((count, 3))
    spot *= (0.35 + 0.65 * rng.random((count, 1)) ** 0.5) / np.linalg.norm(spot, axis=1, keepdims=True)
    base = (low + high) / 2 + spot * (high - low) / 2
    along, side = rng.standard_normal((2, count, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, side)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    length = size * (0.6 + 0.8 * rng.random((count, 1)))
    fold = np.cross(along, side) * length * 0.08
    corner = [base, base + along * length * 0.5 + side * length * 0.18 + fold, base + along * length,
              base + along * length * 0.5 - side * length * 0.18 + fold]
    vertices = np.stack(corner, 1).reshape(-1, 3)
    first = np.arange(count)[:, None] * 4
    faces = np.concatenate([first + [0, 1, 2], first + [0, 2, 3]], 0)
    return vertices, faces


def mesh(vertices, faces, bsdf):
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict(bsdf)
    made = mi.Mesh("mesh", len(vertices), len(faces), props=properties, has_vertex_normals=False, has_vertex_texcoords=False)
    values = mi.traverse(made)
    values["vertex_positions"] = mi.Float(np.ascontiguousarray(vertices, np.float32).ravel())
    values["faces"] = mi.UInt32(np.ascontiguousarray(faces, np.uint32).ravel())
    values.update()
    return made


# ---------------------------------------------------------------- the scenes


def cornell_glossy():
    """Cornell box whose blocks are rough metal and rough plastic."""
    white = diffuse(0.73, 0.71, 0.68)
    room = box_room((1, 1, 1), [diffuse(0.57, 0.04, 0.04), diffuse(0.1, 0.38, 0.07), white, white, white], white)
    del room["front"]
    return {
        "type": "scene", "integrator": path(), **room,
        "sensor": camera((0, 1, 4.4), (0, 1, 0), 46),
        "light": quad((0, 1.995, 0), (0.3, 0, 0), (0, 0, 0.25), diffuse(0.5), emitter=emission(16, 13, 9)),
        "tall": block((-0.35, 0.6, -0.3), (0.29, 0.6, 0.29), metal("Al", 0.12), 20),
        "short": block((0.36, 0.3, 0.3), (0.29, 0.3, 0.29), plastic((0.1, 0.2, 0.5), 0.1), -18),
    }


def glossy_gallery():
    """Room with a tiled floor, a mirror and rough metals of three roughnesses."""
    wall = diffuse(0.62, 0.6, 0.55)
    scene = {
        "type": "scene", "integrator": path(), **box_room((3, 1.5, 3), [textured(marble(), 1), wall, wall, wall, wall], textured(tiles(), 2)),
        "sensor": camera((0.6, 1.5, 2.8), (-0.2, 0.8, -1), 62),
        "lamp_a": quad((-1.4, 2.98, -0.5), (0.5, 0, 0), (0, 0, 0.15), diffuse(0.5), emitter=emission(14, 12, 10)),
        "lamp_b": quad((1.6, 2.98, 0.2), (0.15, 0, 0), (0, 0, 0.5), diffuse(0.5), emitter=emission(8, 10, 13)),
        "mirror": quad((0.9, 1.4, -2.95), (0.9, 0, 0), (0, 0.8, 0), {"type": "conductor", "material": "Ag"}),
        "vase": sphere((2.1, 0.5, -0.6), 0.5, plastic((0.6, 0.12, 0.08), 0.15)),
    }
    for i, (material, alpha) in enumerate([("Au", 0.05), ("Cu", 0.15), ("Al", 0.3)]):
        x = -1.7 + 1.15 * i
        scene[f"plinth{i}"] = block((x, 0.25, -1.2), (0.32, 0.25, 0.32), textured(marble(seed=5 + i), 1), 12 * i)
        scene[f"metal{i}"] = sphere((x, 0.5 + 0.38, -1.2), 0.38, metal(material, alpha))
    return scene


def bokeh_table():
    """Thin lens over a table; small bright lamps behind it blur into discs."""
    eye, focus = np.array([0, 1.0, 3.0]), np.array([0, 0.25, 0])
    scene = {
        "type": "scene", "integrator": path(8),
        "sensor": camera(eye, focus, 40, "thinlens", aperture_radius=0.09, focus_distance=float(np.linalg.norm(eye - focus))),
        "table": quad((0, 0, 0), (3, 0, 0), (0, 0, -3), textured(tiles(count=16, seed=8), 2)),
        "wall": quad((0, 2, -6), (8, 0, 0), (0, 4, 0), diffuse(0.08, 0.08, 0.12)),
        "sky": {"type": "constant", "radiance": rgb(0.22, 0.24, 0.3)},
        "key": quad((1.8, 2.6, 1.2), (-0.25, 0, 0.2), (0.1, -0.25, 0.1), diffuse(0.5), emitter=emission(22, 19, 15)),
        "ball": sphere((-0.45, 0.25, 0.1), 0.25, plastic((0.55, 0.08, 0.06), 0.08)),
        "steel": sphere((0.25, 0.2, 0.35), 0.2, metal("Cr", 0.1)),
        "far": sphere((0.7, 0.3, -1.0), 0.3, plastic((0.1, 0.3, 0.12), 0.2)),
    }
    rng = np.random.default_rng(3)
    for i in range(14):
        center = (rng.uniform(-2.6, 2.6), rng.uniform(0.2, 1.7), rng.uniform(-5, -2.5))
        scene[f"lamp{i}"] = sphere(center, 0.03, emitter=emission(*(90 * (0.25 + 0.75 * rng.random(3)))))
    return scene


def fog_shaft():
    """Foggy room; a spot light behind slats cuts shafts into the fog."""
    fog = mi.load_dict({"type": "homogeneous", "albedo": rgb(0.9, 0.92, 0.95), "sigma_t": 0.22, "phase": {"type": "hg", "g": 0.3}})
    wall = diffuse(0.45, 0.42, 0.4)
    scene = {
        "type": "scene", "integrator": {"type": "volpath", "max_depth": 16, "rr_depth": 6},
        **box_room((2.5, 1.5, 3), [wall, diffuse(0.3, 0.35, 0.5), wall, wall, wall], textured(tiles(seed=4), 2)),
        "sensor": {**camera((1.2, 1.2, 2.8), (-0.3, 1.0, -1), 65), "medium": fog},
        "spot": {"type": "spot", "to_world": T().look_at(origin=[-2.1, 2.85, -1.9], target=[0.6, 0, 0.2], up=[0, 1, 0]),
                 "intensity": rgb(75, 66, 50), "cutoff_angle": 32, "beam_width": 28, "medium": fog},
        "air": {"type": "cube", "to_world": T().translate([0, 1.5, 0]).scale([4, 3, 5]), "bsdf": {"type": "null"},
                "interior": fog},
        "ball": sphere((0.5, 0.45, 0.2), 0.45, diffuse(0.7, 0.25, 0.15)),
        "chest": block((-1.1, 0.35, -0.4), (0.4, 0.35, 0.35), textured(marble(seed=9), 1), 30),
    }
    toward = np.array([2.7, -2.85, 2.1])
    toward /= np.linalg.norm(toward)
    across = np.cross(toward, [0, 1, 0])
    across /= np.linalg.norm(across)
    lift = np.cross(across, toward)
    for i in range(5):
        center = np.array([-2.1, 2.85, -1.9]) + 0.8 * toward + lift * (i - 2) * 0.21
        scene[f"slat{i}"] = quad(center, across * 0.6, lift * 0.055, diffuse(0.1))
    return scene


def door_ajar():
    """All light comes through a door that stands ajar."""
    white, wood = diffuse(0.75, 0.73, 0.7), diffuse(0.45, 0.3, 0.16)
    half_gap, wall_z = 0.45, -1.0
    scene = {
        "type": "scene", "integrator": path(16),
        **box_room((2.2, 1.25, 3), [diffuse(0.6, 0.35, 0.3), diffuse(0.3, 0.45, 0.6), white, white, white], textured(tiles(seed=6), 1.5)),
        "sensor": camera((1.2, 1.35, 2.8), (-0.4, 0.85, -1), 62),
        "wall_l": quad((-1.325, 1.25, wall_z), (0.875, 0, 0), (0, 1.25, 0), white),
        "wall_r": quad((1.325, 1.25, wall_z), (0.875, 0, 0), (0, 1.25, 0), white),
        "lintel": quad((0, 2.25, wall_z), (half_gap, 0, 0), (0, 0.25, 0), white),
        "lamp": quad((0.9, 2.48, -2.1), (0.5, 0, 0), (0, 0, 0.3), diffuse(0.5), emitter=emission(250, 220, 180)),
        "table": block((-1.0, 0.4, 0.9), (0.5, 0.03, 0.4), wood),
        "leg": block((-1.0, 0.19, 0.9), (0.06, 0.19, 0.06), wood),
        "pot": sphere((-1.1, 0.63, 0.9), 0.2, plastic((0.5, 0.5, 0.52), 0.1)),
        "steel": sphere((-0.7, 0.55, 1.05), 0.12, metal("Al", 0.1)),
        "chest": block((1.3, 0.35, 0.2), (0.4, 0.35, 0.35), textured(marble(seed=3), 1), -20),
    }
    angle = math.radians(50)
    hinge = np.array([-half_gap, 1.0, wall_z])
    blade = np.array([math.cos(angle), 0, math.sin(angle)]) * half_gap
    scene["door"] = quad(hinge + blade, blade, (0, 1.0, 0), wood)
    return scene


def foliage():
    """Thousands of small leaves under a sky with a sun."""
    scene = {
        "type": "scene", "integrator": path(8),
        "sensor": camera((0, 1.1, 4.2), (0, 1.0, 0), 40),
        "sky": {"type": "envmap", "bitmap": mi.Bitmap(sky().astype(np.float32))},
        "ground": quad((0, 0, 0), (20, 0, 0), (0, 0, -20), textured(marble(seed=11) * 0.6, 12)),
        "trunk": {"type": "cylinder", "p0": [0, 0, 0], "p1": [0, 1.2, 0], "radius": 0.09, "bsdf": diffuse(0.2, 0.13, 0.08)},
    }
    greens = [(0.12, 0.3, 0.05), (0.2, 0.38, 0.07), (0.35, 0.4, 0.08), (0.5, 0.25, 0.06)]
    for i, green in enumerate(greens):
        scene[f"crown{i}"] = mesh(*leaves(1800, 20 + i, (-1.0, 0.75, -0.8), (1.0, 2.0, 0.8), 0.11), diffuse(*green))
        scene[f"grass{i}"] = mesh(*leaves(900, 40 + i, (-2.2, -0.25, -1.0), (2.2, 0.25, 1.6), 0.13), diffuse(*green))
    return scene


def checker_plaza():
    """Checkers to the horizon, plastic spheres, low sun: texture finer than a pixel."""
    scene = {
        "type": "scene", "integrator": path(8),
        "sensor": camera((0, 0.9, 4), (0, 0.45, 0), 50),
        "sky": {"type": "constant", "radiance": rgb(0.35, 0.45, 0.65)},
        "sun": {"type": "directional", "direction": [-0.6, -0.55, -0.5], "irradiance": rgb(2.4, 2.1, 1.6)},
        "ground": quad((0, 0, 0), (30, 0, 0), (0, 0, -30), textured(checker(), 10)),
        "screen": quad((-1.6, 0.7, -1.2), (0.6, 0, 0.25), (0, 0.7, 0), textured(checker(count=16, dark=(0.5, 0.08, 0.05)), 1)),
        "globe": sphere((1.5, 0.55, -0.6), 0.55, {"type": "plastic", "diffuse_reflectance": bitmap(checker(count=16, dark=(0.05, 0.12, 0.5)), 1)}),
        "glass": sphere((0.1, 0.4, 0.9), 0.4, {"type": "dielectric"}),
        "gold": sphere((-0.55, 0.3, 0.1), 0.3, metal("Au", 0.2)),
    }
    return scene


SCENES = {f.__name__: f for f in [cornell_glossy, glossy_gallery, bokeh_table, fog_shaft, door_ajar, foliage, checker_plaza]}
