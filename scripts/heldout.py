#!/usr/bin/env python3
"""Render the seventeen held-out scenes with Mitsuba 3: ten new ones and the seven of mitsuba_scenes.py.

  python3 scripts/heldout.py OUT [--only hair,smoke] [--spp 16,64,256] [--size 240x180] [--reference-spp 16384]
                                 [--variant llvm_ad_rgb]

They are for the last word: README.md and docs/LEDGER.md tell how far the denoiser is from OIDN on them. Nothing is
to be tuned on them, else they are held out no more; where an idea came of what they showed, the ledger says so.

Writes OUT/SCENE/spp16.exr … and OUT/SCENE/ref.exr with the channels that render_mitsuba.py describes; samples are
multiples of 16. A reference that is there gets the samples that it lacks. Then, for each scene:

  apr-denoise OUT/hair/spp16.exr denoised.exr
  apr-compare denoised.exr OUT/hair/ref.exr

tells relMSE, and relMSE less the reference's own noise.

Needs the packages of scripts/requirements-mitsuba.txt (installs them into .venv/mitsuba where they are not there);
llvm_ad_rgb needs LLVM (Debian: libllvm19, and DRJIT_LIBLLVM_PATH); scalar_rgb does not do, for samples are drawn by
the million. All of it takes about eight hours on two cores, with --reference-spp 1024 one; smoke, forty times as slow
as most, has an eighth of the others' reference.
"""

import argparse
import pathlib
import sys

try:
    import mitsuba as mi
except ImportError:
    import environments

    environments.run("mitsuba", "heldout.py", *sys.argv[1:])
    sys.exit(0)

SLOW = {"smoke": 8}  # by how much there are fewer samples in its reference


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--only", help="names of scenes, comma-separated; all by default")
    parser.add_argument("--spp", default="16,64,256", help="noisy pictures, comma-separated; empty for none")
    parser.add_argument("--size", default="240x180")
    parser.add_argument("--reference-spp", type=int, default=16384, help="samples of the reference; 0 for none")
    parser.add_argument("--variant", default="llvm_ad_rgb")
    options = parser.parse_args()
    mi.set_variant(options.variant)
    import heldout_scenes
    import mitsuba_scenes
    from render_mitsuba import render

    scenes = heldout_scenes.SCENES | mitsuba_scenes.SCENES
    names = options.only.split(",") if options.only else list(scenes)
    unknown = [name for name in names if name not in scenes]
    if unknown:
        parser.error(f"--only: no scene is called {', '.join(unknown)}; there are {', '.join(scenes)}")
    size = tuple(map(int, options.size.split("x")))
    counts = [int(spp) for spp in options.spp.split(",") if spp]
    for name in names:
        render(name, scenes[name](), options.out, size, counts, options.reference_spp // SLOW.get(name, 1))


main()
