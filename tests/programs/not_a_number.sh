#!/usr/bin/env bash
# Gives "nan" to options of each program that take a number with limits: each refuses it in one line that
# names the option and the limits, with exit code 2. Usage: not_a_number.sh FOLDER_OF_PROGRAMS
set -uo pipefail
bin=${1:?folder of the programs}
failures=0
refuses() { # PROGRAM ARGUMENT...: the option is the last one, without its value.
  local program=$1 option=${!#} said code=0
  [ -x "$bin/$program" ] || { printf 'skipped: %s is not built\n' "$program"; return; }
  said=$("$bin/$program" "${@:2}" nan 2>&1 >/dev/null </dev/null) || code=$?
  if [ "$code" = 2 ] && [ "$(wc -l <<<"$said")" = 1 ] && [[ $said == *"$option"*nan*[0-9]* ]]; then return; fi
  printf '%s nan: exit code %s, and it says:\n%s\n' "$*" "$code" "$said"
  failures=$((failures + 1))
}
refuses trocar-server --budget
refuses trocar-server --seconds
refuses trocar-server --pace
refuses trocar-client --wait
refuses trocar-client --fps
refuses trocar-client --seconds
refuses trocar-client --replay none.mcap --pictures none --rate
refuses trocar-doctor --seconds
refuses trocar-web --seconds
refuses trocar-relay --seconds
refuses trocar-relay --max-watchers
refuses trocar-organ import none.obj --young-modulus
refuses trocar-organ import none.obj --poisson-ratio
refuses trocar-organ edit plate --headless --scale
refuses trocar-sim none.toml --solver fem --step-ms
refuses trocar-sim none.toml --solver fem --bulk-ratio
refuses trocar-journal assess none.mcap --force-limit
refuses trocar-journal assess none.mcap --strain-limit
refuses trocar-igtl --rate
refuses trocar-igtl --nodes
refuses trocar-impair --seconds
refuses trocar-impair --delay
[ "$failures" = 0 ]
