#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# What takes longer than CI may. Every part runs, whatever the others say; ends with a table, and with 1 when
# one failed.
#   tests/nightly.sh [--at-once] [PART]...
#              build mutants kills faults large cluster views clip soak fuzz sanitize tidy deb12 deb13 (default: all)
# --at-once is for machines with many cores: build goes first, then the others run side by side, soak on one half of the
# cores and the rest on the other; cluster, deb12 and deb13, which install packages, one after another among them.
# Needs root and a network for cluster, deb12 and deb13, and python3-scipy (with numpy and OpenCV) for clip. KILLS (1000), FAULTS (5000), VIEWS (1000),
# SOAK_CAPTURES (10000) and FUZZ_MINUTES (60, shared by all fuzzers) say how much. Logs are in build/nightly.
# DIORAMA_BUILD says where the build is (default: build/release, which the part build makes). The parts kills, faults,
# large, views, clip, soak and fuzz need nothing else of a build: neither compilers nor the place where it was made.
set -uo pipefail
cd "$(dirname "$0")/.."
logs=$PWD/build/nightly
mkdir -p "$logs"
export CMAKE_GENERATOR=Ninja
build=$(realpath -m "${DIORAMA_BUILD:-build/release}")
export DIORAMA_BUILD=$build

part_build() {
  ./bootstrap.sh packages &&
    cmake --preset release -D DIORAMA_BUILD_TESTS=ON -D DIORAMA_WARNINGS_AS_ERRORS=ON -D DIORAMA_FUZZ_OPTIMIZATION=-O1 &&
    cmake --build --preset release --target all benchmarks denoiser_pictures &&
    ctest --preset release -R '^fuzz_'  # builds the fuzzers
}
part_mutants() { DIORAMA_ALL_MUTANTS=1 "$build/tests/lint_test"; }
part_kills() { tests/cluster/torture.py --kills "${KILLS:-1000}" --seed "$(date +%F)" --build "$build"; }
part_faults() { tests/cluster/torture.py --faults "${FAULTS:-5000}" --seed "$(date +%F)" --build "$build"; }
# The hidden tests: a million captures of a thousand shards, all sample rooms.
part_large() { "$build/tests/output_test" '[.large]' && "$build/tests/resting_test" '[.large]'; }
part_cluster() { tests/cluster/run.sh --build "$build"; }
part_views() { tests/chosen_views/check_views.py --build "$build" --captures "${VIEWS:-1000}"; }
part_clip() {
  local folder="$logs/clip"
  # Its help first: a library that is missing is told before minutes of rendering.
  /usr/bin/python3 tests/clips/check_clip.py --help &&
    "$build/bin/diorama" run configs/clip.yaml --output "$folder" --overwrite --set renderer.samples=2 &&
    /usr/bin/python3 tests/clips/check_clip.py "$folder" &&
    /usr/bin/python3 tests/clips/check_walk.py --build "$build" --seeds 8 --height -0.3 0.6 --output "$logs"
}
part_soak() { tests/soak/run.sh "${SOAK_CAPTURES:-10000}"; }

# fuzz_one FUZZER SECONDS: what it finds to be new is kept in its corpus folder.
fuzz_one() {
  local fuzzer=$1 name place seeds=()
  name=$(basename "$fuzzer" _fuzzer)
  place=$(dirname "$fuzzer")
  mapfile -t seeds < <(find "tests/fuzz/seeds/${name}s" "$place/corpus/${name}s" "$place/seeds" -maxdepth 0 -type d 2>/dev/null)
  mkdir -p "$place/corpus/nightly_$name"
  "$fuzzer" -max_total_time="$2" -rss_limit_mb=2048 -timeout=10 -max_len=65536 -print_final_stats=1 \
    -artifact_prefix="$logs/${name}_fuzzer-" "$place/corpus/nightly_$name" "${seeds[@]}" \
    >"$logs/fuzz_$name.log" 2>&1
  local code=$?
  echo "$name: exit code $code, ${#seeds[@]} folders of seeds, $(grep -a number_of_executed_units "$logs/fuzz_$name.log" || tail -n 1 "$logs/fuzz_$name.log")"
  return "$code"
}
# What the part build made, for longer: as many at a time as there are processors.
part_fuzz() {
  local fuzzers at_once
  mapfile -t fuzzers < <(find "$build/fuzz" -name '*_fuzzer' -type f -perm -u+x)
  if ((${#fuzzers[@]} == 0)); then echo "no fuzzers in $build/fuzz; the part build makes them"; return 1; fi
  at_once=$(nproc)
  if ((at_once > ${#fuzzers[@]})); then at_once=${#fuzzers[@]}; fi
  export -f fuzz_one
  export logs
  printf '%s\0' "${fuzzers[@]}" | xargs -0 -P "$at_once" -I {} bash -c 'fuzz_one "$0" "$1"' {} \
    $((60 * ${FUZZ_MINUTES:-60} * at_once / ${#fuzzers[@]}))
}
part_sanitize() { ./bootstrap.sh sanitize-more; }
part_tidy() { tests/check_tidy.sh --all-checks; }
part_deb12() { packaging/build-deb.sh --with-tests && packaging/test-deb.sh; }
part_deb13() { packaging/test-deb.sh trixie; }

# run_part PART: leaves its row of the table beside its log.
run_part() {
  local part=$1 begin=$SECONDS result=passed
  echo "== nightly: $part (log: $logs/$part.log)"
  "part_$part" >"$logs/$part.log" 2>&1 || result=FAILED
  printf '%-8s %6s  %5ds  %s\n' "$part" "$result" $((SECONDS - begin)) "$(grep -a . "$logs/$part.log" | tail -n 1)" | tee "$logs/$part.row"
  [[ $result == passed ]]
}
run_in_turn() {
  local part worst=0
  for part in "$@"; do run_part "$part" || worst=1; done
  return "$worst"
}

# The cores of this process, one a line.
list_cores() {
  taskset -pc $$ | sed 's/.*: //' | tr , '\n' | while IFS=- read -r first last; do seq "$first" "${last:-$first}"; done
}
# start CORES PART...: in turn, in a process group of their own; CORES may be empty.
start() {
  {
    if [[ $1 ]]; then taskset -pc "$1" "$BASHPID" >/dev/null; fi
    shift
    run_in_turn "$@"
  } </dev/null &
  started+=($!)
}
run_at_once() {
  local part installing=() first='' second='' cores=() half worst=0
  command -v taskset >/dev/null && mapfile -t cores < <(list_cores)
  if ((${#cores[@]} >= 4)); then
    half=$((${#cores[@]} / 2))
    first=$(IFS=,; echo "${cores[*]:0:half}")
    second=$(IFS=,; echo "${cores[*]:half}")
  fi
  for part in "$@"; do
    if [[ $part == build ]]; then run_part build || worst=1; fi
  done
  set -m
  started=()
  trap 'kill -- "${started[@]/#/-}" 2>/dev/null; exit 130' INT TERM
  for part in "$@"; do
    case $part in
      build) ;;
      cluster | deb12 | deb13) installing+=("$part") ;;
      soak) start "$first" soak ;;
      *) start "$second" "$part" ;;
    esac
  done
  if ((${#installing[@]})); then start "$second" "${installing[@]}"; fi
  for part in "${started[@]}"; do wait "$part" || worst=1; done
  return "$worst"
}

run=run_in_turn
if [[ ${1:-} == --at-once ]]; then run=run_at_once; shift; fi
parts=("$@")
if ((${#parts[@]} == 0)); then parts=(build mutants kills faults large cluster views clip soak fuzz sanitize tidy deb12 deb13); fi
for part in "${parts[@]}"; do
  if ! declare -F "part_$part" >/dev/null; then echo "nightly: there is no part '$part'" >&2; exit 2; fi
done
"$run" "${parts[@]}"
worst=$?
echo '== nightly'
for part in "${parts[@]}"; do cat "$logs/$part.row"; done
exit "$worst"
