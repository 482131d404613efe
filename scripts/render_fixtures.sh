#!/usr/bin/env bash
# Renders the shipped scenes: noisy inputs of 16 and 64 samples per pixel, and references.
#
#   scripts/render_fixtures.sh FOLDER [REFERENCE_SPP] [SCENE …]
#
# writes FOLDER/SCENE/spp16.exr, spp64.exr and ref.exr; 4096 samples by default. A render that is there is
# kept, and a reference that was interrupted goes on from its checkpoint.
set -euo pipefail
cd "$(dirname "$0")/.."

folder=${1:?'give a folder for the renders'}
reference=${2:-4096}
scenes=("${@:3}")
if [ ${#scenes[@]} -eq 0 ]; then
    for file in fixtures/scenes/*.json; do scenes+=("$(basename "$file" .json)"); done
fi

cargo build --release --bin apr-trace
for scene in "${scenes[@]}"; do
    mkdir -p "$folder/$scene"
    render() { # OUTPUT OPTION …
        [ -e "$folder/$scene/$1" ] || target/release/apr-trace "fixtures/scenes/$scene.json" "$folder/$scene/$1" "${@:2}"
    }
    # Seeds differ, so that the errors of input and reference are independent.
    render spp16.exr --spp 16 --seed 1
    render spp64.exr --spp 64 --seed 2
    render ref.exr --reference "$reference" --seed 3 --features none
done
