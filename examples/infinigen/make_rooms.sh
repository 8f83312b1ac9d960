#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes dining rooms with Infinigen, exports them to USD and checks every export.
#
#   make_rooms.sh [--first-seed N] [--count N] [--jobs N] [--output DIR] [--room TYPE] [--resolution PIXELS]
#
# Run it in Infinigen's own Python environment. A room that is already there is not made again, so a
# stopped run goes on where it was. Each room takes Infinigen 10 to 60 minutes and some 10 GB of memory.
set -euo pipefail

first_seed=1 count=10 jobs=1 output=outputs room=DiningRoom resolution=1024
diorama=${DIORAMA:-diorama}
python=${PYTHON:-python}

usage() { sed -n '3,8s/^# \{0,1\}//p' "$0"; }

while (($#)); do
  case $1 in
    --first-seed) first_seed=${2:?}; shift 2 ;;
    --count) count=${2:?}; shift 2 ;;
    --jobs) jobs=${2:?}; shift 2 ;;
    --output) output=${2:?}; shift 2 ;;
    --room) room=${2:?}; shift 2 ;;
    --resolution) resolution=${2:?}; shift 2 ;;
    -h | --help) usage; exit 0 ;;
    *) echo "make_rooms: unknown option '$1'" >&2; usage >&2; exit 2 ;;
  esac
done

for number in first_seed count jobs resolution; do
  if ! [[ ${!number} =~ ^[0-9]+$ ]]; then
    echo "make_rooms: --${number//_/-} expects a whole number, found '${!number}'" >&2
    exit 2
  fi
done
for program in "$python" "$diorama"; do
  if ! command -v "$program" >/dev/null; then
    echo "make_rooms: '$program' not found (set PYTHON or DIORAMA to its path)" >&2
    exit 1
  fi
done

# One room: generate, export, check. Files of a failed step are not taken for finished ones, because
# each step leaves a mark only after it succeeded.
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
    touch "$export/.exported"
  fi
  "$diorama" inspect "$usd" >"$export/inspect.txt" ||
    { echo "seed $seed: $usd does not load, see $export/inspect.txt" >&2; return 1; }
  if ! grep -q TableDining "$export/inspect.txt"; then
    echo "seed $seed: no dining table in $usd; objects will gather at the origin" >&2
  fi
  echo "seed $seed: done, $usd"
}

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
((failed == 0))
