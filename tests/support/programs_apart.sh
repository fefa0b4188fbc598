# For tests of whole programs; run_*.sh read it. It knows neither programs nor what they do.

# Skips the test where one of these commands is missing.
needs() { # TEST COMMAND...
  local test=$1 command
  shift
  for command in "$@"; do
    command -v "$command" >/dev/null && continue
    echo "$test: SKIPPED: $command is missing"
    exit 77
  done
}

# Makes the folder anew and goes there. Programs keep their state in it, apart from everybody's.
go_apart() { # FOLDER
  rm -rf "$1"
  mkdir -p "$1/run"
  chmod 700 "$1/run"
  cd "$1"
  export XDG_STATE_HOME=$1/state XDG_RUNTIME_DIR=$1/run
}
