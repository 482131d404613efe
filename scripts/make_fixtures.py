#!/usr/bin/env python3
"""Make the files under fixtures/mitsuba and fixtures/blender again, with the real renderers.

  python3 scripts/make_fixtures.py [mitsuba] [blender]

Takes some minutes, makes its own virtual environments under .venv. Mitsuba's vectorised variant
needs LLVM (Debian: libllvm19; elsewhere point DRJIT_LIBLLVM_PATH at the library), Blender's wheel
needs Python 3.11. fixtures/README.md tells what is in the files.
"""

import sys

import environments

wanted = sys.argv[1:] or ["mitsuba", "blender"]
for name in wanted:
    if name not in ("mitsuba", "blender"):
        sys.exit(f"make_fixtures.py: '{name}' is neither mitsuba nor blender")
    environments.run(name, f"fixtures_{name}.py", environments.ROOT / "fixtures" / name)
