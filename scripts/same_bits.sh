#!/usr/bin/env bash
# The same picture through both builds of apr-denoise, on 1, 2 and 8 threads: the files are equal to the byte.
# scripts/same_bits.sh [DEBUG RELEASE [INPUT]]
#
# rustc never fuses a multiplication and an addition by itself and never reorders sums, so the bits cannot
# depend on the optimiser; checks of overflow and debug assertions run in one of the two.
set -euo pipefail
cd "$(dirname "$0")/.."
debug=${1:-target/debug/apr-denoise} release=${2:-target/release/apr-denoise}
input=${3:-fixtures/mitsuba/gallery_spp16.exr}
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT
for threads in 1 2 8; do
    "$debug" "$input" "$folder/debug.exr" --quiet --aux --threads "$threads"
    "$release" "$input" "$folder/release.exr" --quiet --aux --threads "$threads"
    [ "$threads" = 1 ] && cp "$folder/debug.exr" "$folder/expected.exr"
    cmp "$folder/expected.exr" "$folder/debug.exr"
    cmp "$folder/expected.exr" "$folder/release.exr"
done
echo "debug and release give the same $(stat -c %s "$folder/expected.exr") bytes on 1, 2 and 8 threads"
