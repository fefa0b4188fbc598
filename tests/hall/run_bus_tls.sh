#!/usr/bin/env bash
# run_bus_tls.sh BUILD OUT: a hall and a real NATS with TLS and a user. Who has the certificate's authority and
# the user's file gets in, also after NATS was killed; all others are refused in one line.
#
# Exit code 77: nats-server or openssl is missing, or the programs were built without NATS.
set -euo pipefail
. "$(dirname "$0")/../support/programs_apart.sh"
bin=$(cd "$1/bin" && pwd) out=$2
needs bus_tls nats-server openssl
go_apart "$out"
port=17860 plain_port=17861
nats=() hall=
cleanup() {
  local pid
  for pid in $hall "${nats[@]}"; do kill "$pid" 2>/dev/null || true; done
}
trap cleanup EXIT
fail() {
  echo "bus_tls: $*"
  tail -n 20 ./*.log 2>/dev/null || true
  exit 1
}
make_authority() { # NAME
  openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj "/CN=$1" \
    -keyout "$1.key" -out "$1.pem" 2>/dev/null
}
make_certificate() { # NAME ALTERNATIVE_NAME
  openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj "/CN=$1" -keyout "$1.key" -out "$1.csr" 2>/dev/null
  printf 'subjectAltName=%s\n' "$2" >"$1.ext"
  openssl x509 -req -in "$1.csr" -CA ours.pem -CAkey ours.key -CAcreateserial -days 2 -extfile "$1.ext" -out "$1.pem" 2>/dev/null
}
start_nats() { # CONFIG
  nats-server -c "$1" >>nats.log 2>&1 &
  nats+=($!)
}
write_config() { # FILE PORT CERTIFICATE
  printf '%s\n' "listen: \"127.0.0.1:$2\"" 'authorization { user: ada, password: "se:cret" }' >"$1"
  [ -z "$3" ] || printf '%s\n' "tls { cert_file: \"$3.pem\", key_file: \"$3.key\" }" >>"$1"
}
list() { "$bin/trocar-hall" list --nats "$@"; }
refused() { # CODE WORDS ARGUMENTS...
  local code=0 expected=$1 words=$2
  shift 2
  list "$@" >said 2>&1 || code=$?
  [ $code = "$expected" ] && grep -q -- "$words" said && [ "$(wc -l <said)" = 1 ] || fail "list --nats $*: $code, $(cat said)"
  ! grep -q 'cret' said || fail "a password is shown: $(cat said)"
}
wait_for_port() {
  for _ in $(seq 200); do
    (exec 3<>"/dev/tcp/127.0.0.1/$1") 2>/dev/null && return
    sleep 0.05
  done
  fail "no NATS at $1"
}

make_authority ours
make_authority theirs
make_certificate server DNS:localhost,IP:127.0.0.1
make_certificate elsewhere DNS:elsewhere.example
write_config tls.conf $port server
write_config plain.conf $plain_port ''
umask 077
echo 'ada:se:cret' >creds
echo 'ada:wrong-cret' >wrong
start_nats tls.conf
start_nats plain.conf
wait_for_port $port
wait_for_port $plain_port

printf '%s\n' 'listen = "127.0.0.1:0"' 'key = "hall.key"' 'recordings = "recordings"' 'state = "hall-state"' \
  'ports = [17870, 17877]' 'figures-ports = [17880, 17887]' 'cores = 3' '[[offer]]' 'name = "lattice"' 'organ = "lattice"' >hall.toml
start_hall() {
  rm -f ready
  "$bin/trocar-hall" --config hall.toml --ready-file ready --nats "$@" 2>>hall.log &
  hall=$!
}
url=tls://localhost:$port
start_hall $url --nats-ca ours.pem --nats-creds creds
for _ in $(seq 200); do
  [ -s ready ] && break
  sleep 0.05
done
if grep -q 'built without NATS' hall.log; then
  echo "bus_tls: SKIPPED: built without NATS"
  exit 77
fi
[ -s ready ] || fail "the hall does not start"
found() { list "$@" --nats-ca ours.pem --nats-creds creds 2>&1 | grep -q '3.00 cores'; }
found $url || fail "the hall is not found: $(list $url --nats-ca ours.pem --nats-creds creds 2>&1)"
found tls://127.0.0.1:$port || fail "the hall is not found by its address"

# No certificate that somebody named vouches for, no user, or no TLS.
refused 4 'no certificate that theirs.pem vouches for' $url --nats-ca theirs.pem --nats-creds creds
refused 4 'no certificate that this machine trusts' $url --nats-creds creds
refused 4 'wants a user' $url --nats-ca ours.pem
refused 4 'does not let in who is in wrong' $url --nats-ca ours.pem --nats-creds wrong
refused 4 'no certificate that this machine trusts' nats://localhost:$port --nats-creds creds
refused 4 'speaks no TLS' tls://localhost:$plain_port --nats-ca ours.pem --nats-creds creds
refused 2 'use --nats-creds' "tls://ada:se:cret@localhost:$port" --nats-ca ours.pem
cp creds open
chmod 644 open
refused 3 'open' $url --nats-ca ours.pem --nats-creds open
refused 5 'no hall answers' nats://localhost:$plain_port --nats-creds creds

# A hall waits for a NATS that is not there yet, and for none that it must not trust.
code=0
sed 's/hall-state/other-state/' hall.toml >other.toml
"$bin/trocar-hall" --config other.toml --nats $url --nats-ca theirs.pem --nats-creds creds >said 2>&1 || code=$?
[ $code = 4 ] && grep -q 'theirs.pem vouches for' said || fail "a hall trusts another authority: $code, $(cat said)"

# NATS is killed, and started with the same certificate: the hall is found again.
kill -KILL "${nats[0]}"
wait "${nats[0]}" || true
start_nats tls.conf
for _ in $(seq 120); do
  found $url && break
  sleep 0.5
done
found $url || fail "the hall does not come back"

# Started with a certificate of another name, nobody talks to it.
kill -KILL "${nats[2]}"
wait "${nats[2]}" || true
write_config elsewhere.conf $port elsewhere
start_nats elsewhere.conf
wait_for_port $port
refused 4 'under that name' $url --nats-ca ours.pem --nats-creds creds
for _ in $(seq 100); do
  [ "$(grep -c 'TLS handshake error' nats.log)" -ge 8 ] && break
  sleep 0.1
done
[ "$(grep -c 'under that name' hall.log)" = 1 ] || fail "the hall does not say once what is wrong"
kill -TERM $hall
wait $hall || fail "the hall ended with $?"
hall=
