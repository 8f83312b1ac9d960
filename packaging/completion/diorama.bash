# SPDX-License-Identifier: Apache-2.0
# Completion for bash: commands, options, job files and component types.
_diorama() {
  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}
  local commands="run config plugins inspect render export lint schema doctor docs new-plugin"
  local options="--help --set --seed --threads --output --plugin-dir --assets-root --log-level"
  case $previous in
    --plugin-dir | --assets-root | --output) mapfile -t COMPREPLY < <(compgen -d -- "$current"); return ;;
    --log-level) mapfile -t COMPREPLY < <(compgen -W "debug info warning error" -- "$current"); return ;;
    new-plugin) mapfile -t COMPREPLY < <(compgen -W "loader physics randomizer renderer annotator writer" -- "$current"); return ;;
  esac
  if ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W "$commands --help --version" -- "$current")
  elif [[ $current == -* ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$options --json --resume --shard --dry-run" -- "$current")
  else
    mapfile -t COMPREPLY < <(compgen -f -- "$current")
  fi
}
complete -o filenames -F _diorama diorama
