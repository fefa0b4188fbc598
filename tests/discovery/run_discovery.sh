#!/usr/bin/env bash
# Sessions announce themselves and are found, with a real Avahi daemon on a message bus of its own, on the
# loopback interface only. Usage: run_discovery.sh FOLDER_OF_PROGRAMS. Exit code 77: no daemon can be
# started here.
set -uo pipefail
export LC_ALL=C.UTF-8

bin=$(cd "$1" && pwd)
folder=$(mktemp -d)
pids=()
finish() {
  [ ${#pids[@]} -eq 0 ] || kill "${pids[@]}" 2>/dev/null
  wait 2>/dev/null
  rm -rf "$folder"
}
trap finish EXIT
skip() {
  echo "SKIPPED: $1"
  exit 77
}
failed=0
expect() { # TEXT IN
  grep -qF -- "$1" "$folder/$2" && return
  printf 'wanted "%s" in %s:\n' "$1" "$2"
  cat "$folder/$2"
  failed=1
}
wait_for() { # SECONDS COMMAND...
  local tries=$((10 * $1))
  shift
  for ((; tries > 0; --tries)); do
    "$@" >/dev/null 2>&1 && return 0
    sleep 0.1
  done
  return 1
}
serve() { # NAME OPTION...
  local name=$1
  shift
  XDG_STATE_HOME=$folder/state XDG_RUNTIME_DIR=$folder "$bin/trocar-server" --organ lattice \
    --journal none --ready-file "$folder/$name.port" "$@" >"$folder/$name.out" 2>"$folder/$name.log" &
  pids+=($!)
  wait_for 30 test -s "$folder/$name.port" || { cat "$folder/$name.log"; exit 1; }
}
list() { timeout 30 "$bin/trocar-client" --list --seconds "$1" >"$folder/list" 2>"$folder/list.log"; }

# Without a daemon: the server works and says so once, at info; the client says what to do.
export DBUS_SYSTEM_BUS_ADDRESS=unix:path=$folder/bus
serve alone --listen 127.0.0.1:0 --announce Alone
expect 'the session is not announced: ' alone.log
grep -qE ' (error|warning) ' "$folder/alone.log" && { cat "$folder/alone.log"; failed=1; }
list 1
[ $? -eq 5 ] || { echo "trocar-client --list without a daemon: exit code is not 5"; failed=1; }
expect 'start avahi-daemon' list.log

for program in dbus-daemon avahi-daemon; do
  PATH=$PATH:/usr/sbin command -v $program >/dev/null || skip "$program is missing: deploy/setup --with-tests"
done
[ "$(id -u)" -eq 0 ] || skip "only root can start avahi-daemon"
PATH=$PATH:/usr/sbin avahi-daemon --check 2>/dev/null && skip "this machine's own avahi-daemon runs"
cat >"$folder/bus.conf" <<TEXT
<!DOCTYPE busconfig PUBLIC "-//freedesktop//DTD D-Bus Bus Configuration 1.0//EN"
  "http://www.freedesktop.org/standards/dbus/1.0/busconfig.dtd">
<busconfig>
  <type>system</type>
  <listen>unix:path=$folder/bus</listen>
  <auth>EXTERNAL</auth>
  <policy context="default">
    <allow user="*"/> <allow own="*"/> <allow send_destination="*"/>
    <allow send_type="method_call"/> <allow send_type="signal"/> <allow receive_sender="*"/>
    <allow receive_type="method_call"/> <allow receive_type="method_return"/>
    <allow receive_type="error"/> <allow receive_type="signal"/>
  </policy>
</busconfig>
TEXT
printf '%s\n' '[server]' use-ipv4=yes use-ipv6=no allow-interfaces=lo enable-dbus=yes \
  disallow-other-stacks=no '[publish]' publish-workstation=no publish-hinfo=no >"$folder/avahi.conf"
dbus-daemon --config-file="$folder/bus.conf" --nofork >"$folder/bus.log" 2>&1 &
pids+=($!)
wait_for 5 test -S "$folder/bus" || skip "no message bus can be started: $(head -n 1 "$folder/bus.log")"
mkdir -p /run/avahi-daemon
PATH=$PATH:/usr/sbin avahi-daemon -f "$folder/avahi.conf" --no-drop-root --no-chroot --no-rlimits \
  >"$folder/avahi.log" 2>&1 &
pids+=($!)
wait_for 10 grep -q 'startup complete' "$folder/avahi.log" ||
  { cat "$folder/avahi.log" "$folder/bus.log"; skip "no avahi-daemon can be started"; }

# Two of the same name, one with codes and one without; one that nobody is to know of, and one that
# only this machine could reach.
serve one --listen 0.0.0.0:0 --announce 'Lesson ONE'
wait_for 15 grep -q 'announced on the local network as' "$folder/one.log"
serve two --listen 127.0.0.1:0 --insecure-loopback --announce 'Lesson ONE'
serve hidden --listen 0.0.0.0:0 --no-announce
serve local --listen 127.0.0.1:0
serve named --listen 0.0.0.0:0
wait_for 15 grep -q 'announced on the local network as' "$folder/two.log"
# A session of a hall is found like the others.
printf '%s\n' 'listen = "127.0.0.1:0"' "key = '$folder/hall.key'" "recordings = '$folder/recordings'" \
  "state = '$folder/hall'" 'sessions-listen = "0.0.0.0"' 'ports = [17750, 17759]' 'figures-ports = [17760, 17769]' \
  '[[offer]]' 'name = "lattice"' 'organ = "lattice"' 'cores = 0.05' >"$folder/hall.toml"
XDG_STATE_HOME=$folder/state XDG_RUNTIME_DIR=$folder "$bin/trocar-hall" --config "$folder/hall.toml" \
  --ready-file "$folder/hall.port" >"$folder/hall.log" 2>&1 &
pids+=($!)
wait_for 30 test -s "$folder/hall.port" || { cat "$folder/hall.log"; exit 1; }
"$bin/trocar-hall" start lattice --name ward-3 --at "127.0.0.1:$(cat "$folder/hall.port")" --key "$folder/hall.key" \
  >"$folder/ward.out" 2>&1 || { cat "$folder/ward.out" "$folder/hall.log"; failed=1; }
timeout 60 "$bin/trocar-client" --insecure-loopback --no-render --name Ada --seconds 12 \
  --server "127.0.0.1:$(cat "$folder/two.port")" >"$folder/ada.log" 2>&1 &
pids+=($!)
wait_for 10 grep -q 'Ada (surgeon) joined' "$folder/two.log"
sleep 1
list 3 || { cat "$folder/list.log"; failed=1; }
expect "announced on the local network as 'Lesson ONE'" one.log
row() { grep -E "$1" "$folder/list" >/dev/null || { echo "no row: $1"; cat "$folder/list"; failed=1; }; }
row "^Lesson ONE +lattice +0 +yes +[0-9.]+:$(cat "$folder/one.port")\$"
row "^Lesson ONE #2 +lattice +1 +no +[0-9.]+:$(cat "$folder/two.port")\$"
row "^lattice at .* +lattice +0 +yes +[0-9.]+:$(cat "$folder/named.port")\$"
row "^ward-3 +lattice +0 +yes +[0-9.]+:177[0-9]+\$"
for name in hidden local; do
  grep -q ":$(cat "$folder/$name.port")\$" "$folder/list" && { echo "$name is announced"; failed=1; }
done
[ $failed -eq 0 ] && cat "$folder/list"
exit $failed
