#!/usr/bin/env bash
# A sequence through the farm's engines on this machine: the same bits as one process.
#   check.sh FOLDER-OF-PROGRAMS [VENV]
# The engines are openjd (in VENV, else in PATH) and Slurm; what is not installed is skipped and said so.
set -euo pipefail
programs=$(realpath "${1:?the folder of the programs, such as target/release}")
openjd=${2:+$(realpath "$2")/bin/}openjd
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d /tmp/apr-farm.XXXXXX)
trap 'rm -rf "$work"' EXIT
shot="$work/it's a shot"
mkdir "$shot"
cd "$shot"

for frame in 1 2 3 4 5 6; do
    "$programs/apr-trace" "$here/../../fixtures/scenes/cornell_box.json" \
        "$(printf 'shot.%04d.exr' "$frame")" --spp 1 --seed "$frame" --quiet
done
mkdir one openjd slurm
"$programs/apr-denoise" 'shot.####.exr' 'one/den.####.exr' --preset fast --quiet

same() {
    for frame in 1 2 3 4 5 6; do
        cmp "one/den.000$frame.exr" "$1/den.000$frame.exr"
    done
    echo "$1: the same bits as one process"
}

if command -v "$openjd" >/dev/null; then
    "$openjd" run "$here/openjd.yaml" -p "InputFolder=$shot" -p 'Input=shot.####.exr' -p "OutputFolder=$shot/openjd" \
        -p Frames=1-6 -p Preset=fast -p ChunkSize=2 -p "Options=--report \"$shot/openjd/rep #.json\" --threads 1" \
        -p "Program=$programs/apr-denoise" >openjd.log 2>&1 || { cat openjd.log >&2; exit 1; }
    grep -q 'openjd_progress: 100' openjd.log || { cat openjd.log >&2; exit 1; }
    same openjd
else
    echo 'openjd: SKIPPED, not installed'
fi

# The script alone, as Slurm would start its tasks: chunks 1-4 and 5-6, and one beyond the shot.
mkdir tasks
for task in 0 1 2; do
    SLURM_ARRAY_TASK_ID=$task SLURM_CPUS_PER_TASK=1 FIRST=1 LAST=6 CHUNK=4 APR_DENOISE=$programs/apr-denoise bash \
        "$here/denoise.sbatch" 'shot.####.exr' 'tasks/den.####.exr' --preset fast --threads 2 >tasks.log 2>&1 ||
        { cat tasks.log >&2; exit 1; }
done
same tasks

if [ "$(id -u)" = 0 ] && command -v slurmctld slurmd munged sbatch >/dev/null; then
    export APR_DENOISE=$programs/apr-denoise FIRST=1 LAST=6 CHUNK=4
    "$here/slurm_here.sh" sbatch --wait --array=0-2 --output="$work/slurm.%a.log" "$here/denoise.sbatch" \
        "$shot/shot.####.exr" "$shot/slurm/den.####.exr" --preset fast >slurm.log 2>&1 ||
        { cat slurm.log "$work"/slurm.*.log >&2; exit 1; }
    same slurm
else
    echo 'slurm: SKIPPED, wants root and the packages slurm-wlm and munge'
fi
