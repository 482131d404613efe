"""Turns a scene of apr-trace (docs/SCENES.md) into the dictionary of `mitsuba.load_dict`.

Everything has a counterpart in Mitsuba 3 but motion, which Mitsuba does not have: `scene_at` gives the
scene frozen at one moment. Materials that do not transmit are two-sided in apr-trace.
"""

import copy
import json
import pathlib

import mitsuba as mi
import numpy as np

METALS = {  # as in src/trace/scene/material.rs
    "aluminium": ([1.657, 0.880, 0.521], [9.224, 6.270, 4.837]),
    "copper": ([0.200, 0.924, 1.102], [3.912, 2.452, 2.142]),
    "gold": ([0.143, 0.375, 1.442], [3.983, 2.386, 1.603]),
    "silver": ([0.155, 0.117, 0.138], [4.828, 3.122, 2.147]),
}


def T():
    return mi.ScalarTransform4f()


def load(path):
    """The scene at `path`, with the files that it names made absolute."""
    path = pathlib.Path(path).resolve()

    def absolute(value):
        if isinstance(value, list):
            return [absolute(v) for v in value]
        if isinstance(value, dict):
            return {k: str(path.parent / v) if k == "file" else absolute(v) for k, v in value.items()}
        return value

    return absolute(json.loads(path.read_text()))


def rgb(value):
    return {"type": "rgb", "value": value if isinstance(value, list) else [value] * 3}


def matrix(steps):
    result = np.eye(4)
    for step in steps or []:
        (kind, value), = step.items()
        if kind == "translate":
            m = T().translate(value)
        elif kind == "scale":
            m = T().scale([value] * 3 if isinstance(value, (int, float)) else value)
        elif kind == "rotate":
            axis = np.array(value["axis"], float)
            m = T().rotate((axis / np.linalg.norm(axis)).tolist(), value["angle"])
        else:
            m = mi.ScalarTransform4f(np.array(value, float).reshape(4, 4).tolist())
        result = np.array(m.matrix, float) @ result
    return result


def moves(scene):
    return "end" in scene["camera"] or any("motion" in shape for shape in scene["shapes"])


def scene_at(scene, time):
    """The scene as it stands at `time`, 0 to 1: matrices are interpolated element by element."""
    scene = copy.deepcopy(scene)
    for shape in scene["shapes"]:
        if "motion" in shape:
            start, end = matrix(shape.get("transform")), matrix(shape.pop("motion"))
            blended = start * (1 - time) + end * time
            shape["transform"] = [{"matrix": blended.flatten().tolist()}]
    camera = scene["camera"]
    end = camera.pop("end", None)
    if end:
        blended = np.array(look_at(camera)) * (1 - time) + np.array(look_at(end)) * time
        camera["matrix"] = blended.tolist()
    return scene


def look_at(camera):
    return np.array(T().look_at(origin=camera["origin"], target=camera["target"], up=camera.get("up", [0, 1, 0])).matrix)


def texture(value):
    if not isinstance(value, dict):
        return rgb(value)
    scale = value.get("scale", [1, 1])
    to_uv = T().scale([scale[0], scale[1], 1])
    if value["type"] == "checker":
        return {"type": "checkerboard", "color0": rgb(value["color0"]), "color1": rgb(value["color1"]), "to_uv": to_uv}
    return {"type": "bitmap", "filename": value["file"], "raw": value.get("raw", False), "to_uv": to_uv}


def material(m):
    kind, roughness = m["type"], m.get("roughness", 0)
    rough = {"distribution": "ggx", "alpha": roughness} if roughness else {}
    if kind == "dielectric":
        return {"type": "roughdielectric" if rough else "dielectric", "int_ior": m.get("eta", 1.5), "ext_ior": 1.0, **rough}
    if kind == "diffuse":
        inner = {"type": "diffuse", "reflectance": texture(m["reflectance"])}
    elif kind == "plastic":
        inner = {"type": "plastic", "int_ior": m.get("eta", 1.49), "ext_ior": 1.0, "nonlinear": True,
                 "diffuse_reflectance": texture(m["reflectance"])}
    else:
        eta, k = METALS[m["metal"]] if "metal" in m else (m["eta"], m["k"])
        inner = {"type": "roughconductor" if rough else "conductor", "eta": rgb(eta), "k": rgb(k), **rough}
        if "reflectance" in m:
            inner["specular_reflectance"] = rgb(m["reflectance"])
    return {"type": "twosided", "bsdf": inner}


def shape(s):
    to_world = mi.ScalarTransform4f(matrix(s.get("transform")).tolist())
    if s["type"] == "instance":
        return {"type": "instance", "to_world": to_world, "group": {"type": "ref", "id": "group_" + s["of"]}}
    result = {"type": s["type"], "to_world": to_world}
    if s["type"] == "mesh":
        result |= {"type": "obj", "filename": s["file"], "face_normals": s.get("flat", False)}
    if s["type"] == "sphere":
        result |= {"center": s.get("center", [0, 0, 0]), "radius": s.get("radius", 1)}
    if "material" in s:
        result["bsdf"] = {"type": "ref", "id": "material_" + s["material"]}
    else:
        result["bsdf"] = {"type": "diffuse", "reflectance": rgb(0.0)}
    if "emission" in s:
        result["emitter"] = {"type": "area", "radiance": rgb(s["emission"])}
    return result


def light(lamp):
    if lamp["type"] == "point":
        return {"type": "point", "position": lamp["position"], "intensity": rgb(lamp["intensity"])}
    if lamp["type"] == "directional":
        return {"type": "directional", "direction": lamp["direction"], "irradiance": rgb(lamp["irradiance"])}
    cutoff = lamp.get("cutoff_angle", 20)
    axis = np.subtract(lamp["target"], lamp["position"])
    up = [0, 1, 0] if abs(axis[1]) < 0.99 * np.linalg.norm(axis) else [1, 0, 0]
    return {"type": "spot", "intensity": rgb(lamp["intensity"]), "cutoff_angle": cutoff,
            "beam_width": lamp.get("beam_angle", 0.75 * cutoff),
            "to_world": T().look_at(origin=lamp["position"], target=lamp["target"], up=up)}


def environment(e):
    if e["type"] == "constant":
        return {"type": "constant", "radiance": rgb(e["radiance"])}
    return {"type": "envmap", "filename": e["file"], "scale": e.get("scale", 1.0),
            "to_world": T().rotate([0, 1, 0], e.get("rotate", 0))}


def convert(scene, spp=16):
    """The dictionary for `scene`, which must stand still."""
    camera = scene["camera"]
    width, height = camera["resolution"]
    result = {"type": "scene"}
    for name, m in scene.get("materials", {}).items():
        result["material_" + name] = material(m) | {"id": "material_" + name}
    for name, shapes in scene.get("groups", {}).items():
        result["group_" + name] = {"type": "shapegroup", "id": "group_" + name} | {f"s{i}": shape(s) for i, s in enumerate(shapes)}
    result |= {f"shape{i}": shape(s) for i, s in enumerate(scene["shapes"])}
    result |= {f"light{i}": light(lamp) for i, lamp in enumerate(scene.get("lights", []))}
    if "environment" in scene:
        result["environment"] = environment(scene["environment"])
    sensor = {"type": "perspective", "fov": camera["fov"], "fov_axis": "x", "near_clip": 1e-6, "far_clip": 1e4,
              "to_world": mi.ScalarTransform4f(camera.get("matrix", look_at(camera).tolist())),
              "film": {"type": "hdrfilm", "width": width, "height": height, "component_format": "float32",
                       "pixel_format": "rgb", "rfilter": {"type": "box"}},
              "sampler": {"type": "independent", "sample_count": spp}}
    if camera.get("aperture_radius", 0):
        sensor |= {"type": "thinlens", "aperture_radius": camera["aperture_radius"], "focus_distance": camera["focus_distance"]}
    depths = scene.get("integrator", {})
    kind = "path"
    if "medium" in scene:
        kind = "volpath"
        add_medium(result, sensor, scene)
    result["sensor"] = sensor
    result["integrator"] = {"type": kind, "max_depth": depths.get("max_depth", 8), "rr_depth": depths.get("roulette_depth", 5)}
    return result


def add_medium(result, sensor, scene):
    """Adds the medium as the inside of a box of nothing; a medium without bounds is a very large box."""
    m = scene["medium"]
    bounds = m.get("bounds", {"min": [-1e3] * 3, "max": [1e3] * 3})
    low, high = np.array(bounds["min"], float), np.array(bounds["max"], float)
    result["fog"] = {"type": "homogeneous", "id": "fog", "sigma_t": rgb(m["extinction"]), "albedo": rgb(m["albedo"]),
                     "phase": {"type": "hg", "g": m.get("anisotropy", 0.0)}}
    result["fog_box"] = {"type": "cube", "bsdf": {"type": "null"}, "interior": {"type": "ref", "id": "fog"},
                         "to_world": T().translate(((low + high) / 2).tolist()) @ T().scale(((high - low) / 2).tolist())}
    origin = np.array(scene["camera"]["origin"])
    if (low < origin).all() and (origin < high).all():
        sensor["medium"] = {"type": "ref", "id": "fog"}
