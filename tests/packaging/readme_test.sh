#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The commands that a page names exist, with the subcommands and options that it writes.
#   readme_test.sh PROGRAM PAGE
set -euo pipefail
program=${1:?usage: readme_test.sh PROGRAM PAGE}
page=${2:?usage: readme_test.sh PROGRAM PAGE}
cd "$(dirname "$page")"
faults=0
commands=0
fault() { echo "$page: $*" >&2; faults=$((faults + 1)); }

check_diorama() {
  local words=("$@") help path=() word
  help=$("$program" --help)
  for word in "${words[@]}"; do
    if [[ $word != [a-z]* ]]; then break; fi
    if ! grep -qE "^ +$word( |\$)" <<<"$help"; then
      if grep -q '^Subcommands:' <<<"$help"; then fault "there is no 'diorama ${path[*]} $word'"; fi
      break
    fi
    path+=("$word")
    help=$("$program" "${path[@]}" --help)
  done
  for word in "${words[@]}"; do
    if [[ $word == -* ]] && ! grep -qE -- "(^|[ ,])$word([ ,=]|\$)" <<<"$help"; then
      fault "'diorama ${path[*]}' has no option '$word'"
    fi
    if [[ $word == configs/* && ! -e $word ]]; then fault "there is no $word"; fi
  done
}

check() {
  local words=("$@")
  commands=$((commands + 1))
  case ${words[0]} in
    diorama) check_diorama "${words[@]:1}" ;;
    ./bootstrap.sh)
      [[ -x bootstrap.sh ]] || fault 'bootstrap.sh cannot be run'
      ./bootstrap.sh help | grep -q "^ *./bootstrap.sh ${words[1]} " || fault "no ${words[*]}" ;;
    export | cpack | cmake | ctest) ;;
    */*) [[ -x ${words[0]} ]] || fault "${words[0]} cannot be run" ;;
    *) fault "unknown command '${words[*]}'" ;;
  esac
}

# The blocks of shell commands, then the commands that the text quotes.
while read -r line; do
  read -ra words <<<"${line%%#*}"
  if ((${#words[@]})); then check "${words[@]}"; fi
done < <(sed -n '/^```sh$/,/^```$/{/^```/d;p;}' "$page")
while read -r line; do
  read -ra words <<<"$line"
  check "${words[@]}"
done < <(sed '/^```/,/^```$/d' "$page" | grep -oE '`(diorama|\./bootstrap\.sh|tests/|packaging/|\.ci/)[^`]*`' | tr -d '`')

((commands > 0)) || fault 'no commands were found'
echo "$page: $commands commands, $faults faults"
((faults == 0))
