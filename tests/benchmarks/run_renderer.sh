#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Times our renderer and Blender's Cycles (where `blender` is installed) in turns on the bench scene:
# prints one line per run, then the medians and their ratios. Compare ratios of CPU seconds from one
# run of this script, never single numbers from two.
#
# usage: run_renderer.sh BENCH_FOLDER [PROGRAM] [REPETITIONS]
#   BENCH_FOLDER  holds scene.glb, scene.json, sky.hdr, refs/ and peer_cycles.py
#   PROGRAM       renderer_bench; default: the one in build/release, as the target `benchmarks` leaves it
#   REPETITIONS   default 3, of three minutes each
set -eu

if [ $# -lt 1 ]; then
  sed -n '3,11p' "$0" | sed 's/^# \{0,1\}//' >&2
  exit 2
fi
bench=$1
here=$(dirname "$0")
program=${2:-$here/../../build/release/bin/renderer_bench}
repetitions=${3:-3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

peer=no
if command -v blender >/dev/null; then
  cp "$bench/peer_cycles.py" "$work"  # it writes the scene beside itself
  blender -b --factory-startup -P "$work/peer_cycles.py" -- build >"$work/build.log" 2>&1 &&
    [ -f "$work/scene.blend" ] && peer=yes
fi
[ "$peer" = yes ] || echo "blender is not installed or cannot build the scene here: ours alone" >&2

# A line: what it is, the materials, the program's own line.
tell() {
  printf '%s %s %s\n' "$1" "$2" "$3" | tee -a "$work/lines"
}
# cycles NAME MATERIALS SAMPLES WIDTH HEIGHT
cycles() {
  [ "$peer" = yes ] || return 0
  tell "$1" "$2" "$(blender -b "$work/scene.blend" -P "$work/peer_cycles.py" -- time --spp "$3" \
    --width "$4" --height "$5" --materials "$2" 2>/dev/null | sed -n 's/^TIME //p' | tail -1)"
}
# ours NAME MATERIALS ARGUMENTS...: lamps and surfaces as the peer has them.
ours() {
  name=$1
  materials=$2
  shift 2
  tell "$name" "$materials" "$("$program" "$bench" --materials "$materials" --sphere-lights disk \
    --principled blender --seed "$i" "$@" | tr '\n' ' ')"
}
reference() {
  echo "$bench/refs/ref_${1}_320x240_4096spp.exr"
}

i=1
while [ "$i" -le "$repetitions" ]; do
  for materials in diffuse pbr; do
    # As many as bring the error to that of 64 paths of the peer.
    case $materials in diffuse) equal=6 ;; *) equal=8 ;; esac
    cycles cycles_sync "$materials" 1 8 8
    cycles cycles_64 "$materials" 64 640 480
    ours ours_64 "$materials" --samples 64 --width 640 --height 480 --probes
    cycles cycles_small "$materials" 64 320 240
    ours ours_equal "$materials" --samples "$equal" --reference "$(reference "$materials")"
    ours ours_denoised "$materials" --samples 2 --denoise --reference "$(reference "$materials")"
  done
  i=$((i + 1))
done
python3 "$here/summarize_renderer.py" <"$work/lines"
