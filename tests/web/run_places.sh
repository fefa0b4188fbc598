#!/usr/bin/env bash
# run_places.sh BUILD OUT: observers in browsers who come until there is no place left leave some, so that
# an instructor's browser still gets in.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
. "$here/../support/programs_apart.sh"
bin=$(cd "$1/bin" && pwd)
needs places python3
go_apart "$2"
trap 'kill $server $web 2>/dev/null || true' EXIT
wait_for() { # FILE
  for _ in $(seq 400); do
    if [ -s "$1" ]; then return; fi
    sleep 0.05
  done
  echo "places: $1 does not come"
  exit 1
}
mkdir page
echo '<html>' >page/index.html
"$bin/trocar-server" --listen 127.0.0.1:0 --no-announce --journal none --organ lattice --state state \
  --ready-file server-ready >server.log 2>&1 &
server=$!
wait_for server-ready
"$bin/trocar-web" --insecure-loopback --listen 127.0.0.1:0 --page page --state web-state \
  --session "127.0.0.1:$(cat server-ready)" --max-connections 20 --max-connections-per-address 20 \
  --ready-file web-ready >web.log 2>&1 &
web=$!
wait_for web-ready
code() { sed -n "s/^ *$1 *\([^ ]*\) .*/\1/p" server.log; }
python3 "$here/fill_page.py" "$(cat web-ready)" "$(code observer)" "$(code instructor)"
echo "places: ok"
