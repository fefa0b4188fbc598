#!/usr/bin/env bash
# The part of install_test.sh that runs under systemd: services as the packages bring them. Writes a line
# "passed NAME" or "failed NAME" for each check to /packages/result, and turns the machine off.
set -uo pipefail
exec >/packages/services.log 2>&1
export DEBIAN_FRONTEND=noninteractive
check() { # NAME COMMAND...
  local name=$1 outcome=failed
  shift
  printf '== %s\n' "$name"
  if "$@"; then outcome=passed; fi
  printf '%s %s\n' "$outcome" "$name" >>/packages/result
}
recordings=/var/lib/trocar/recordings
# logs UNIT TEXT: whether the unit's log has it, waiting for up to half a minute.
logs() {
  local i
  for ((i = 0; i < 150; ++i)); do
    if journalctl --quiet --no-pager --output cat --unit "$1" | grep -m 1 "$2"; then return 0; fi
    sleep 0.2
  done
  journalctl --no-pager --unit "$1" | tail -n 20
  return 1
}
session() {
  systemctl start trocar@lesson && logs trocar@lesson '^ *observer '
}
joins() {
  local code
  code=$(logs trocar@lesson '^ *observer ' | awk '{print $2}')
  runuser -u ada -- env HOME=/home/ada trocar-client --join "$code" --role observer --name Ada --no-render --seconds 1
}
page() {
  # Without TLS, so that this shell can speak to it.
  sed -i 's/^# recordings/recordings/; $a insecure-loopback = true' /etc/trocar/web.toml
  systemctl start trocar-web && logs trocar-web '^ *recordings ' && logs trocar-web 'listening' &&
    systemctl is-active trocar-web
}
closed() {
  systemctl stop trocar@lesson && [ "$(systemctl show -P Result trocar@lesson)" = success ] &&
    trocar-journal verify "$recordings"/*.mcap
}
# The page lets trocar-journal simulate a recording again, within the service's own sandbox.
page_checks() {
  local key name
  key=$(logs trocar-web '^ *recordings ' | sed 's/.*=//')
  name=$(basename "$recordings"/*.mcap)
  sleep 6  # what has just changed is still being written, to the page
  exec 3<>/dev/tcp/127.0.0.1/7691
  printf 'GET /recordings/%s/check HTTP/1.1\r\nHost: 127.0.0.1:7691\r\nAuthorization: Bearer %s\r\nConnection: close\r\n\r\n' \
    "$name" "$key" >&3
  cat <&3
  exec 3>&-
  logs trocar-web "$name: verified"
}
private() {
  ! runuser -u ada -- ls "$recordings" && ! runuser -u ada -- ls /var/lib/trocar/state &&
    ! runuser -u ada -- journalctl --quiet --no-pager --unit trocar@lesson | grep observer
}
# The threshold is in tenths.
hardened() { systemd-analyze security --no-pager --threshold=20 "$1" | tail -n 1; }
upgrade() {
  systemctl start trocar@lesson || return 1
  local before
  before=$(systemctl show -P MainPID trocar@lesson)
  dpkg -i /packages/trocar-server_*.deb && [ "$(systemctl show -P MainPID trocar@lesson)" = "$before" ] &&
    systemctl is-active trocar@lesson
}
wrong() {
  echo 'budget = 3' >/etc/trocar/wrong.toml
  systemctl start trocar@wrong
  logs trocar@wrong 'wrong.toml:1: key budget' && sleep 3 && [ "$(systemctl show -P NRestarts trocar@wrong)" = 0 ]
  local result=$?
  rm /etc/trocar/wrong.toml
  systemctl reset-failed trocar@wrong
  return $result
}
killed() {
  local before
  before=$(systemctl show -P MainPID trocar@lesson)
  kill -KILL "$before" && sleep 4 && systemctl is-active trocar@lesson &&
    [ "$(systemctl show -P MainPID trocar@lesson)" != "$before" ]
}
hall() { # COMMAND...
  runuser -u trocar -- trocar-hall "$@" --key /var/lib/trocar/hall.key
}
hall_session() {
  systemctl start trocar-hall && logs trocar-hall listening && hall start follow-the-point --name one | grep surgeon
}
hall_killed() {
  local before
  before=$(systemctl show -P MainPID trocar-hall)
  kill -KILL "$before" && logs trocar-hall 'one: found again' && hall list | grep -q 'one  *running'
}
hall_stop() {
  systemctl stop trocar-hall && [ "$(systemctl show -P Result trocar-hall)" = success ] &&
    trocar-journal verify "$recordings"/*-one/session.mcap
}
removal() {
  systemctl enable trocar@lesson trocar-web && logs trocar@lesson 'at 127.0.0.1'
  apt-get remove -y 'trocar-*' '~i~npython3-trocar' && ! systemctl is-active trocar@lesson && ! systemctl is-active trocar-web &&
    ls "$recordings"/*.mcap
}

check "a session starts as a service" session
check "its log has the codes, and somebody joins with one" joins
check "the page starts as a service, with recordings" page
check "a stop closes the recording, which verifies" closed
check "the page checks that recording, too" page_checks
check "other users see no code and no recording" private
check "systemd finds trocar@ exposed below 2 of 10" hardened trocar@lesson
check "systemd finds trocar-web exposed below 2 of 10" hardened trocar-web
check "an upgrade leaves a running session alone" upgrade
check "a killed session starts again" killed
check "a wrong configuration does not" wrong
check "a hall starts a session as a service" hall_session
check "a killed hall finds its session again" hall_killed
check "a stopped hall closes the recording" hall_stop
check "systemd finds trocar-hall exposed below 2 of 10" hardened trocar-hall
check "a removal ends what runs, and keeps recordings" removal
check "a purge under systemd" apt-get purge -y 'trocar-*'
systemctl poweroff
