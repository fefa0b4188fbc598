#!/bin/bash
# run_web.sh recording|codec|page|hands|links|practice|lesson|blood|fine|debrief|access|hostile|hostile_hands|firefox|figures|hour BUILD_FOLDER WORK_FOLDER: one of the tests of the page. Exit code 77:
# skipped, with the reason.
set -euo pipefail
test=$1 build=$2 work=$3
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
bin=$build/bin
export TROCAR_BUILD=$build TROCAR_ROOT=$root TROCAR_MODULES=$build/client/web/page
export TROCAR_RECORDING=$build/tests/web/recording/lesson.mcap TROCAR_CRCS=$build/tests/web/recording/crcs

skip() {
  echo "SKIPPED: $1"
  exit 77
}
[ -e "$build/web/replica_module.wasm" ] || skip "the page is not built: deploy/setup --with-web, then build again"
command -v node >/dev/null || skip "node is not installed"
[ -e "$TROCAR_MODULES/node_modules" ] || skip "npm could not reach its registry when the page was built"

rm -rf "$work"
mkdir -p "$work"
export TROCAR_WORK=$work XDG_STATE_HOME=$work/state XDG_RUNTIME_DIR=$work/run
mkdir -m 700 "$XDG_RUNTIME_DIR"

record() {
  local pids=()
  trap 'kill "${pids[@]}" 2>/dev/null || true' EXIT
  "$bin/trocar-server" --insecure-loopback --listen 127.0.0.1:0 --no-announce --seconds 9 --journal "$TROCAR_RECORDING" \
    --ready-file "$work/port" >"$work/server.log" 2>&1 &
  pids+=($!)
  for _ in $(seq 200); do [ -s "$work/port" ] && break; sleep 0.1; done
  [ -s "$work/port" ] || { cat "$work/server.log"; exit 1; }
  for hand in incise retract; do
    "$bin/trocar-client" --insecure-loopback --server "127.0.0.1:$(cat "$work/port")" --name "$hand" --no-render \
      --script "$root/deploy/scenes/$hand.toml" >"$work/$hand.log" 2>&1 &
    pids+=($!)
  done
  wait "${pids[0]}"
  "$build/tests/frame_crcs" "$TROCAR_RECORDING" >"$TROCAR_CRCS"
  # There is something to compare, and the surface has changed.
  [ "$(wc -l <"$TROCAR_CRCS")" -gt 300 ]
}

case $test in
  recording) record ;;
  hour)
    chromium=$(command -v chromium) || skip "Chromium is not installed: deploy/setup --with-tests --with-web"
    export TROCAR_CHROMIUM=$chromium TROCAR_HOUR=$work/hour.mcap
    "$bin/trocar-sim" "$here/hour.toml" --journal "$TROCAR_HOUR" --out "$work/hour"
    node "$here/hour.mjs"
    ;;
  firefox)
    firefox=$(command -v firefox-esr || command -v firefox) || skip "Firefox is not installed: deploy/setup --with-tests --with-web"
    command -v Xvfb >/dev/null || skip "Firefox draws in a window alone: deploy/setup --with-tests installs xvfb"
    export TROCAR_FIREFOX=$firefox
    Xvfb -displayfd 1 -screen 0 1400x900x24 -nolisten tcp >"$work/display" 2>"$work/xvfb.log" &
    display=$!
    trap 'kill "$display" 2>/dev/null || true' EXIT
    for _ in $(seq 100); do [ -s "$work/display" ] && break; sleep 0.1; done
    [ -s "$work/display" ] || skip "Xvfb did not start: $(tail -1 "$work/xvfb.log")"
    DISPLAY=:$(cat "$work/display") node --experimental-websocket --no-warnings --test-reporter=spec "$here/firefox.test.mjs"
    ;;
  codec) node --test-reporter=spec "$here/codec.test.mjs" ;;
  page | hands | links | practice | lesson | blood | fine | debrief | access | hostile | hostile_hands | figures)
    chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome) ||
      skip "Chromium is not installed: deploy/setup --with-tests --with-web"
    [ -e "$build/web/page/index.html" ] || skip "the page is not built"
    export TROCAR_CHROMIUM=$chromium
    if [ "$test" != figures ]; then
      # As one process, which prints each test as it ends.
      node --experimental-websocket --no-warnings --test-reporter=spec "$here/$test.test.mjs"
    else
      [ -e "$TROCAR_RECORDING" ] || skip "there is no recording: run_web.sh recording makes it"
      node --experimental-websocket --no-warnings "$here/figures.mjs"
    fi
    ;;
esac
