#!/usr/bin/env bash
# The same pictures through both builds of apr-denoise, on 1, 2 and 8 threads: the files are equal to the byte.
# scripts/same_bits.sh [DEBUG RELEASE]
#
# rustc never fuses a multiplication and an addition by itself and never reorders sums, so the bits cannot
# depend on the optimiser; checks of overflow and debug assertions run in one of the two.
set -euo pipefail
cd "$(dirname "$0")/.."
debug=${1:-target/debug/apr-denoise} release=${2:-target/release/apr-denoise}
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT

# The bytes that INPUT with OPTIONS becomes.
same() {
    for threads in 1 2 8; do
        for build in "$debug" "$release"; do
            "$build" "$1" "$folder/out.exr" --quiet --aux --threads "$threads" "${@:2}"
            [ -e "$folder/expected.exr" ] || cp "$folder/out.exr" "$folder/expected.exr"
            cmp "$folder/expected.exr" "$folder/out.exr"
        done
    done
    rm "$folder/expected.exr"
    echo "$*: the same $(stat -c %s "$folder/out.exr") bytes by debug and release, on 1, 2 and 8 threads"
}
same fixtures/mitsuba/gallery_spp16.exr
same fixtures/mitsuba/gallery_spp16.exr --preset best
same fixtures/blender/room_seed1.exr --half fixtures/blender/room_seed2.exr --aov auto
same fixtures/trace/lens_table.exr --method nfor
