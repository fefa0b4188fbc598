#!/usr/bin/env bash
# run_hall.sh TEST BUILD OUT: whole halls with real servers, as somebody would use them.
#
#   sessions  start, list and end over commands and HTTP; keys; what is refused
#   room      a hall of one core takes what fits and names the numbers of what does not
#   killed    a killed server goes on from its recording; a client comes back; the third time it fails
#   found     a killed hall leaves its sessions running, and the next one finds them
#   signals   a log that nobody reads any more and a closed terminal end nothing out of order
#   full      a hall whose disk is full says so
#   tls       the hall's port over TLS: who knows its certificate gets in, the key goes to no other
#
# Exit code 77: curl is missing, or a client that was not built.
set -euo pipefail
. "$(dirname "$0")/../support/programs_apart.sh"
test=$1 bin=$(cd "$2/bin" && pwd) out=$3
root=$(cd "$(dirname "$0")/../.." && pwd)
needs hall curl
go_apart "$out"
hall=
children=()
# Servers outlive their hall: each is ended by its own id.
cleanup() {
  local pid
  [ -z "$hall" ] || kill "$hall" 2>/dev/null || true
  for pid in "${children[@]}" $(pids); do kill -KILL "$pid" 2>/dev/null || true; done
}
trap cleanup EXIT
fail() {
  echo "hall: $*"
  tail -n 30 hall*.log recordings/*/server.log 2>/dev/null || true
  exit 1
}
pids() { sed -n 's/.*"pid": \([1-9][0-9]*\).*/\1/p' hall-state/sessions.json 2>/dev/null || true; }
# Each test has ports of its own, so that they can run side by side.
case $test in
  sessions) base=17710 ;;
  room) base=17720 ;;
  killed) base=17730 ;;
  found) base=17740 ;;
  tls) base=17750 ;;
  full) base=17700 ;;
  signals) base=17760 ;;
  *) fail "$test: no such test" ;;
esac

configure() { # LINES...
  printf '%s\n' 'listen = "127.0.0.1:0"' 'key = "hall.key"' 'recordings = "recordings"' \
    'state = "hall-state"' "ports = [$base, $((base + 4))]" \
    "figures-ports = [$((base + 5)), $((base + 9))]" 'most-sessions = 3' "$@" >hall.toml
}
lattice='[[offer]]
name = "lattice"
organ = "lattice"
cores = 0.4'
await_hall() {
  for _ in $(seq 200); do
    [ -s ready ] && break
    kill -0 $hall 2>/dev/null || fail "the hall does not start"
    sleep 0.05
  done
  at=127.0.0.1:$(cat ready)
}
start_hall() { # OPTION...
  rm -f ready
  "$bin/trocar-hall" --config hall.toml --ready-file ready "$@" 2>>hall.log &
  hall=$!
  await_hall
}
needs_client() {
  [ -x "$bin/trocar-client" ] && return
  echo "hall: SKIPPED in part: trocar-client is not built"
  exit 77
}
# Asks until the words are there.
wait_for() { # SECONDS WORDS COMMAND...
  local seconds=$1 words=$2
  shift 2
  for _ in $(seq $((seconds * 5))); do
    "$@" 2>/dev/null | grep -q -- "$words" && return
    sleep 0.2
  done
  fail "'$*' never says '$words': $("$@" 2>&1 || true)"
}
list() { "$bin/trocar-hall" list --at "$at" --key hall.key "$@"; }
field() { # SESSION FIELD: of GET /sessions/NAME
  curl -s "http://$at/sessions/$1" | sed -n "s/^  \"$2\": \"\{0,1\}\([^\",]*\).*/\1/p"
}
status() { curl -s -o answer -w '%{http_code}' "$@"; }

test_sessions() {
  configure 'cores = 100' "$lattice" '[[offer]]' 'name = "rings"' 'lesson = "move-the-rings"'
  "$bin/trocar-hall" --config hall.toml --check-config | grep -q fine || fail "the file is not fine"
  [ ! -e hall-state ] || fail "a check has made something"
  # What a start would refuse.
  : >file
  mkdir -m 755 open
  refuses() { # WORDS SED_COMMAND
    sed "$2" hall.toml >bad.toml
    code=0
    "$bin/trocar-hall" --config bad.toml --check-config >said 2>&1 || code=$?
    [ $code = 2 ] && grep -q -- "$1" said && [ "$(wc -l <said)" = 1 ] || fail "'$2': $code, $(cat said)"
  }
  refuses 'key key: .*file' 's|^key = .*|key = "file/x"|'
  refuses 'key recordings: file' 's|^recordings = .*|recordings = "file"|'
  refuses 'key state: file' 's|^state = .*|state = "file"|'
  refuses 'chmod 700' 's|^state = .*|state = "open"|'
  refuses 'key sessions-listen' '1i sessions-listen = "nowhere"'
  mkdir -m 700 damaged
  (umask 077; echo '{' >damaged/sessions.json)
  refuses 'is damaged' 's|^state = .*|state = "damaged"|'
  code=0
  "$bin/trocar-hall" start --key file 2>said || code=$?
  [ $code = 2 ] && grep -q 'LESSON: is missing' said || fail "a start of nothing: $code, $(cat said)"
  start_hall --log-format json
  [ "$(stat -c %a hall.key)" = 600 ] || fail "others may read the key"
  [ "$(curl -s "http://$at/healthz")" = ok ] || fail "it is not healthy"
  "$bin/trocar-hall" start rings --name group-a --at "$at" --key hall.key >started || fail "no start"
  grep -q '^group-a: running at 127.0.0.1:' started || fail "$(cat started)"
  grep -qE 'surgeon +[0-9A-Z]{4}-' started || fail "no code: $(cat started)"
  [ "$(field group-a lesson)" = move-the-rings ] || fail "another lesson"
  [ "$(field group-a organ)" = pegs ] || fail "another organ"
  # Codes are for who has the key.
  curl -s "http://$at/sessions" | grep -q codes && fail "codes without the key"
  list | grep -qE 'surgeon +[0-9A-Z]{4}-' || fail "no codes with the key"
  key=$(cat hall.key)
  post=(-X POST "http://$at/sessions")
  [ "$(status "${post[@]}" -d '{"start":"lattice"}')" = 401 ] || fail "a start without the key"
  [ "$(status "${post[@]}" -H "Authorization: Bearer ${key}0" -d '{"start":"lattice"}')" = 401 ] ||
    fail "a start with a wrong key"
  [ "$(status -X DELETE "http://$at/sessions/group-a")" = 401 ] || fail "an end without the key"
  post+=(-H "Authorization: Bearer $key")
  [ "$(status "${post[@]}" -d '{"start":"spleen"}')" = 409 ] || fail "an unknown organ"
  grep -q 'lattice, rings' answer || fail "it does not say what there is: $(cat answer)"
  [ "$(status "${post[@]}" -d '{"start":"rings","name":"group-a"}')" = 409 ] || fail "a name twice"
  [ "$(status "${post[@]}" -d '{"start":"rings","organ":"liver"}')" = 400 ] || fail "an unknown key"
  head -c 5000 /dev/zero >large
  [ "$(status "${post[@]}" --data-binary @large)" = 413 ] || fail "a large request"
  [ "$(status -X PUT "http://$at/sessions")" = 405 ] || fail "another method"
  [ "$(status "http://$at/../etc/passwd" --path-as-is)" = 404 ] || fail "another path"
  [ "$(status "${post[@]}" -d '{"start":"lattice"}')" = 201 ] || fail "$(cat answer)"
  [ "$(status "${post[@]}" -d '{"start":"lattice"}')" = 201 ] || fail "$(cat answer)"
  [ "$(status "${post[@]}" -d '{"start":"lattice"}')" = 409 ] || fail "more than most-sessions"
  grep -q 'allows 3' answer || fail "$(cat answer)"
  wait_for 60 running list
  curl -s "http://$at/metrics" | grep -q '^trocar_hall_sessions{state="running"}' || fail "no figures"
  # One that stands still is known by its silence.
  first=$(pids | head -n 1)
  kill -STOP "$first"
  wait_for 30 'does not answer for' list
  curl -s "http://$at/metrics" | grep -qE '^trocar_hall_session_silence_seconds.* ([5-9]|[1-9][0-9]+)' ||
    fail "no figure of its silence"
  kill -CONT "$first"
  for _ in $(seq 50); do
    list | grep -q 'does not answer for' || break
    sleep 0.2
  done
  list | grep -q 'does not answer for' && fail "it is called silent although it answers again"
  # A second hall may not have the same state.
  code=0
  "$bin/trocar-hall" --config hall.toml >second.log 2>&1 || code=$?
  [ $code = 5 ] || fail "a second hall: $code, $(cat second.log)"
  "$bin/trocar-hall" end group-a --at "$at" --key hall.key >ended || fail "no end"
  recording=$(sed -n 's/^group-a: ended, recorded in //p' ended)
  "$bin/trocar-journal" verify "$recording" >verified || fail "$(cat verified)"
  list | grep -q group-a && fail "it has not gone"
  code=0
  "$bin/trocar-hall" end group-a --at "$at" --key hall.key 2>said || code=$?
  [ $code = 4 ] || fail "a second end: $code, $(cat said)"
  [ "$(stat -c %a hall-state/audit.jsonl)" = 600 ] || fail "others may read the audit log"
  grep -q '"event":"start","name":"group-a","role":"","address":"127.0.0.1"' hall-state/audit.jsonl &&
    grep -q '"event":"end","name":"group-a"' hall-state/audit.jsonl &&
    grep -q '"reason":"the key is wrong"' hall-state/audit.jsonl || fail "audit: $(cat hall-state/audit.jsonl)"
  kill -TERM $hall
  wait $hall || fail "the hall ended with $?"
  hall=
  grep -v '^{"time":"[^"]*Z","program":"trocar-hall","level":"[a-z]*","message":".*"}$' hall.log &&
    fail "lines of the log that are no objects"
  grep -q '^{"time":.*"program":"trocar-server".*at 127.0.0.1' recordings/*group-a/server.log ||
    fail "the log of a server is not of objects"
  for recording in recordings/*lattice*/session.mcap; do
    "$bin/trocar-journal" verify "$recording" >verified || fail "$(cat verified)"
  done
}

test_room() {
  configure 'cores = 1' "$lattice" '[[offer]]' 'name = "half"' 'organ = "lattice"' 'cores = 0.7'
  start_hall
  "$bin/trocar-hall" start lattice --at "$at" --key hall.key >started || fail "no start"
  code=0
  "$bin/trocar-hall" start half --at "$at" --key hall.key 2>said || code=$?
  [ $code = 4 ] || fail "it was not refused: $code"
  grep -qE 'half needs 0.70 cores, and [0-9.]+ of 1.00 are taken \(lattice-1 [0-9.]+\)' said ||
    fail "$(cat said)"
  # It measures what the session takes.
  wait_for 60 '"peak_cores": [0-9.]*[1-9]' curl -s "http://$at/sessions/lattice-1"
  "$bin/trocar-hall" end lattice-1 --at "$at" --key hall.key >ended || fail "no end"
  "$bin/trocar-hall" start half --at "$at" --key hall.key >started || fail "there is room now"
  grep -q '"measured_cores": {}' hall-state/sessions.json || fail "an idle session tells of its kind"
  "$bin/trocar-hall" end half-1 --at "$at" --key hall.key >ended || fail "no end"
  needs_client
  "$bin/trocar-hall" start lattice --at "$at" --key hall.key >started || fail "no start"
  "$bin/trocar-client" --no-render --name Ada --role surgeon --server "$(field lattice-1 address)" \
    --join "$(sed -n 's/^ *surgeon *\([^ ]*\) .*/\1/p' started)" --script "$root/deploy/scenes/press.toml" \
    --seconds 60 >client.log 2>&1 &
  children+=($!)
  wait_for 60 '"busy_windows": 3' cat hall-state/sessions.json
  "$bin/trocar-hall" end lattice-1 --at "$at" --key hall.key >ended || fail "no end"
  grep -qE '"lattice": 0*\.?[0-9]*[1-9]' hall-state/sessions.json || fail "what a busy one took is not kept"
}

# Kills the server of the only session.
kill_server() {
  local pid
  pid=$(pids)
  [ -n "$pid" ] || fail "no server"
  kill -KILL "$pid"
}

test_killed() {
  configure 'cores = 100' 'restarts = 2' '[[offer]]' 'name = "rings"' 'lesson = "move-the-rings"'
  start_hall
  "$bin/trocar-hall" start rings --at "$at" --key hall.key >started || fail "no start"
  address=$(field rings-1 address)
  code=$(sed -n 's/^ *surgeon *\([^ ]*\) .*/\1/p' started)
  if [ -x "$bin/trocar-client" ]; then
    "$bin/trocar-client" --no-render --name Ada --role surgeon --server "$address" --join "$code" \
      --script "$root/deploy/scenes/lift.toml" --seconds 120 >client.log 2>&1 &
    children+=($!)
    wait_for 60 '"people": 1' curl -s "http://$at/sessions/rings-1"
  fi
  sleep 2
  before=$(field rings-1 ticks)
  kill_server
  wait_for 60 '"restarts": 1' curl -s "http://$at/sessions/rings-1"
  wait_for 60 '"state": "running"' curl -s "http://$at/sessions/rings-1"
  wait_for 60 "\"ticks\": [1-9]" curl -s "http://$at/sessions/rings-1"
  [ "$(field rings-1 ticks)" -gt $((before * 9 / 10)) ] || fail "ticks: $before, then $(field rings-1 ticks)"
  [ "$(field rings-1 address)" = "$address" ] || fail "another address"
  [ "$(field rings-1 organ)" = pegs ] || fail "another organ"
  list | grep -q "$code" || fail "another code"
  if [ -x "$bin/trocar-client" ]; then
    grep -q 'the lesson goes on: Move the rings' recordings/*/server.log || fail "the lesson does not go on"
    wait_for 60 'Ada (surgeon) is back' cat recordings/*/server.log
    "$bin/trocar-client" --no-render --name Bea --role surgeon --server "$address" --join "$code" \
      --seconds 2 >bea.log 2>&1 || fail "the old code is not good: $(cat bea.log)"
  fi
  # Both recordings are one session: the second says after which tick it goes on.
  wait_for 60 session-2.mcap ls recordings/*/
  sleep 2
  kill_server
  wait_for 60 '"restarts": 2' curl -s "http://$at/sessions/rings-1"
  wait_for 60 '"state": "running"' curl -s "http://$at/sessions/rings-1"
  sleep 2
  kill_server
  wait_for 60 '"state": "failed"' curl -s "http://$at/sessions/rings-1"
  list | grep -q 'was killed by signal 9 after 2 restarts' || fail "$(list)"
  cd recordings/*/
  "$bin/trocar-journal" info session-2.mcap --json | grep -q '"file": "session.mcap"' ||
    fail "session-2.mcap does not say what it goes on with"
  "$bin/trocar-journal" verify session-2.mcap >"$out/verified" || [ $? = 6 ] || fail "$(cat "$out/verified")"
  cd "$out"
  "$bin/trocar-hall" end rings-1 --at "$at" --key hall.key >ended || fail "it cannot be forgotten"
  needs_client
}

test_found() {
  configure 'cores = 100' "$lattice"
  start_hall
  "$bin/trocar-hall" start lattice --name one --at "$at" --key hall.key >one || fail "no start"
  "$bin/trocar-hall" start lattice --name two --at "$at" --key hall.key >two || fail "no start"
  before=$(pids | sort)
  kill -KILL $hall
  wait $hall || true
  sleep 1
  for pid in $before; do kill -0 "$pid" || fail "a server has ended with its hall"; done
  # One server dies while no hall looks, and its place in the table of processes is no server's.
  killed=$(sed -n '/"name": "two"/,/started_at/s/.*"pid": \([0-9]*\).*/\1/p' hall-state/sessions.json)
  kill -KILL "$killed"
  sleep 1
  start_hall
  wait_for 60 '"state": "running"' curl -s "http://$at/sessions/one"
  wait_for 60 '"state": "running"' curl -s "http://$at/sessions/two"
  [ "$(field one restarts)" = 0 ] || fail "one was started again"
  list | grep -qE '^[01]\.[0-9]* of 100.00 cores' || fail "the cores of the offers are forgotten: $(list)"
  [ "$(field two restarts)" = 1 ] || fail "two was not started again"
  pids | grep -qx "$(grep -vx "$killed" <<<"$before")" || fail "one is another process"
  # State files of before do not say it: then the configuration does.
  kill -KILL $hall
  wait $hall || true
  jq 'del(.sessions[].start.cores)' hall-state/sessions.json >earlier
  cat earlier >hall-state/sessions.json
  start_hall
  wait_for 60 '"state": "running"' curl -s "http://$at/sessions/one"
  list | grep -qE '^[01]\.[0-9]* of 100.00 cores' || fail "the configuration's cores are not used: $(list)"
  list | grep -q "$(sed -n 's/^ *surgeon *\([^ ]*\) .*/\1/p' one)" || fail "its codes are not known"
  "$bin/trocar-hall" end one --at "$at" --key hall.key >ended || fail "no end"
  "$bin/trocar-journal" verify recordings/*-one/session.mcap >verified || fail "$(cat verified)"
  kill -TERM $hall
  wait $hall || fail "the hall ended with $?"
  hall=
  "$bin/trocar-journal" verify recordings/*-two/session-2.mcap >verified || fail "$(cat verified)"
}

wait_for_file() { # FILE
  for _ in $(seq 200); do
    [ -s "$1" ] && return
    sleep 0.05
  done
  fail "$1 does not come"
}

test_signals() {
  configure 'cores = 100' "$lattice"
  env --default-signal=HUP "$bin/trocar-hall" --config hall.toml --ready-file ready 2> >(head -n 1 >first.log) &
  hall=$!
  wait_for_file first.log
  wait_for_file ready
  at=127.0.0.1:$(cat ready)
  "$bin/trocar-hall" start lattice --name one --at "$at" --key hall.key >started || fail "no start"
  "$bin/trocar-hall" start lattice --name two --at "$at" --key hall.key >started || fail "no start"
  kill -HUP $hall
  kill -HUP $hall 2>/dev/null || true
  wait $hall || fail "the hall ended with $?"
  hall=
  for recording in recordings/*/session.mcap; do
    "$bin/trocar-journal" verify "$recording" >verified || fail "$(cat verified)"
  done
  # The same of a server, which leaves no link file with codes behind.
  env --default-signal=HUP "$bin/trocar-server" --organ lattice --listen 127.0.0.1:0 --no-announce \
    --journal pipe.mcap --summary pipe.json --ready-file server.port > >(head -n 1 >server.first) 2>&1 &
  local server=$!
  children+=($server)
  wait_for_file server.first
  wait_for_file server.port
  sleep 1
  kill -HUP $server
  wait $server || fail "the server ended with $?"
  [ -s pipe.json ] || fail "no summary"
  [ -z "$(ls "$XDG_RUNTIME_DIR/trocar")" ] || fail "codes stay: $(ls "$XDG_RUNTIME_DIR/trocar")"
  "$bin/trocar-journal" verify pipe.mcap >verified || fail "$(cat verified)"
  # Under nohup a program outlives its terminal.
  rm -f ready
  nohup "$bin/trocar-hall" --config hall.toml --ready-file ready 2>>hall.log >/dev/null &
  hall=$!
  wait_for_file ready
  kill -HUP $hall
  sleep 1
  kill -TERM $hall 2>/dev/null || fail "it has ended, though SIGHUP is ignored"
  wait $hall || fail "the hall ended with $?"
  hall=
}

test_full() {
  unshare -rm true 2>/dev/null || { echo "hall: SKIPPED: no file system can be mounted here"; exit 77; }
  configure 'cores = 100' "$lattice"
  mkdir recordings
  # The small disk is seen by the hall alone.
  unshare -rm bash -c 'mount -t tmpfs -o size=64k small recordings && { cat /dev/zero >recordings/all 2>/dev/null || true; } &&
    exec "$0" --config hall.toml --ready-file ready' "$bin/trocar-hall" 2>>hall.log &
  hall=$!
  await_hall
  code=0
  "$bin/trocar-hall" start lattice --at "$at" --key hall.key >said 2>&1 || code=$?
  [ $code = 4 ] && grep -q 'recordings/.*cannot be written (No space left' said || fail "$code, $(cat said)"
  kill -TERM $hall
  wait $hall || fail "the hall ended with $?"
  hall=
}

# An authority that the machine trusts, and a program with its certificate that writes down what it is sent.
certificates() {
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=ours -keyout ca.key -out ca.pem 2>/dev/null
  openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj /CN=localhost -keyout other.key -out other.csr 2>/dev/null
  printf 'subjectAltName=DNS:localhost\n' >other.ext
  openssl x509 -req -in other.csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 -extfile other.ext -out other.pem 2>/dev/null
  local port=$((base + 9)) wait
  openssl s_server -quiet -accept 127.0.0.1:$port -cert other.pem -key other.key < <(sleep 60) >heard 2>openssl.log &
  children+=($!)
  for wait in $(seq 100); do (exec 4<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null && break; sleep 0.05; done
  refused 4 'another certificate' list --at https://localhost:$port --certificate $certificate --key hall.key
  SSL_CERT_FILE=ca.pem refused 4 'of another host' list --at https://127.0.0.1:$port --key hall.key
  [ ! -s heard ] || fail "it was sent to who cannot show the certificate: $(cat heard)"
  # Who may be trusted is asked, with the key; it never answers.
  (SSL_CERT_FILE=ca.pem ask list --at https://localhost:$port --key hall.key >said 2>&1 || true) &
  children+=($!)
  for wait in $(seq 100); do grep -q "Bearer $(cat hall.key)" heard && return; sleep 0.05; done
  fail "it was not asked: $(cat said openssl.log)"
}

test_tls() {
  configure 'cores = 100' 'tls = true' "$lattice"
  "$bin/trocar-hall" --config hall.toml --check-config | grep -q fine || fail "the file is not fine"
  [ ! -e hall-state ] || fail "a check has made something"
  start_hall
  plain=$at at=https://$at certificate=hall-state/tls/hall.crt
  ask() { "$bin/trocar-hall" "$@"; }
  known=(--at "$at" --certificate $certificate --key hall.key)
  # Who says nothing holds nobody up.
  exec 3<>"/dev/tcp/127.0.0.1/${plain#*:}"
  ask start lattice "${known[@]}" >started || fail "no start"
  grep -qE 'surgeon +[0-9A-Z]{4}-' started || fail "no code: $(cat started)"
  curl -s --cacert $certificate "$at/sessions" | grep -q lattice-1 || fail "curl is not answered"
  curl -s --max-time 5 "http://$plain/sessions" && fail "it answers without TLS"
  refused() { # EXIT_CODE WORDS COMMAND...
    local expected=$1 words=$2 code=0
    shift 2
    ask "$@" >said 2>&1 || code=$?
    [ $code = "$expected" ] && grep -q -- "$words" said && [ "$(wc -l <said)" = 1 ] || fail "'$*': $code, $(cat said)"
  }
  refused 4 'nobody whom this machine trusts' list --at "$at"
  refused 4 'another certificate' list --at "$at" --certificate hall-state/server/server.crt --key hall.key
  refused 5 'no hall answers' list --at "$plain"
  refused 3 'holds no certificate' list --at "$at" --certificate hall.key
  refused 2 'give --at https://' list --at "$plain" --certificate $certificate
  # The key goes to nobody who cannot show the certificate, and to no other machine in the open.
  refused 2 'give --at https://' list --at 192.0.2.2:7694 --key hall.key
  if command -v openssl >/dev/null; then certificates; fi
  cp $certificate before.crt
  kill -KILL $hall
  wait $hall || true
  start_hall
  cmp before.crt $certificate || fail "another certificate after a restart"
  ask end lattice-1 --at "https://$at" --certificate $certificate --key hall.key >ended || fail "no end"
  # A certificate of one's own, named for the hall.
  kill -TERM $hall
  wait $hall || fail "the hall ended with $?"
  hall=
  configure 'tls = true' 'certificate = "missing.crt"' 'certificate-key = "missing.key"' "$lattice"
  refused 2 'missing.crt' --config hall.toml --check-config
  cp hall-state/tls/hall.key before.key
  chmod 644 before.key
  configure 'tls = true' 'certificate = "before.crt"' 'certificate-key = "before.key"' "$lattice"
  start_hall
  grep -q 'before.key: others on this machine can read this key' hall.log || fail "no word of an open key"
  ask list --at "https://$at" --certificate before.crt >said || fail "$(cat said)"
}

"test_$test"
