"""Virtual environments of the scripts: one folder each under .venv, made on first use."""

import pathlib
import subprocess
import sys
import venv

ROOT = pathlib.Path(__file__).resolve().parent.parent


def python_of(name):
    """The interpreter of environment `name`, which is filled from scripts/requirements-NAME.txt."""
    folder = ROOT / ".venv" / name
    requirements = ROOT / "scripts" / f"requirements-{name}.txt"
    stamp = folder / "installed.txt"  # what was installed, to notice when the requirements change
    python = folder / "bin" / "python"
    if not stamp.exists() or stamp.read_text() != requirements.read_text():
        print(f"making .venv/{name} (once)", flush=True)
        venv.create(folder, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "-r", requirements], check=True)
        stamp.write_text(requirements.read_text())
    return python


def run(name, script, *arguments):
    """Runs scripts/SCRIPT in environment `name`; stops with its exit code when it fails."""
    done = subprocess.run([python_of(name), ROOT / "scripts" / script, *map(str, arguments)])
    if done.returncode:
        sys.exit(done.returncode)
