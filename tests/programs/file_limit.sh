#!/usr/bin/env bash
# Each program that writes files meets a limit of file sizes as a full disk: exit code 5, one line, and no
# half of a file. Usage: file_limit.sh FOLDER_OF_PROGRAMS
set -uo pipefail
bin=${1:?folder of the programs}
folder=$(mktemp -d)
trap 'rm -r "$folder"' EXIT
cd "$folder" || exit 1
failures=0
fails() { # PROGRAM ARGUMENT...
  local before code=0 said
  before=$(ls)
  said=$( (ulimit -f 2; exec "$bin/$1" "${@:2}") 2>&1 >/dev/null </dev/null) || code=$?
  if [ "$code" = 5 ] && [ "$(grep -c 'cannot' <<<"$said")" = 1 ] && [ "$(ls)" = "$before" ]; then return; fi
  printf '%s: exit code %s, it left %s, and it says:\n%s\n' "$*" "$code" "$(ls | tr '\n' ' ')" "$said"
  failures=$((failures + 1))
}
"$bin/trocar-organ" make plate --out plate.organ >/dev/null || exit 1
"$bin/trocar-server" --organ plate --seconds 1 --no-announce --insecure-loopback --listen 127.0.0.1:0 \
  --journal whole.mcap --state state --log-level off >/dev/null || exit 1
fails trocar-organ make plate --out made.organ
fails trocar-organ export plate.organ --out plate.vtu
fails trocar-journal anonymise whole.mcap shared.mcap
fails trocar-journal trim whole.mcap --from 0 --to 0.5 part.mcap
exit "$((failures > 0))"
