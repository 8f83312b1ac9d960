#!/usr/bin/env bash
# The whole job, by threads and visits in flight: wall time, CPU time and memory, as ratios of one run.
#
#   tests/benchmarks/run_overlap.sh [PROGRAM [JOB [ARGUMENT...]]]
#
# PROGRAM: build/release/bin/diorama. JOB: configs/dining_room.yaml, which is then rendered in real time
# with four cameras. Further arguments go to `diorama run`. Settings, as variables:
#   THREADS="1 2 4 8 16"  numbers of threads; those above the machine's are left out
#   VISITS="1 0"          visits in flight; 0: the program's choice
#   CAPTURES=24           of the job
#   OUT=/dev/shm          folder for the datasets, best in memory
# Prints a JSON line per run; the bytes of all datasets are compared with the first one's.
set -euo pipefail
program=${1:-build/release/bin/diorama}
job=${2:-configs/dining_room.yaml}
shift $(($# < 2 ? $# : 2))
read -ra threads <<<"${THREADS:-1 2 4 8 16}"
read -ra visits <<<"${VISITS:-1 0}"
out=$(mktemp -d "${OUT:-/dev/shm}/overlap-XXXXXX")
trap 'rm -rf "$out"' EXIT

arguments=(--set "total_captures=${CAPTURES:-24}")
if [[ $job == */dining_room.yaml ]]; then
  arguments+=(--set 'renderer={type: embree, mode: real_time, samples: 1}' --set cameras.0.count=4)
fi

# Digest of every file of a dataset but what workers keep for themselves.
digest() {
  (cd "$1" && find . -type f -not -path '*/.diorama/*' -print0 | sort -z | xargs -0 sha256sum) | sha256sum | cut -c1-16
}

expected=
for count in "${threads[@]}"; do
  if ((count > $(nproc))); then continue; fi
  for flight in "${visits[@]}"; do
    run=("$program" --threads "$count" run "$job" --output "$out/dataset" "${arguments[@]}" "$@")
    if ((flight > 0)); then run+=(--visits-in-flight "$flight"); fi
    TIMEFORMAT='%R %U %S'
    { time "${run[@]}" >"$out/log" 2>&1 || { cat "$out/log" >&2; exit 1; }; } 2>"$out/time"
    read -r wall user system < <(tail -n 1 "$out/time")
    phases=$(grep -o 'time: .*' "$out/log" | tail -n 1)
    found=$(digest "$out/dataset")
    expected=${expected:-$found}
    same=$([[ $found == "$expected" ]] && echo true || echo false)
    echo "{\"threads\": $count, \"visits_in_flight\": $flight, \"wall_s\": $wall, \"user_s\": $user," \
      "\"system_s\": $system, \"same_bytes\": $same, \"phases\": \"$phases\"}"
    rm -rf "$out/dataset"
  done
done
