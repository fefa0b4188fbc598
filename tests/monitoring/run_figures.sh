#!/usr/bin/env bash
# run_figures.sh BUILD OUT: a real server is asked for health and figures; promtool checks these, and the
# alerts of deploy/monitoring. Every name that alerts and dashboard use is one that the server tells.
# Exit code 77: promtool (Debian: prometheus) is missing; all else has been checked.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
bin=$1/bin out=$2
rm -rf "$out"
mkdir -p "$out/run"
export XDG_STATE_HOME=$out/state XDG_RUNTIME_DIR=$out/run
trap 'kill $(jobs -p) 2>/dev/null || true' EXIT
fail() {
  echo "monitoring: $*"
  exit 1
}

"$bin/trocar-server" --organ lattice --listen 127.0.0.1:0 --metrics 127.0.0.1:0 --no-announce \
  --journal "$out/session.mcap" >"$out/server.log" 2>&1 &
server=$!
for _ in $(seq 400); do
  place=$(sed -n 's|.*figures at \([0-9.:]*\)/metrics.*|\1|p' "$out/server.log")
  [ -n "$place" ] && [ "$(curl -s "http://$place/readyz" || true)" = ok ] && break
  kill -0 $server || fail "$(cat "$out/server.log")"
  sleep 0.05
done
[ "$(curl -s "http://$place/healthz")" = ok ] || fail "the server is not healthy"
[ "$(curl -s "http://$place/readyz")" = ok ] || fail "the server does not become ready"
# The time until the disk is full is told once the recording has a rate.
for _ in $(seq 600); do
  curl -s "http://$place/metrics" >"$out/metrics.txt"
  grep -q '^trocar_recording_disk_left_seconds' "$out/metrics.txt" && break
  sleep 0.1
done
for name in $(grep -oh 'trocar_[a-z0-9_]*' "$root"/deploy/monitoring/* | sort -u); do
  grep -q "^$name[ {]" "$out/metrics.txt" || fail "no figure is called $name"
done
grep -q '^trocar_recording_status{status="whole"} 1$' "$out/metrics.txt" || fail "the recording is not whole"
kill -TERM $server
wait $server || fail "the server ended with $?"
command -v promtool >/dev/null || {
  echo "monitoring: SKIPPED in part: promtool is missing (apt-get install prometheus)"
  exit 77
}
promtool check metrics <"$out/metrics.txt" || fail "promtool refuses the figures"
cd "$root/deploy/monitoring"
promtool check rules alerts.yml
promtool test rules alerts.test.yml
