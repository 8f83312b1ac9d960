#!/usr/bin/env bash
# Long runs hold no more memory than short ones: every renderer of a processor and every writer, generated
# rooms that are more than the cache of assets holds, for a bounded number of tiny captures.
#
#   tests/soak/run.sh [captures per renderer, default 10000]
#
# Needs a build of the program and of all plugins in build/release (DIORAMA_BUILD says another folder).
# `soak.py --build build/release --renderer vulkan` tries the one that needs a device.
# The datasets go to a temporary folder and are removed. Exit code 1: a run grew, or failed.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
exec python3 "$here/soak.py" --build "${DIORAMA_BUILD:-$here/../../build/release}" \
  --captures "${1:-10000}"
