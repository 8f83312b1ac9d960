#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Looks whether every C++ file is formatted as .clang-format says, or formats them.
#   tests/check_format.sh [--fix]
set -euo pipefail
cd "$(dirname "$0")/.."
how=(--dry-run -Werror)
if [[ ${1:-} == --fix ]]; then how=(-i); fi
git ls-files -z -- '*.c' '*.cpp' '*.h' | xargs -0 clang-format-14 "${how[@]}"
