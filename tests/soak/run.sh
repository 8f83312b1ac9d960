#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Long runs hold no more memory than short ones: every renderer of a processor with all writers, in generated rooms
# that are more than the cache of assets holds, and every writer alone. Tiny captures, all runs side by side as far
# as there are cores: about an hour and a half of processor time. Ends with a table, and with 1 when a run grew
# or failed (ADR 0104).
#
#   tests/soak/run.sh [captures of a run, default 10000] [option of soak.py]...
#
# Needs a build of the program and of all plugins in build/release (DIORAMA_BUILD says another folder). The
# datasets go to a temporary folder and are removed; all of them take 20 GB (TMPDIR=/dev/shm is fastest). `--seconds N`
# stops each run then and judges what it made.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
captures=${1:-10000}
if (($#)); then shift; fi
exec python3 "$here/soak.py" --build "${DIORAMA_BUILD:-$here/../../build/release}" --captures "$captures" "$@"
