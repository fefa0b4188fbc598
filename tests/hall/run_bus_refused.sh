#!/usr/bin/env bash
# run_bus_refused.sh BUILD OUT: a hall whose user a real NATS refuses for a while, and then lets in again. The
# hall comes back by itself, and its log says once what is wrong. Likewise where NATS comes after the hall,
# and refuses it first.
#
# Exit code 77: nats-server is missing, or the programs were built without NATS.
set -euo pipefail
. "$(dirname "$0")/../support/programs_apart.sh"
bin=$(cd "$1/bin" && pwd) out=$2
needs bus_refused nats-server
go_apart "$out"
port=17865
url=nats://127.0.0.1:$port
nats='' hall=''
cleanup() {
  local pid
  for pid in $hall $nats; do kill "$pid" 2>/dev/null || true; done
}
trap cleanup EXIT
fail() {
  echo "bus_refused: $*"
  tail -n 20 ./*.log
  exit 1
}
write_config() { # PASSWORD
  printf '%s\n' "listen: \"127.0.0.1:$port\"" "authorization { user: ada, password: \"$1\" }" >nats.conf
}
start_nats() {
  nats-server -c nats.conf >>nats.log 2>&1 &
  nats=$!
}
start_hall() {
  rm -f ready
  "$bin/trocar-hall" --config hall.toml --ready-file ready --nats $url --nats-creds creds 2>>hall.log &
  hall=$!
  for _ in $(seq 200); do
    [ -s ready ] && return
    sleep 0.05
  done
  if grep -q 'built without NATS' hall.log; then
    echo "bus_refused: SKIPPED: built without NATS"
    exit 77
  fi
  fail "the hall does not start"
}
wait_for() { # WORDS TIMES
  for _ in $(seq 300); do
    [ "$(grep -c -- "$1" hall.log)" -ge "$2" ] && return
    sleep 0.1
  done
  fail "the hall does not say '$1' for the $2. time"
}
found() {
  for _ in $(seq 60); do
    "$bin/trocar-hall" list --nats $url --nats-creds "$1" 2>&1 | grep -q '3.00 cores' && return
    sleep 0.5
  done
  fail "the hall is not found: $("$bin/trocar-hall" list --nats $url --nats-creds "$1" 2>&1)"
}

printf '%s\n' 'listen = "127.0.0.1:0"' 'key = "hall.key"' 'recordings = "recordings"' 'state = "hall-state"' \
  'ports = [17890, 17893]' 'figures-ports = [17894, 17897]' 'most-sessions = 4' 'cores = 3' '[[offer]]' 'name = "lattice"' 'organ = "lattice"' >hall.toml
umask 077
echo 'ada:right' >creds
echo 'ada:other' >other
write_config right
start_nats
for _ in $(seq 200); do
  (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null && break
  sleep 0.05
done
start_hall
found creds

# The password is another one for longer than it takes to be refused several times: after 0, 0.25, 0.75,
# 1.75 s and so on.
write_config other
kill -HUP "$nats"
wait_for 'does not let in who is in creds' 1
refusals() { grep -c 'authentication error' nats.log || true; }
for _ in $(seq 300); do
  [ "$(refusals)" -ge 4 ] && break
  sleep 0.1
done
[ "$(refusals)" -ge 4 ] || fail "the hall has given up"
[ "$(grep -c 'does not let in' hall.log)" = 1 ] || fail "that is said more than once"
write_config right
kill -HUP "$nats"
wait_for 'is there' 1
found creds

# NATS comes after the hall, and refuses it.
kill -TERM "$hall"
wait "$hall" || fail "the hall ended with $?"
kill "$nats"
wait "$nats" || true
start_hall
wait_for 'no NATS answers' 1
write_config other
start_nats
wait_for 'does not let in who is in creds' 2
write_config right
kill -HUP "$nats"
wait_for 'is there' 2
found creds
kill -TERM "$hall"
wait "$hall" || fail "the hall ended with $?"
hall=''
