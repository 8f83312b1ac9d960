#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Times our renderer and Blender's Cycles (where `blender` is installed) in turns on the bench scene and
# prints one line per run. Compare ratios of CPU seconds from one run of this script, never single
# numbers from two.
#
# usage: run_renderer.sh BENCH_FOLDER [PROGRAM] [REPETITIONS] [SAMPLES]
#   BENCH_FOLDER  holds scene.glb, scene.json, sky.hdr, refs/ and peer_cycles.py
#   PROGRAM       renderer_bench; default: the one in build/release, as the target `benchmarks` leaves it
#   REPETITIONS   default 3
#   SAMPLES       per pixel of the 320x240 pictures; default 64
set -eu

if [ $# -lt 1 ]; then
  sed -n '3,12p' "$0" | sed 's/^# \{0,1\}//' >&2
  exit 2
fi
bench=$1
program=${2:-$(dirname "$0")/../../build/release/bin/renderer_bench}
repetitions=${3:-3}
samples=${4:-64}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

peer=no
if command -v blender >/dev/null; then
  cp "$bench/peer_cycles.py" "$work"  # it writes the scene beside itself
  blender -b --factory-startup -P "$work/peer_cycles.py" -- build >"$work/build.log" 2>&1 &&
    [ -f "$work/scene.blend" ] && peer=yes
fi
[ "$peer" = yes ] || echo "blender is not installed or cannot build the scene here: ours alone" >&2

# Lamps and surfaces as the peer has them. The size of its pictures does not matter for the time of a path.
ours() {
  "$program" "$bench" --materials "$1" --sphere-lights disk --principled blender --seed $((i + 1)) \
    --reference "$bench/refs/ref_${1}_320x240_4096spp.exr" --samples "$2" $3
}

i=0
while [ "$i" -lt "$repetitions" ]; do
  for materials in diffuse pbr; do
    if [ "$peer" = yes ]; then
      echo "Cycles: $(blender -b "$work/scene.blend" -P "$work/peer_cycles.py" -- time \
        --spp "$samples" --width 320 --height 240 --materials "$materials" 2>/dev/null |
        grep -i cpu | tail -1)"
    fi
    echo "ours: $(ours "$materials" "$samples" --probes)"
    echo "ours, denoised at 2: $(ours "$materials" 2 --denoise)"
    echo "ours, denoised at 4: $(ours "$materials" 4 --denoise)"
  done
  i=$((i + 1))
done
