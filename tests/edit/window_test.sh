#!/bin/bash
# window_test.sh FOLDER_OF_PROGRAMS WORK_FOLDER: the window of trocar-organ edit, under Xvfb, by mouse and
# keys as a person has them. Exit code 77: skipped, with the reason.
set -euo pipefail
bin=$1 work=$2
skip() {
  echo "SKIPPED: $1"
  exit 77
}
fail() {
  echo "FAILED: $1"
  cat "$work/log"
  exit 1
}
for tool in Xvfb xdotool; do
  command -v $tool >/dev/null || skip "there is no $tool: deploy/setup --with-tests installs it"
done
rm -rf "$work"
mkdir -p "$work"
cd "$work"

# Without a display it says so, and ends.
code=0
env -u DISPLAY -u WAYLAND_DISPLAY "$bin/trocar-organ" edit plate 2>log || code=$?
[ $code = 5 ] && grep -q 'no display' log || fail "without a display the exit code is $code"

Xvfb -displayfd 1 -screen 0 1280x800x24 -nolisten tcp >display 2>xvfb.log &
pids=($!)
trap 'kill "${pids[@]}" 2>/dev/null || true' EXIT
for _ in $(seq 100); do [ -s display ] && break; sleep 0.1; done
[ -s display ] || skip "Xvfb did not start: $(tail -1 xvfb.log)"
DISPLAY=:$(cat display)
export DISPLAY

"$bin/trocar-organ" make plate --out plate.organ >made
"$bin/trocar-organ" edit plate.organ --out edited.organ 2>log &
pids+=($!)
for _ in $(seq 100); do xdotool search --name 'plate - Trocar' >/dev/null 2>&1 && break; sleep 0.1; done
xdotool search --name 'plate - Trocar' >/dev/null || fail "no window"

# Each picture takes its time, so each step waits for what it should leave.
saved() { # HELD: until ctrl-s has saved a plate with so many held nodes, or another number with !N
  local wanted=$1 held
  for _ in $(seq 40); do
    xdotool key ctrl+s
    sleep 0.5
    held=$("$bin/trocar-organ" inspect edited.organ --json 2>/dev/null | grep -oE '"fixed_nodes": [0-9]+' | grep -oE '[0-9]+' || true)
    case $wanted in
      "!"*) [ -n "$held" ] && [ "$held" != "${wanted#!}" ] && return ;;
      *) [ "$held" = "$wanted" ] && return ;;
    esac
  done
  fail "$held nodes are held, not $wanted"
}
first=$("$bin/trocar-organ" inspect plate.organ --json | grep -oE '"fixed_nodes": [0-9]+' | grep -oE '[0-9]+')
saved "$first"
cmp plate.organ edited.organ || fail "an organ that nobody has touched is another file"
xdotool key 2
sleep 1
xdotool mousemove 800 450 mousedown 1
sleep 1
xdotool mousemove 840 450
sleep 1
xdotool mouseup 1
saved "!$first"
xdotool key ctrl+z
saved "$first"
cmp plate.organ edited.organ || fail "undo does not give the first organ back"
xdotool key ctrl+shift+z
saved "!$first"
# A press leaves the organ as it is.
cp edited.organ before.organ
xdotool key 4
sleep 1
xdotool mousedown 1
sleep 2
xdotool mouseup 1
sleep 1
rm edited.organ
saved "!$first"
cmp before.organ edited.organ || fail "a press has changed the organ"
# Another's file stays until somebody has been asked.
kill -TERM "${pids[1]}"
wait "${pids[1]}" || fail "it did not end well"
echo precious >edited.organ
"$bin/trocar-organ" edit plate.organ --out edited.organ 2>log &
pids+=($!)
for _ in $(seq 100); do xdotool search --name 'plate - Trocar' >/dev/null 2>&1 && break; sleep 0.1; done
sleep 2
xdotool key ctrl+s
sleep 2
[ "$(cat edited.organ)" = precious ] || fail "a file was replaced without a question"
kill -TERM "${pids[2]}"
wait "${pids[2]}" || fail "it did not end well"
echo ok
