#!/usr/bin/env bash
# run_relays.sh BUILD OUT: a session that one relay publishes over a real NATS, and two relays that take it
# from there, one of them late. NATS is killed and started again, and then the relay that publishes is
# killed, while another one waits for that. Those who watch show the server's last picture in the end.
#
# Exit code 77: nats-server is missing, or the programs were built without NATS.
set -euo pipefail
. "$(dirname "$0")/../support/programs_apart.sh"
bin=$(cd "$1/bin" && pwd) out=$(realpath -m "$2") scenes=$(cd "$(dirname "$0")/../../deploy/scenes" && pwd)
needs relays nats-server
go_apart "$out"
port=17910
url=nats://127.0.0.1:$port
declare -A pids
cleanup() {
  local pid
  for pid in "${pids[@]}"; do kill -KILL "$pid" 2>/dev/null || true; done
}
trap cleanup EXIT
fail() {
  echo "relays: $*"
  tail -n 20 ./*.log
  exit 1
}
start() { # NAME PROGRAM ARGUMENTS...
  "$bin/$2" "${@:3}" >>"$1.log" 2>&1 &
  pids[$1]=$!
}
killed() { # NAME
  kill -KILL "${pids[$1]}"
  wait "${pids[$1]}" || true
  unset "pids[$1]"
}
ended() { # NAME
  local code=0
  wait "${pids[$1]}" || code=$?
  unset "pids[$1]"
  [ $code = 0 ] || fail "$1 ended with $code"
}
start_nats() {
  nats-server -c nats.conf >>nats.log 2>&1 &
  pids[nats]=$!
}
wait_for() { # WORDS FILE [TIMES]
  for _ in $(seq 600); do
    [ "$(grep -cs -- "$1" "$2")" -ge "${3:-1}" ] && return
    sleep 0.1
  done
  fail "$2 never says '$1'"
}
lines() { # WORDS FILE
  grep -cs -- "$1" "$2" || true
}
wait_for_another() { # WORDS FILE BEFORE
  wait_for "$1" "$2" $(($3 + 1))
}
start_relay() { # NAME ARGUMENTS...
  start "$1" trocar-relay --listen 127.0.0.1:0 --ready-file "$1.port" --name "$1" --nats $url "${@:2}"
}
ready() { # NAME
  for _ in $(seq 600); do
    [ -s "$1.port" ] && return
    if grep -qs 'built without NATS' "$1.log"; then
      echo "relays: SKIPPED: built without NATS"
      exit 77
    fi
    kill -0 "${pids[$1]}" 2>/dev/null || fail "$1 has ended"
    sleep 0.1
  done
  fail "$1 does not start"
}
watch() { # NAME RELAY
  start "$1" trocar-client --no-render --name "$1" --role observer --server "127.0.0.1:$(cat "$2.port")" --summary "$1.json"
}

# A larger message goes in pieces. Publishers and takers have the rights that docs/security.md names.
cat >nats.conf <<CONFIG
listen: "127.0.0.1:$port"
max_payload: 16384
authorization { users: [
  { user: publisher, password: "one", permissions: {
      publish: ["trocar.session.monday.stream", "trocar.session.monday.to.*"],
      subscribe: ["trocar.session.monday.stream", "trocar.session.monday.ask"] } }
  { user: relay, password: "two", permissions: {
      publish: "trocar.session.monday.ask",
      subscribe: ["trocar.session.monday.stream", "trocar.session.monday.to.*"] } } ] }
CONFIG
umask 077
echo publisher:one >publisher
echo relay:two >relay
start server trocar-server --organ lattice --listen 127.0.0.1:0 --ready-file server.port --journal none --summary server.json
ready server
code=$(sed -n 's/^ *observer *\([0-9A-Z-]*\) .*/\1/p' server.log | head -n 1)
server=127.0.0.1:$(cat server.port)
start_nats

# Who takes a session waits for who publishes it.
start_relay early --from-nats monday --code "$code" --nats-creds relay
start_relay first --to "$server" --publish monday --nats-creds publisher
ready first
ready early
start_relay spare --to "$server" --publish monday --nats-creds publisher
ready spare
start hand trocar-client --no-render --name Sam --server "$server" --script "$scenes/slices.toml"
watch Ann early
wait_for 'watchers here' early.log
start_relay late --from-nats monday --code "$code" --nats-creds relay
ready late
watch Ben late
wait_for 'watchers here' late.log

still=$(lines 'stands still' early.log)
back_early=$(lines 'back in the session' early.log) back_late=$(lines 'back in the session' late.log)
killed nats
wait_for_another 'stands still' early.log "$still"
start_nats
wait_for_another 'back in the session' early.log "$back_early"
wait_for_another 'back in the session' late.log "$back_late"

# Either of the two publishes now.
publisher=
for _ in $(seq 300); do
  for name in first spare; do
    grep ' publishes ' $name.log | tail -n 1 | grep -q 'info publishes the session' && publisher=$name
  done
  [ -z "$publisher" ] || break
  sleep 0.1
done
[ -n "$publisher" ] || fail "nobody publishes"
spare=spare
[ $publisher = first ] || spare=first
publishes=$(lines 'info publishes the session' $spare.log)
declare -A still_of back_of
for name in early late; do
  still_of[$name]=$(lines 'stands still' $name.log) back_of[$name]=$(lines 'back in the session' $name.log)
done
killed $publisher
wait_for_another 'info publishes the session' $spare.log "$publishes"
for name in early late; do
  wait_for_another 'stands still' $name.log "${still_of[$name]}"
  wait_for_another 'back in the session' $name.log "${back_of[$name]}"
done

# A session that nobody publishes is an error, and so is one whose subjects this user may not have.
code_of=0
"$bin/trocar-relay" --from-nats tuesday --nats $url --nats-creds relay --code "$code" --listen 127.0.0.1:0 --log-level warn >said 2>&1 || code_of=$?
[ $code_of = 5 ] && grep -q 'nobody publishes the session tuesday' said && grep -q 'says: .*trocar.session.tuesday' said ||
  fail "nobody's session: $code_of, $(cat said)"

kill -TERM "${pids[server]}"
for name in server hand Ann Ben early late $spare; do ended $name; done
for name in Ann Ben; do
  grep -q '"equal": true' $name.json || fail "$name shows another picture: $(cat $name.json)"
  grep -q '"crc_mismatches": 0' $name.json || fail "$name had wrong pictures: $(cat $name.json)"
done
grep -q '"all_replicas_equal": true' server.json || fail "not all pictures are equal: $(cat server.json)"
