#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs clang-tidy (the checks of .clang-tidy, all of them errors) over the sources, the most recently changed
# ones first, until the time is over, and says how far it came.
#   tests/check_tidy.sh [--minutes N] [--all-checks]
# Needs what was generated in build/release. --all-checks adds the static analyzer, which
# takes three times as long.
set -euo pipefail
cd "$(dirname "$0")/.."
minutes=1000
checks=
while (($#)); do
  case $1 in
    --minutes) minutes=${2:?check_tidy: --minutes needs a number}; shift 2 ;;
    --all-checks) checks=--checks=clang-analyzer-core.*,clang-analyzer-cplusplus.*; shift ;;
    *) echo "check_tidy: unknown option '$1'" >&2; exit 2 ;;
  esac
done

# Each file as a source of its own. Clang reads no precompiled headers of GCC, and does not know all of its
# warnings; what the build generates is that of build/release.
build=build/tidy/database
cmake --preset release -B build/tidy -D CMAKE_UNITY_BUILD=OFF -D CMAKE_DISABLE_PRECOMPILE_HEADERS=ON >/dev/null
mkdir -p "$build"
sed "s/ -Werror//; s#$PWD/build/tidy/#$PWD/build/release/#g" build/tidy/compile_commands.json \
  >"$build/compile_commands.json"

# Newest change first; without history, as listed.
mapfile -t files < <(
  { git log --format= --name-only 2>/dev/null; git ls-files; } | awk '!seen[$0]++' |
    grep -E '^(sdk/src|framework|plugins)/.*\.cpp$' | while read -r file; do
      if grep -q "\"file\": \"$PWD/$file\"" "$build/compile_commands.json"; then echo "$file"; fi
    done
)
log=$(mktemp)
trap 'rm -f "$log"' EXIT
export last=$(($(date +%s) + 60 * minutes)) build log checks
# shellcheck disable=SC2016  # expanded by the inner shell
if ! printf '%s\0' "${files[@]}" | xargs -0 -n 1 -P "$(nproc)" bash -c '
  if (($(date +%s) >= last)); then exit 0; fi
  clang-tidy-19 --quiet -p "$build" $checks "$0" 2>/dev/null || exit 1
  echo "$0" >>"$log"'; then
  echo 'check_tidy: see above' >&2
  exit 1
fi
echo "check_tidy: $(wc -l <"$log") of ${#files[@]} files"
