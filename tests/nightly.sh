#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# What takes longer than CI may. Every part runs, whatever the others say; ends with a table, and with 1 when
# one failed.
#   tests/nightly.sh [PART]...   build mutants kills faults large cluster views clip soak fuzz sanitize tidy deb12 deb13 (default: all)
# Needs root for cluster, deb12 and deb13. KILLS (1000), FAULTS (5000), SOAK_CAPTURES (10000) and FUZZ_MINUTES
# (60, shared by all fuzzers) say how much. Logs are in build/nightly.
set -uo pipefail
cd "$(dirname "$0")/.."
logs=$PWD/build/nightly
mkdir -p "$logs"
export CMAKE_GENERATOR=Ninja

part_build() {
  ./bootstrap.sh packages && cmake --preset release -D DIORAMA_BUILD_TESTS=ON -D DIORAMA_WARNINGS_AS_ERRORS=ON &&
    cmake --build --preset release --target all benchmarks denoiser_pictures
}
part_mutants() { DIORAMA_ALL_MUTANTS=1 ctest --preset release -R '^lint_test$' --output-on-failure; }
part_kills() { tests/cluster/torture.py --kills "${KILLS:-1000}" --seed "$(date +%F)"; }
part_faults() { tests/cluster/torture.py --faults "${FAULTS:-5000}" --seed "$(date +%F)"; }
# The hidden tests: a million captures of a thousand shards.
part_large() { build/release/tests/output_test '[.large]'; }
part_cluster() { tests/cluster/run.sh; }
part_views() { tests/chosen_views/check_views.py; }
part_clip() {
  local folder="$logs/clip"
  build/release/bin/diorama run configs/clip.yaml --output "$folder" --overwrite --set renderer.samples=2 &&
    /usr/bin/python3 tests/clips/check_clip.py "$folder" &&
    /usr/bin/python3 tests/clips/check_walk.py --seeds 8 --height -0.3 0.6 --output "$logs"
}
part_soak() { tests/soak/run.sh "${SOAK_CAPTURES:-10000}"; }
# What the fuzzers of ctest built, for longer; what they find to be new is kept in their corpus folders.
part_fuzz() {
  local fuzzers fuzzer place seeds failed=0
  ctest --preset release -R '^fuzz_' || failed=1
  mapfile -t fuzzers < <(find build/release/fuzz -name '*_fuzzer' -type f -perm -u+x)
  if ((${#fuzzers[@]} == 0)); then echo 'no fuzzers were built'; return 1; fi
  for fuzzer in "${fuzzers[@]}"; do
    place=$(dirname "$fuzzer")
    mapfile -t seeds < <(find "$place/corpus" "$place/seeds" -type d 2>/dev/null)
    echo "== $fuzzer, ${#seeds[@]} folders of seeds"
    mkdir -p "$place/corpus/nightly_$(basename "$fuzzer")"
    "$fuzzer" -max_total_time=$((60 * ${FUZZ_MINUTES:-60} / ${#fuzzers[@]})) -rss_limit_mb=2048 -timeout=10 \
      -max_len=65536 -print_final_stats=1 -artifact_prefix="$logs/$(basename "$fuzzer")-" \
      "$place/corpus/nightly_$(basename "$fuzzer")" "${seeds[@]}" || failed=1
  done
  return "$failed"
}
part_sanitize() { ./bootstrap.sh sanitize-more; }
part_tidy() { tests/check_tidy.sh --all-checks; }
part_deb12() { packaging/build-deb.sh --with-tests && packaging/test-deb.sh; }
part_deb13() { packaging/test-deb.sh trixie; }

parts=("$@")
if ((${#parts[@]} == 0)); then parts=(build mutants kills faults large cluster views clip soak fuzz sanitize tidy deb12 deb13); fi
for part in "${parts[@]}"; do
  if ! declare -F "part_$part" >/dev/null; then echo "nightly: there is no part '$part'" >&2; exit 2; fi
done
table=()
worst=0
for part in "${parts[@]}"; do
  echo "== nightly: $part (log: $logs/$part.log)"
  begin=$SECONDS
  if "part_$part" >"$logs/$part.log" 2>&1; then result=passed; else result=FAILED worst=1; fi
  table+=("$(printf '%-8s %6s  %5ds  %s' "$part" "$result" $((SECONDS - begin)) "$(tail -n 1 "$logs/$part.log")")")
  echo "${table[-1]}"
done
printf '%s\n' '== nightly' "${table[@]}"
exit "$worst"
