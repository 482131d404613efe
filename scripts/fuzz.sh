#!/usr/bin/env bash
# Fuzzes `exr_to_frame` and `denoise` side by side, SECONDS each (default 60):
# scripts/fuzz.sh [SECONDS [TARGET [SEED]]]
#
# The targets are cargo-fuzz's (`cargo fuzz run TARGET`), built here by cargo alone: the flags below are
# the coverage that cargo-fuzz asks for, all of them known to a stable compiler. No address sanitizer:
# the library has no unsafe code. The corpus grows in fuzz/corpus, which is not committed.
# What crashes a target lands in fuzz/artifacts: repair it, and keep the input in tests/found/TARGET.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-60}
targets=${2:-exr_to_frame denoise}
seed=${3:-1} # so that CI tries the same on every run; 0 is another one every time

coverage='--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table
    -Cllvm-args=-sanitizer-coverage-trace-compares'
# Told the target, cargo keeps the flags from the build scripts, which have no fuzzer to report to.
host=$(rustc -vV | sed -n 's/^host: //p')
RUSTFLAGS=$(echo $coverage) cargo build --locked --release --manifest-path fuzz/Cargo.toml \
    --target-dir fuzz/target --target "$host"
SEEDS=fuzz/corpus/seeds cargo test --locked --quiet --test all -- --ignored write_the_seeds

export RAYON_NUM_THREADS=1 # one thread's coverage is reproducible

fuzz() {
    local target=$1
    mkdir -p "fuzz/corpus/$target" "fuzz/artifacts/$target" "tests/found/$target"
    local options=(-max_total_time="$seconds" -seed="$seed" -artifact_prefix="fuzz/artifacts/$target/" -timeout=20
        -rss_limit_mb=1024 -print_final_stats=1)
    case $target in
        exr_to_frame) options+=(-dict=fuzz/dict/exr.dict -max_len=8192) ;;
        denoise) options+=(-max_len=4096) ;;
    esac
    # Without the lines that tell of every input that is kept.
    "fuzz/target/$host/release/$target" "${options[@]}" \
        "fuzz/corpus/$target" "fuzz/corpus/seeds/$target" "tests/found/$target" 2>&1 |
        sed -n "/^#[0-9]*\s*\(NEW\|REDUCE\|RELOAD\)/!s/^/$target: /p"
}
running=()
for target in $targets; do
    fuzz "$target" &
    running+=($!)
done
status=0
for run in "${running[@]}"; do
    wait "$run" || status=$?
done
exit "$status"
