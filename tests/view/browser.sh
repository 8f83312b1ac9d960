#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Tries the page of `diorama view` in Chromium (Debian's, with Playwright from npm), and leaves pictures to
# look at: tests/view/browser.sh PROGRAM DATASET PICTURES [OTHER], which is compared with it. Not part of the tests that ctest runs.
# tests/view/browser.sh --speed PROGRAM DATASET measures instead; make_coco.py makes large datasets.
# tests/view/browser.sh --run PROGRAM JOB PICTURES watches a run that goes on.
# tests/view/browser.sh --faults PROGRAM PICTURES shows what cannot be read, and masks that overlap.
# tests/view/browser.sh --formats PROGRAM RUN PICTURES goes through all datasets of a run (end_to_end/all_writers.yaml), and asks axe.
# tests/view/browser.sh --first PROGRAM DATASET... measures until the first pictures, which may take two seconds.
set -euo pipefail
script=browser
case $1 in
  --speed) script=speed ;;
  --run) script=live ;;
  --faults) script=faults ;;
  --formats) script=formats ;;
  --first) script=first ;;
esac
if [[ $script != browser ]]; then shift; fi
datasets=("${@:2}")
program=$(realpath "$1") dataset=$(realpath -m "$2") pictures=$(realpath -m "${3:-.}")
other=${4:+$(realpath "$4")}
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp "$here/$script.mjs" "$work"
(cd "$work" && npm init --yes >npm.log && npm install playwright-core@1 axe-core@4 >>npm.log 2>&1) || { cat "$work/npm.log"; exit 1; }
if [[ $script == browser ]]; then
  # shellcheck disable=SC2086
  "$program" ${DIORAMA_OPTIONS:-} report "$dataset" -o "$work/report" --captures 20
  node "$work/browser.mjs" "$program" "$dataset" "$pictures" "$work/report" ${other:+"$other"}
elif [[ $script == first ]]; then
  node "$work/first.mjs" "$program" "$work" "${datasets[@]}"
elif [[ $script == faults ]]; then
  node "$work/faults.mjs" "$program" "$dataset" "$work"  # the second argument is the folder of pictures
else
  node "$work/$script.mjs" "$program" "$dataset" "$pictures" "$work"
fi
