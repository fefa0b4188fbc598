#!/usr/bin/env bash
# run_silent.sh BUILD OUT: sockets that say nothing, as many as the page and the hall take, keep nobody
# from asking, and a request for another name gets no page. Exit code 77: curl is missing.
set -euo pipefail
. "$(dirname "$0")/../support/programs_apart.sh"
bin=$(cd "$1/bin" && pwd)
needs silent curl
go_apart "$2"
fail() {
  echo "silent: $*"
  exit 1
}
trap 'kill $web $hall 2>/dev/null || true' EXIT
mkdir page
echo '<html>' >page/index.html
"$bin/trocar-web" --insecure-loopback --listen 127.0.0.1:0 --page page --max-connections 60 \
  --max-connections-per-address 40 --state state --ready-file web-ready >web.log 2>&1 &
web=$!
printf '%s\n' 'listen = "127.0.0.1:0"' 'key = "hall.key"' 'recordings = "recordings"' \
  'state = "hall-state"' 'most-sessions = 3' 'ports = [17770, 17774]' 'figures-ports = [17775, 17779]' '[[offer]]' \
  'name = "lattice"' 'organ = "lattice"' 'cores = 0.4' >hall.toml
"$bin/trocar-hall" --config hall.toml --ready-file hall-ready >hall.log 2>&1 &
hall=$!
for _ in $(seq 200); do
  if [ -s web-ready ] && [ -s hall-ready ]; then break; fi
  sleep 0.05
done
web_port=$(cat web-ready) hall_port=$(cat hall-ready)
status() { curl --silent --max-time 10 --output /dev/null --write-out '%{http_code}' "$@" || true; }
for _ in $(seq 120); do
  exec {socket}<>"/dev/tcp/127.0.0.1/$web_port" {socket}<>"/dev/tcp/127.0.0.1/$hall_port"
done
for _ in 1 2 3; do
  [ "$(status "http://127.0.0.1:$web_port/")" = 200 ] || fail "the page is shut"
  [ "$(status "http://127.0.0.1:$hall_port/sessions")" = 200 ] || fail "the hall is shut"
done
[ "$(status --header 'Host: evil.example' "http://127.0.0.1:$web_port/")" = 421 ] ||
  fail "another name gets the page"
echo "silent: ok"
