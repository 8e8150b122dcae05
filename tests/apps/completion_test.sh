#!/usr/bin/env bash
# completion_test.sh COMPLETION BIN: what bash offers after some words.
set -euo pipefail
source "$1"
PATH=$2:$PATH
offered() {  # of the last word
  COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMPREPLY=()
  _dofusion
  printf '%s ' "${COMPREPLY[@]}"
}
expect() {  # what is offered for the words
  local wanted=$1 got
  shift
  got=$(offered "$@")
  [[ $got == "$wanted " ]] || { echo "for '$*': '$got', not '$wanted'"; exit 1; }
}
expect '--noise-scale' dofusion-scan --noi
expect 'stack-one stack-two' dofusion-evaluate --table stack-
expect 'unstructured' dofusion-train --task uns
expect '--samples' dofusion-place --sam
cd "$(dirname "$1")"
expect 'completion.bash' dofusion-place --depth completion.
echo passed
