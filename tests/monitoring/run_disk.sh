#!/usr/bin/env bash
# run_disk.sh BUILD OUT: a real server records onto a disk of 2.4 MB. It warns, ends the recording before the
# disk is full, and what it has recorded is whole and verifies. Exit code 77: no disk can be made here.
set -euo pipefail
bin=$1/bin out=$2
rm -rf "$out"
mkdir -p "$out/run" "$out/small"
export XDG_STATE_HOME=$out/state XDG_RUNTIME_DIR=$out/run
unshare -rm true 2>/dev/null || {
  echo "disk: SKIPPED: unshare -rm is not allowed here"
  exit 77
}
fail() {
  echo "disk: $*"
  exit 1
}

code=0
unshare -rm bash -c '
  mount -t tmpfs -o size=2400k none "$2/small"
  code=0
  "$1/trocar-server" --organ lattice --listen 127.0.0.1:0 --no-announce --insecure-loopback --seconds 60 \
    --journal "$2/small/full.mcap" >"$2/server.log" 2>&1 || code=$?
  cp "$2/small/full.mcap" "$2/full.mcap"
  exit $code' - "$bin" "$out" || code=$?
[ "$code" = 5 ] || fail "the server ended with $code: $(tail -n 1 "$out/server.log")"
grep -q 'the disk of the recording will be full in about' "$out/server.log" || fail "no warning was given"
grep -q 'the disk is nearly full' "$out/server.log" || fail "the recording did not end before the disk was full"
"$bin/trocar-journal" verify "$out/full.mcap" >"$out/verify.log" || fail "verify ended with $?"
grep -q 'finished recording' "$out/verify.log" || fail "the recording has no index"
