# Completion of the dofusion programs for bash: options as --help lists them, an option's choices, names of files.
# Installed for bash-completion; from a build folder: source apps/completion.bash
_dofusion() {
  local program=${COMP_WORDS[0]} word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} help choices
  help=$("$program" --help 2>/dev/null)
  choices=$(sed -nE "s/^ *(-[a-z],)?$before [A-Z]+:\{([^}]*)\}.*/\2/p" <<<"$help" | tr ',' ' ')
  if [[ -n $choices ]]; then
    COMPREPLY=($(compgen -W "$choices" -- "$word"))
  elif [[ $word == -* ]]; then
    COMPREPLY=($(compgen -W "$(grep -oE '^ +(-[a-z],)?--[a-z0-9-]+' <<<"$help" | grep -oE -- '--[a-z0-9-]+')" -- "$word"))
  else
    COMPREPLY=($(compgen -f -- "$word"))
  fi
}
complete -o filenames -F _dofusion dofusion-evaluate dofusion-generate dofusion-place dofusion-scan dofusion-settle \
  dofusion-study dofusion-train
