#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Times our renderer and Blender's Cycles (where `blender` is installed) in turns on the bench scene and
# prints one line per run. Compare ratios of CPU seconds from one run of this script, never single
# numbers from two.
#
# usage: run_renderer.sh BENCH_FOLDER [PROGRAM] [REPETITIONS]
#   BENCH_FOLDER  holds scene.glb, scene.json, sky.hdr, refs/ and peer_cycles.py
#   PROGRAM       renderer_bench; default: the one in build/release
set -eu

if [ $# -lt 1 ]; then
  sed -n '3,10p' "$0" | sed 's/^# \{0,1\}//' >&2
  exit 2
fi
bench=$1
program=${2:-$(dirname "$0")/../../build/release/bin/renderer_bench}
repetitions=${3:-3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

peer=no
if command -v blender >/dev/null; then
  blender -b --factory-startup -P "$bench/peer_cycles.py" -- build >"$work/build.log" 2>&1 &&
    [ -f "$bench/scene.blend" ] && peer=yes
fi
[ "$peer" = yes ] || echo "blender is not installed or cannot build the scene here: ours alone" >&2

i=0
while [ "$i" -lt "$repetitions" ]; do
  for materials in diffuse pbr; do
    reference=$bench/refs/ref_${materials}_320x240_4096spp.exr
    echo "ours, equal samples: $("$program" "$bench" --materials "$materials" --samples 64 \
      --width 640 --height 480)"
    echo "ours, error at 64: $("$program" "$bench" --materials "$materials" --samples 64 \
      --reference "$reference" --seed $((i + 1)))"
    echo "ours, denoised at 4: $("$program" "$bench" --materials "$materials" --samples 4 --denoise \
      --reference "$reference" --seed $((i + 1)))"
    if [ "$peer" = yes ]; then
      echo "Cycles: $(blender -b "$bench/scene.blend" -P "$bench/peer_cycles.py" -- time --spp 64 \
        --materials "$materials" 2>/dev/null | grep -i cpu | tail -1)"
    fi
  done
  i=$((i + 1))
done
