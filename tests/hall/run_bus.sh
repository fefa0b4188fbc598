#!/usr/bin/env bash
# run_bus.sh BUILD OUT: two halls and a real NATS. A session starts on the hall with the most room, all
# sessions are on one list, and when NATS is killed and started again they go on and are found again.
#
# Exit code 77: nats-server or curl is missing, or the programs were built without NATS.
set -euo pipefail
. "$(dirname "$0")/../support/programs_apart.sh"
bin=$(cd "$1/bin" && pwd) out=$2
needs bus nats-server curl
go_apart "$out"
port=17790
url=nats://127.0.0.1:$port
nats=
halls=()
cleanup() {
  local pid
  for pid in "${halls[@]}" $nats; do kill "$pid" 2>/dev/null || true; done
  for pid in $(sed -n 's/.*"pid": \([1-9][0-9]*\).*/\1/p' */hall-state/sessions.json 2>/dev/null); do
    kill -KILL "$pid" 2>/dev/null || true
  done
}
trap cleanup EXIT
fail() {
  echo "bus: $*"
  tail -n 20 ./*.log ./*/*.log 2>/dev/null || true
  exit 1
}
start_nats() {
  nats-server -a 127.0.0.1 -p $port >>nats.log 2>&1 &
  nats=$!
}
# Asks until the words are there.
wait_for() { # SECONDS WORDS COMMAND...
  local seconds=$1 words=$2
  shift 2
  for _ in $(seq $((seconds * 2))); do
    "$@" 2>/dev/null | grep -q -- "$words" && return
    sleep 0.5
  done
  fail "'$*' never says '$words': $("$@" 2>&1 || true)"
}
start_hall() { # NAME BASE CORES
  mkdir -p "$1"
  printf '%s\n' 'listen = "127.0.0.1:0"' 'most-sessions = 5' 'key = "../hall.key"' 'recordings = "recordings"' 'state = "hall-state"' \
    "ports = [$2, $(($2 + 4))]" "figures-ports = [$(($2 + 5)), $(($2 + 9))]" "cores = $3" '[[offer]]' \
    'name = "lattice"' 'organ = "lattice"' 'cores = 0.8' >"$1/hall.toml"
  (cd "$1" && exec "$bin/trocar-hall" --config hall.toml --ready-file ready --nats $url 2>>hall.log) &
  halls+=($!)
  for _ in $(seq 200); do
    [ -s "$1/ready" ] && return
    sleep 0.05
  done
  if grep -q 'built without NATS' "$1/hall.log"; then
    echo "bus: SKIPPED: built without NATS"
    exit 77
  fi
  fail "the hall $1 does not start"
}
on_bus() { "$bin/trocar-hall" "$1" "${@:2}" --nats $url --key hall.key; }
at_hall() { curl -s "http://127.0.0.1:$(cat "$1/ready")/sessions"; }

# Halls are there before their NATS.
start_hall small 17770 1
start_hall large 17780 2
start_nats
wait_for 30 '2.00 cores' on_bus list
wait_for 30 '1.00 cores' on_bus list
# 2.0 and 1.0 cores are free, then 1.2 and 1.0, then 0.4 and 1.0, then 0.4 and 0.2.
for name in one two three; do
  on_bus start lattice --name $name >$name || fail "no start of $name"
  grep -qE 'surgeon +[0-9A-Z]{4}-' $name || fail "no code: $(cat $name)"
done
grep -q 'running at 127.0.0.1:1778' one || fail "one is not where the most room is: $(cat one)"
grep -q 'running at 127.0.0.1:1778' two || fail "two is not where the most room is: $(cat two)"
grep -q 'running at 127.0.0.1:1777' three || fail "three is not where the most room is: $(cat three)"
code=0
on_bus start lattice 2>said || code=$?
[ $code = 4 ] && grep -q 'needs 0.80 cores' said || fail "a fourth one: $code, $(cat said)"
code=0
on_bus start spleen 2>said || code=$?
[ $code = 4 ] && grep -q 'no hall that answers may start it' said || fail "no such lesson: $code, $(cat said)"
[ "$(on_bus list | grep -cE '^(one|two|three) .*running')" = 3 ] || fail "not all are listed: $(on_bus list)"
on_bus list | grep -qE '[0-9A-Z]{4}-[0-9A-Z]{4}-' && fail "codes are on the list"
tr '0-9a-f' '1-9a-f0' <hall.key >other.key
chmod 600 other.key
code=0
"$bin/trocar-hall" start lattice --nats $url --key other.key 2>said || code=$?
[ $code = 4 ] && grep -q 'the key is wrong' said || fail "another key: $code, $(cat said)"
code=0
"$bin/trocar-hall" list --nats $url --key other.key >listed 2>said || code=$?
[ $code = 4 ] && grep -q '^one .*running' listed && [ "$(grep -o 'the key is wrong' said | wc -l)" = 2 ] ||
  fail "a list with another key: $code, $(cat said)"
code=0
"$bin/trocar-hall" list --nats foo 2>said || code=$?
[ $code = 2 ] && grep -q "'foo' is neither nats://" said || fail "a URL that is none: $code, $(cat said)"

# NATS is killed: the sessions go on, and are found again by themselves.
kill -KILL $nats
wait $nats || true
code=0
on_bus list >said 2>&1 || code=$?
[ $code = 5 ] || fail "a list without NATS: $code, $(cat said)"
at_hall large | grep -q '"state": "running"' || fail "a session has ended with NATS"
start_nats
wait_for 60 '^three .*running' on_bus list
wait_for 60 '^one .*running' on_bus list
on_bus end three >ended || fail "no end"
grep -q '^three: ended, recorded in' ended || fail "$(cat ended)"
on_bus list | grep -q '^three' && fail "three is still on the list"
for pid in "${halls[@]}"; do kill -TERM "$pid"; done
for pid in "${halls[@]}"; do wait "$pid" || fail "a hall ended with $?"; done
halls=()
