#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs packaging/cluster's templates on a real Slurm (two nodes) and a real Grid Engine (one host), all on
# this machine, and disturbs them: arrays, one shard alone, requeued in mid-run, a killed node daemon
# whose tasks live on, a lost node, time limits, a full disk, 16 shards that end together. Every dataset
# must have the files of one undisturbed run, byte by byte.
#   tests/cluster/run.sh                      both, with build/release
#   tests/cluster/run.sh --build FOLDER ENGINE [SCENARIO]...   ENGINE: slurm or gridengine
# Needs root and Debian's packages, which it installs: daemons, jobs and data are kept in a folder of
# /tmp and ports of their own. Takes about ten minutes, most of it waiting for daemons' time-outs.
set -euo pipefail
cd "$(dirname "$0")/../.."
source tests/cluster/slurm.sh
source tests/cluster/gridengine.sh

build=$PWD/build/release
if [[ ${1:-} == --build ]]; then build=$(realpath "${2:?run.sh: --build needs a folder}"); shift 2; fi
engines=(slurm gridengine)
if (($#)); then engines=("$1"); shift; fi
scenarios=("$@")
if ((EUID != 0)); then echo "run.sh: must run as root" >&2; exit 1; fi
for file in bin/diorama tests/unkind_files.so; do
  if [[ ! -e $build/$file ]]; then echo "run.sh: no $build/$file; build with tests first" >&2; exit 1; fi
done

work=$(mktemp -d /tmp/diorama-cluster.XXXXXX)
chmod 755 "$work"
job=$PWD/tests/cluster/job.yaml
mkdir "$work"/{bin,log,data,small}
failures=()

say() { printf 'cluster %4ds: %s\n' "$SECONDS" "$*"; }
fault() { say "FAULT in $scenario: $*"; failures+=("$scenario: $*"); }

# The processes of the program that work on one dataset, or on any of this test's.
programs() {
  local pid
  for pid in $(pgrep -x diorama || true); do
    if { tr '\0' ' ' <"/proc/$pid/cmdline"; } 2>/dev/null | grep -q -- "--output ${1:-$work}"; then
      echo "$pid"
    fi
  done
}
# stop_daemons FILE...: those whose numbers stand in the files; waits for their ends.
stop_daemons() {
  local pid
  for pid in $(cat "$@" 2>/dev/null); do
    kill "$pid" 2>/dev/null || true
    wait_until 20 gone "$pid" || kill -KILL "$pid"
  done
}
gone() { ! kill -0 "$1" 2>/dev/null; }
cleanup() {
  local engine pid
  for engine in "${engines[@]}"; do stop_"$engine" || true; done
  for pid in $(programs); do kill -KILL "$pid" || true; done
  umount "$work/small" 2>/dev/null || true
  if ((${#failures[@]} == 0)) && [[ ${finished:-} ]]; then rm -rf "$work"; else say "see $work"; fi
}
trap cleanup EXIT
trap 'exit 143' INT TERM

# wait_until SECONDS COMMAND...: polls; false when the time is over.
wait_until() {
  local last=$((SECONDS + $1))
  shift
  until "$@"; do
    if ((SECONDS >= last)); then return 1; fi
    sleep 0.3
  done
}
pictures() { find "$1" -name 'rgb_*.png' 2>/dev/null | wc -l; }
has_pictures() { (($(pictures "$1") >= $2)); }
# delay MILLISECONDS [OPTION]...: per rename, and options, for programs that start from now on.
delay() {
  echo "$1" >"$work/delay"
  echo "${*:2}" >"$work/options"
}

# The program as tasks find it: slowed down, with the plugins of the build.
make_program() {
  cp "$build/tests/unkind_files.so" "$work"  # a path without spaces
  cat >"$work/bin/diorama" <<-END
	#!/bin/sh
	export SLOW_RENAME_MS=\$(cat $work/delay) LD_PRELOAD=$work/unkind_files.so XDG_DATA_HOME=$work/none
	exec $build/bin/diorama "\$@" \$(cat $work/options)
	END
  chmod +x "$work/bin/diorama"
  export PATH=$work/bin:$PATH
  delay 0
}

# same_as_reference DATASET: file by file; the journal may have another order.
same_as_reference() {
  local dataset=$1
  if ! diff -r --brief --exclude=.diorama "$work/reference" "$dataset" >"$work/log/$scenario.diff"; then
    fault "$(wc -l <"$work/log/$scenario.diff") differences: $(head -n 3 "$work/log/$scenario.diff" | tr '\n' ';')"
    return
  fi
  say "$scenario: the same $(find "$dataset" -type f | wc -l) files as the undisturbed run"
}

make_program
scenario=reference
diorama run "$job" --output "$work/reference" >"$work/log/reference.out" 2>&1 ||
  { cat "$work/log/reference.out" >&2; exit 1; }
say "reference: $(pictures "$work/reference") pictures, $(find "$work/reference" -type f | wc -l) files"
mount -t tmpfs -o size=64m tmpfs "$work/small"

for engine in "${engines[@]}"; do
  install_"$engine"
  start_"$engine"
  names=("${scenarios[@]}")
  if ((${#names[@]} == 0)); then
    mapfile -t names < <(declare -F | sed -n "s/^declare -f ${engine}_test_//p")
  fi
  for name in "${names[@]}"; do
    scenario=${engine}_$name
    data=$work/data/$scenario
    delay 0
    "${engine}_test_$name"
  done
  stop_"$engine"
done
finished=1
say "${#failures[@]} faults"
((${#failures[@]} == 0)) || { printf '  %s\n' "${failures[@]}"; exit 1; }
