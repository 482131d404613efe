#!/usr/bin/env python3
"""The fixtures that Mitsuba 3 writes: fixtures_mitsuba.py FOLDER. Run by make_fixtures.py.

One scene in three layouts, so that one reference serves all of them.
"""

import pathlib
import sys
import tempfile

import mitsuba as mi

mi.set_variant("llvm_ad_rgb")

from mitsuba_scenes import SCENES  # noqa: E402  (needs the variant)
from render_mitsuba import Renderer, add_reference, write_exr  # noqa: E402

SCENE, WIDTH, HEIGHT, SPP = "glossy_gallery", 128, 96, 16
REFERENCE_SPP = 8192
AOVS = "alb:albedo,nn:sh_normal,pos:position,dd:depth"


def own_film(path, integrator, **film):
    """Renders with `integrator` and lets Mitsuba's film write the file."""
    scene = SCENES[SCENE]()
    size = {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}}
    scene["sensor"] |= {"film": size | film, "sampler": {"type": "independent", "sample_count": SPP}}
    scene = mi.load_dict(scene | {"integrator": integrator})
    mi.render(scene, seed=1)
    scene.sensors()[0].film().write(str(path))


def main():
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    aov = {"type": "aov", "aovs": AOVS, "img": SCENES[SCENE]()["integrator"]}
    own_film(folder / "gallery_aov.exr", aov)
    own_film(folder / "gallery_moment.exr", {"type": "moment", "nested": aov}, component_format="float32")
    renderer = Renderer(SCENES[SCENE](), WIDTH, HEIGHT)
    write_exr(folder / "gallery_spp16.exr", renderer.noisy(SPP, seed=1), {"samplesPerPixel": SPP})
    with tempfile.TemporaryDirectory() as scratch:
        add_reference(renderer, pathlib.Path(scratch), REFERENCE_SPP, seed=0)
        (folder / "gallery_ref.exr").write_bytes((pathlib.Path(scratch) / "ref.exr").read_bytes())


main()
