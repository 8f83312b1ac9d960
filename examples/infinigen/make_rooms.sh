#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes dining rooms with Infinigen, exports them to USD, checks every export, and runs a job on them.
#
#   make_rooms.sh [--first-seed N] [--count N] [--jobs N] [--output DIR] [--room TYPE] [--resolution PIXELS]
#                 [--run JOB]
#
# Run it in Infinigen's own Python environment. A room that is already there is not made again, so a
# stopped run goes on where it was. Each room takes Infinigen 10 to 60 minutes and some 10 GB of memory.
# PYTHON and DIORAMA name the programs when they are not on the path.
set -euo pipefail
# Every room is a process group of its own, so that stopping the script stops Blender, too.
set -m

first_seed=1 count=10 jobs=1 output=outputs room=DiningRoom resolution=1024 job=
diorama=${DIORAMA:-diorama}
python=${PYTHON:-python}

usage() { sed -n '3,10s/^# \{0,1\}//p' "$0"; }

while (($#)); do
  case $1 in
    --first-seed) first_seed=${2:?}; shift 2 ;;
    --count) count=${2:?}; shift 2 ;;
    --jobs) jobs=${2:?}; shift 2 ;;
    --output) output=${2:?}; shift 2 ;;
    --room) room=${2:?}; shift 2 ;;
    --resolution) resolution=${2:?}; shift 2 ;;
    --run) job=${2:?}; shift 2 ;;
    -h | --help) usage; exit 0 ;;
    *) echo "make_rooms: unknown option '$1'" >&2; usage >&2; exit 2 ;;
  esac
done

for number in first_seed count jobs resolution; do
  if ! [[ ${!number} =~ ^(0|[1-9][0-9]{0,8})$ ]]; then
    echo "make_rooms: --${number//_/-} expects a whole number, found '${!number}'" >&2
    exit 2
  fi
done
if ((jobs < 1 || count < 1)); then
  echo "make_rooms: --jobs and --count must be at least 1" >&2
  exit 2
fi
for program in "$python" "$diorama"; do
  if ! command -v "$program" >/dev/null; then
    echo "make_rooms: '$program' not found (set PYTHON or DIORAMA to its path)" >&2
    exit 1
  fi
done
if [[ -n $job && ! -f $job ]]; then
  echo "make_rooms: --run: '$job' is no file" >&2
  exit 2
fi

# One room: generate, export, check. What a failed step left is not taken for finished, because each
# step leaves a mark only after it succeeded; an export that does not load is made again next time.
make_room() {
  local seed=$1
  local scene=$output/indoors/dining_room_$seed
  local export=$output/rooms/dining_room_$seed
  local usd=$export/export_scene.blend/export_scene.usdc
  local log=$output/logs/dining_room_$seed.log
  mkdir -p "$scene" "$export" "$output/logs"

  if [[ ! -e $scene/.generated ]]; then
    echo "seed $seed: generating (log: $log)"
    "$python" -m infinigen_examples.generate_indoors --seed "$seed" --task coarse \
      --output_folder "$scene" -g fast_solve.gin singleroom.gin \
      -p compose_indoors.terrain_enabled=False "restrict_solving.restrict_parent_rooms=[\"$room\"]" \
      >"$log" 2>&1 || { echo "seed $seed: generation failed, see $log" >&2; return 1; }
    touch "$scene/.generated"
  fi
  if [[ ! -e $export/.exported ]]; then
    echo "seed $seed: exporting"
    "$python" -m infinigen.tools.export --input_folder "$scene" --output_folder "$export" \
      -f usdc -r "$resolution" --omniverse \
      >>"$log" 2>&1 || { echo "seed $seed: export failed, see $log" >&2; return 1; }
    "$diorama" inspect "$usd" >"$export/inspect.txt" 2>&1 ||
      { echo "seed $seed: $usd does not load, see $export/inspect.txt" >&2; return 1; }
    touch "$export/.exported"
  fi
  if ! grep -q TableDining "$export/inspect.txt"; then
    echo "seed $seed: no dining table in $usd; objects will gather at the origin" >&2
  fi
  echo "seed $seed: done, $usd"
}

stop() {
  local room_group
  for room_group in $(jobs -p); do kill -TERM -- "-$room_group" 2>/dev/null || true; done
  echo "make_rooms: stopped; run it again to go on" >&2
  exit 130
}
trap stop INT TERM

failed=0
running=0
for ((seed = first_seed; seed < first_seed + count; ++seed)); do
  if ((running >= jobs)); then
    wait -n || failed=$((failed + 1))
    running=$((running - 1))
  fi
  make_room "$seed" &
  running=$((running + 1))
done
while ((running > 0)); do
  wait -n || failed=$((failed + 1))
  running=$((running - 1))
done
echo "$((count - failed)) of $count rooms below $output/rooms"
((failed == 0)) || exit 1
if [[ -n $job ]]; then "$diorama" run "$job"; fi
